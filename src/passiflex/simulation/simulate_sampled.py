"""Run a sampled problem through time: the law once per period, the plant between in native steps."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from passiflex.elements import Mobility
from passiflex.engines.engine import NATIVE, AbstractEngine
from passiflex.errors import SimulationError
from passiflex.loops.compiled import CompiledSampledLoop, compiled_sampled_loop
from passiflex.loops.recorded import sample_parts
from passiflex.loops.witness import Noted
from passiflex.native import LoopState, NativeFunction, fastest_pole
from passiflex.native.stability import STABILITY_LIMIT
from passiflex.problems.problem import SampledProblem
from passiflex.runs.run import Recorded, Run, assemble
from passiflex.simulation.schedule import NOW, PeriodRows
from passiflex.stability.admissible import require_stable
from passiflex.stability.loop_at_rest import at_rest, standing
from passiflex.stability.noise_credit import charged

Array = NDArray[np.float64]

RESOLVED = 0.35
"""Share of Runge-Kutta's stability limit that a step uses: energies of Fig. 1 then close to 1e-8 J."""
TOUCHING = 0.15
"""Step times the rate at which robot and element swing on each other: some twenty steps for an impact."""
CHUNK = 8192
"""Periods that are made ready at a time; it bounds the memory, whatever the length of a run."""
MOST_STEPS = 200_000_000
"""Steps of one run at most, about two minutes."""


def simulate_sampled(problem: SampledProblem, engine: AbstractEngine = NATIVE) -> Run:
    """Return the run of a sampled problem.

    A run that leaves the finite numbers ends there, and says so in `Run.failure`.

    Raises
    ------
    UnstableLoopError
        If the loop is unstable at its rate and delay, and the scenario does not allow_unstable.
    """
    require_stable(problem)
    return simulate_unchecked(problem, engine)


def simulate_unchecked(problem: SampledProblem, engine: AbstractEngine = NATIVE) -> Run:
    """Return the run of a sampled problem, stable or not."""
    moved = engine.prepared(charged(problem))
    return _record(moved, compiled_sampled_loop(moved.loop), engine)


def start(problem: SampledProblem, compiled: CompiledSampledLoop) -> LoopState:
    """Return the loop at rest at its start, with the reference where the end effector is."""
    at, gains = standing(problem), problem.law.layout.unpack(problem.gains)
    rest = at_rest(problem, at, problem.home, gains["stiffness"], problem.tank.initial, running=0.0)
    x = compiled.loop.plant.at_rest(at.q, at.theta, at.arm.pose)
    return compiled.held.start(x, compiled.loop.start(rest), problem.held)


def longest_step(problem: SampledProblem, plant: NativeFunction) -> float:
    """Return the longest step that resolves the plant's fastest pole at the start, with the worst drag."""
    layout = problem.loop.plant.environment
    at = standing(problem)
    x = problem.loop.plant.at_rest(at.q, at.theta, at.arm.pose)
    worst = layout.zeros()
    for event in problem.events:
        worst |= {name: np.maximum(worst[name], value) for name, value in event.inputs.items()}
    pole = fastest_pole(plant, x, np.concatenate([problem.held, layout.pack(worst)]), problem.plant)
    touching = max((e.rate(mobility(problem)) for e in problem.elements), default=0.0)
    longest = min(RESOLVED * STABILITY_LIMIT / pole, TOUCHING / touching if touching else math.inf)
    if problem.duration / longest > MOST_STEPS:
        raise SimulationError(
            "the plant is too fast to be simulated",
            got=f"fastest pole {pole:.3g} 1/s, {problem.duration / longest:.2g} steps",
            needs=f"at most {MOST_STEPS:.0e} steps",
        )
    return longest


def mobility(problem: SampledProblem) -> Mobility:
    """Return how easily the robot is moved where it may be touched, at its start."""
    at, plant = standing(problem), problem.parts.unpack("plant", problem.numbers)
    J, free = at.arm.jacobian, np.linalg.inv(at.arm.mass_matrix)
    return Mobility(J @ free @ J.T, at.arm.pose.rotation, np.diag(free), 1 / plant["motor_inertia"])


def sample_count(problem: SampledProblem) -> int:
    """Return the number of samples of a whole run, the first and the last included."""
    periods = problem.duration / problem.period
    whole = abs(periods - round(periods)) < NOW / problem.period
    return (round(periods) if whole else int(periods)) + 1


def left_finite(time: float) -> str:
    """Return how a run says that it left the finite numbers at a time [s]."""
    return f"the state left the finite numbers {time:.4g} s after the start"


def _record(problem: SampledProblem, compiled: CompiledSampledLoop, engine: AbstractEngine) -> Run:
    loop = compiled.loop
    state = start(problem, compiled)
    longest = longest_step(problem, compiled.plant)
    held = engine.held(problem, compiled, state.x, longest)
    every = round(problem.output_interval / problem.period)
    rows = PeriodRows(problem, loop.period, compiled.row)
    chunks: list[list[Array]] = []
    samples, failure = sample_count(problem), ""
    witness = loop.witness
    p_watch = np.concatenate([problem.numbers, witness.numbers(problem.law.robot, problem.tank.initial)])
    chunk = max(1, CHUNK // every) * every
    for first in range(0, samples, chunk):
        count = min(chunk, samples - first)
        told, timing = rows.take(first, count)
        done = held.advance(
            state,
            told,
            timing,
            problem.plant,
            problem.numbers,
            problem.period,
            longest,
            every,
            last=first + count == samples,
            first=first,
            p_watch=p_watch,
        )
        state = done.state
        good = done.completed // every + 1 if done.completed < count else None
        parts = (done.x, done.quads, done.controller, done.command, done.signals, told[::every])
        chunks.append([part[:good] for part in parts])
        if done.completed < count:
            failure = done.why or left_finite((first + done.completed) * problem.period)
            break
    seen = [np.vstack(part) for part in zip(*chunks, strict=True)]
    return _assemble(problem, compiled, seen, failure, witness.noted(state.watched), engine)


def _assemble(
    problem: SampledProblem,
    compiled: CompiledSampledLoop,
    seen: list[Array],
    failure: str,
    noted: Noted,
    engine: AbstractEngine,
) -> Run:
    parts = sample_parts(compiled.loop)
    x, _, _, command, _, rows = seen
    felt = slice(0, compiled.loop.plant.environment.size)
    truth = np.asarray(compiled.outputs.map(x, command, rows[:, felt], problem.numbers), dtype=float)
    everything = [*seen[:-1], truth, rows]
    count = _whole_rows(everything) if failure else len(x)
    recorded = []
    for layout, numbers in zip(parts.values(), everything, strict=True):
        recorded.append(Recorded(layout.kept, numbers[:count, layout.columns(lambda f: f.kept)]))
    every = round(problem.output_interval / problem.period)
    time: Array = np.arange(count, dtype=np.float64) * (problem.period * every)
    return assemble(problem, time, recorded, [], failure, noted, engine.version)


def _whole_rows(parts: list[Array]) -> int:
    """Return how many rows come before the first with a number that is not finite: energies overflow before states."""
    good = np.all([np.isfinite(part).all(axis=1) for part in parts], axis=0)
    return len(good) if good.all() else max(1, int(np.argmin(good)))
