"""Run a sampled problem through time: the law once per period, the plant between in native steps."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.errors import SimulationError
from passiflex.layout import Field, Layout
from passiflex.native import LoopState, NativeFunction, fastest_pole
from passiflex.native.fixed_step import STABILITY_LIMIT
from passiflex.simulation.admissible import require_stable
from passiflex.simulation.compiled import CompiledSampledLoop, compiled_sampled_loop
from passiflex.simulation.plant import PLANT_ENERGIES
from passiflex.simulation.problem import Problem, Sampling
from passiflex.simulation.rows import NOW
from passiflex.simulation.rows import Rows as PeriodRows
from passiflex.simulation.run import Rows, Run, assemble

Array = NDArray[np.float64]

RESOLVED = 0.35
"""Share of Runge-Kutta's stability limit that a step uses: energies of Fig. 1 then close to 1e-8 J."""
PIECE = 8192
"""Periods that are made ready at a time; it bounds the memory, whatever the length of a run."""
MOST_STEPS = 200_000_000
"""Steps of one run at most, about two minutes."""
INTERNAL = (
    "started", "read_q", "read_theta", "read_dq", "read_dtheta", "read_tau_a", "read_wrench", "last_q",
    "last_tau_a", "last_command", "running", "given_torque", "claimed_power", "claimed_cartesian_power",
    "variable_potential", "seen", "seen_theta", "seen_deflection", "seen_dq", "seen_ddq", "in_flight",
    "momentum", "known_torque", "observing", "lost_time",
)  # fmt: skip
"""Memory of the controller that is of no interest to a reader, or is recorded under another name."""


class _Recorded(NamedTuple):
    """Rows of the result."""

    x: Array
    quads: Array
    memory: Array
    command: Array
    signals: Array
    rows: Array


def simulate_sampled(problem: Problem) -> Run:
    """Return the run of a sampled problem.

    A run that leaves the finite numbers ends there, and says so in `Run.failure`.

    Raises
    ------
    UnstableLoopError
        If the loop is unstable at its rate and delay, and the scenario does not insist.
    """
    assert problem.sampling is not None
    require_stable(problem)
    compiled = compiled_sampled_loop(problem.sampling.controller)
    return _record(problem, compiled)


def start(problem: Problem, compiled: CompiledSampledLoop) -> LoopState:
    """Return the loop at rest at its start, with the reference where the end effector is."""
    s, loop = problem.sampling, compiled.loop
    assert s is not None
    stiffness = problem.law.layout.unpack(problem.gains)["stiffness"]
    known: dict[str, Any] = {
        "governed_position": problem.home.position,
        "governed_rotation": problem.home.rotation,
        "held_stiffness": stiffness,
        "tank_energy": problem.tank.initial,
        "lowest_level": problem.tank.initial,
        "last_command": s.held,
        "given_torque": s.held,
    }
    memory = loop.memory.pack({f.name: known.get(f.name, np.zeros(f.shape)) for f in loop.memory})
    zero = np.zeros(problem.law.robot.n)
    return compiled.held.start(np.concatenate([problem.q, problem.theta, zero, zero]), memory, s.held)


def longest_step(problem: Problem, plant: NativeFunction) -> float:
    """Return the longest step that resolves the plant's fastest pole at the start, with the worst drag."""
    s = problem.sampling
    assert s is not None
    zero = np.zeros(problem.law.robot.n)
    x = np.concatenate([problem.q, problem.theta, zero, zero])
    worst = np.sum([d.numbers for d in s.drags], axis=0) if s.drags else np.zeros(2)
    pole = fastest_pole(plant, x, np.concatenate([s.held, np.zeros(6), worst]), s.plant)
    longest = RESOLVED * STABILITY_LIMIT / pole
    if problem.duration / longest > MOST_STEPS:
        raise SimulationError(
            "the plant is too fast to be simulated",
            got=f"fastest pole {pole:.3g} 1/s, {problem.duration / longest:.2g} steps",
            needs=f"at most {MOST_STEPS:.0e} steps",
        )
    return longest


def _record(problem: Problem, compiled: CompiledSampledLoop) -> Run:
    s, loop, held = problem.sampling, compiled.loop, compiled.held
    assert s is not None
    state = start(problem, compiled)
    longest = longest_step(problem, compiled.plant)
    periods = (
        round(problem.duration / s.period)
        if _whole(problem.duration, s)
        else int(problem.duration / s.period)
    )
    every = round(problem.output_interval / s.period)
    rows = PeriodRows(problem, loop, compiled.reference)
    pieces: list[_Recorded] = []
    samples, failure = periods + 1, ""
    piece = max(1, PIECE // every) * every
    for first in range(0, samples, piece):
        count = min(piece, samples - first)
        told, timing = rows.take(first, count)
        done = held.advance(
            state, told, timing, s.plant, s.numbers, s.period, longest, every, last=first + count == samples
        )
        state = done.state
        pieces.append(
            _Recorded(done.x, done.quads, done.controller, done.command, done.signals, told[::every])
        )
        if done.completed < count:
            failure = f"the state left the finite numbers {(first + done.completed) * s.period:.4g} s after the start"
            break
    all_rows = _Recorded(*(np.vstack(part) for part in zip(*pieces, strict=True)))
    good = np.isfinite(all_rows.x).all(axis=1) & np.isfinite(all_rows.quads).all(axis=1)
    kept = _Recorded(*(part[: int(np.argmin(good)) if not good.all() else None] for part in all_rows))
    return _assemble(problem, compiled, kept, every, failure)


def _whole(duration: float, s: Sampling) -> bool:
    return abs(duration / s.period - round(duration / s.period)) < NOW / s.period


def _assemble(problem: Problem, compiled: CompiledSampledLoop, r: _Recorded, every: int, failure: str) -> Run:
    loop, s = compiled.loop, problem.sampling
    assert s is not None
    names = [f.name for f in loop.row]
    felt = slice(0, loop.row.slices["desired_position"].start)
    truth = np.asarray(compiled.outputs.map(r.x, r.command, r.rows[:, felt], s.numbers), dtype=float)
    n = problem.law.robot.n
    state = Layout(
        (
            Field("q", (n,), "rad", "link position"),
            Field("theta", (n,), "rad", "motor position"),
            Field("dq", (n,), "rad/s", "link velocity"),
            Field("dtheta", (n,), "rad/s", "motor velocity"),
        )
    )
    motors = Layout((Field("tau_m", (n,), "N m", "motor torque in force"),))
    wished = Layout(tuple(f for f in loop.row if f.name in ("desired_position", "desired_rotation")))
    first = names.index("desired_position")
    assert names[first + 1] == "desired_rotation"
    kept = Layout(tuple(f for f in loop.memory if f.name not in INTERNAL))
    columns = np.hstack([np.arange(loop.memory.size)[loop.memory.slices[f.name]] for f in kept])
    begin = loop.row.slices["desired_position"].start
    recorded = [
        Rows(state, r.x),
        Rows(PLANT_ENERGIES, r.quads, "_energy"),
        Rows(kept, r.memory[:, columns]),
        Rows(motors, r.command),
        Rows(loop.signals, r.signals),
        Rows(loop.truth, truth),
        Rows(wished, r.rows[:, begin : begin + wished.size]),
    ]
    time: Array = np.arange(len(r.x), dtype=np.float64) * (s.period * every)
    return assemble(problem, time, recorded, [], failure)
