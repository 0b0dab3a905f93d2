"""How fast is it, beside the plain way?

Run `PYTHONPATH=src:benchmarks python benchmarks/speed.py [--quick]`. All numbers of one table come from one run on
one machine, ours and the alternative by turns: read the ratios. No test asserts a time.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from importlib import resources

import casadi as cs
import numpy as np
import pinocchio
import scipy
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

import plain
from passiflex.control.motion import MOTION
from passiflex.native import DRIVER, NativeFunction, find_compiler, library
from passiflex.simulation import (
    ClosedLoop,
    CompiledLoop,
    Problem,
    Run,
    compiled_loop,
    load_scenario,
    resolve,
    simulate_problem,
)

Array = NDArray[np.float64]
SAME = 1e-8
"""Relative difference up to which two vector fields are the same."""
STATES = ("q", "theta", "dq", "dtheta", "tank_energy")
COMPILE = """
import time
start = time.perf_counter()
from importlib import resources
from passiflex.simulation import ClosedLoop, load_scenario, resolve, compiled_loop
problem = resolve(load_scenario(resources.files("passiflex.studies") / "scenarios" / "fig1.yaml"))
begun = time.perf_counter()
compiled_loop(ClosedLoop(problem.law))
print(begun - start, time.perf_counter() - begun)
"""


@dataclasses.dataclass
class Row:
    """One line of the table; times in s. `asked` is a bound on `ours` [s], or on the ratio if `times`."""

    what: str
    ours: float
    alternative: float | None = None
    alternative_is: str = ""
    asked: float | None = None
    times: bool = False

    @property
    def ratio(self) -> float | None:
        return None if self.alternative is None else self.alternative / self.ours

    @property
    def met(self) -> str:
        if self.asked is None:
            return ""
        met = (self.ratio or 0.0) >= self.asked if self.times else self.ours <= self.asked
        return "yes" if met else "NO"

    def cells(self) -> list[str]:
        asked = (
            "" if self.asked is None else f"≥ {self.asked:g}×" if self.times else f"≤ {pretty(self.asked)}"
        )
        other = "" if self.alternative is None else f"{pretty(self.alternative)}  {self.alternative_is}"
        return [
            self.what,
            pretty(self.ours),
            other,
            f"{self.ratio:.1f}×" if self.ratio else "",
            asked,
            self.met,
        ]


def pretty(seconds: float) -> str:
    for factor, unit in ((1, "s"), (1e3, "ms")):
        if seconds * factor >= 1:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e6:.3g} µs"


def by_turns(repeats: int, *works: Callable[[], object], loops: int = 1) -> Array:
    """Return the times of one call of each work [s], shape (repeats, works): by turns, after a call of each.

    By turns, so that what else runs on the machine strikes all of them alike.
    """
    for work in works:
        work()
    times = np.empty((repeats, len(works)))
    for row in times:
        for i, work in enumerate(works):
            start = time.perf_counter()
            for _ in range(loops):
                work()
            row[i] = (time.perf_counter() - start) / loops
    return times


def median_times(repeats: int, *works: Callable[[], object]) -> list[float]:
    return [float(t) for t in np.median(by_turns(repeats, *works), axis=0)]


def problem_of(name: str) -> Problem:
    with resources.as_file(resources.files("passiflex.studies") / "scenarios" / f"{name}.yaml") as path:
        return resolve(load_scenario(path))


def states_of(run: Run) -> Array:
    return np.column_stack([run[name].reshape(len(run.time), -1) for name in STATES])


def random_point(loop: CompiledLoop, problem: Problem, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return a state and an input: moving, with stretched joints, a wrench and noise, reference at home."""
    n = problem.law.robot.n
    q, dq = problem.q + rng.uniform(-1, 1, n), rng.normal(0, 1, n)
    theta, dtheta = q + rng.normal(0, 1e-3, n), dq + rng.normal(0, 0.1, n)
    x = np.concatenate([q, theta, dq, dtheta, [2.0, 0.0]])
    motion = problem.events[0].motion
    assert motion is not None
    noise, F_e = rng.normal(0, 0.4, n), rng.normal(0, 10, 6)
    return x, loop.loop.inputs.pack({**motion, "F_e": F_e, "torque_noise": noise})


def same_field(loop: CompiledLoop, problem: Problem, points: int, rng: np.random.Generator) -> float:
    """Return the largest relative difference of the two vector fields (norm over norm) at random points."""
    other, worst = plain.PlainLoop(problem), 0.0
    for _ in range(points):
        x, u = random_point(loop, problem, rng)
        other.F_e, other.noise = u[loop.loop.inputs.slices["F_e"]], u[loop.loop.inputs.slices["torque_noise"]]
        ours = loop.fixed_step.rhs(x, u, problem.numbers)[0][:-1]  # without the reference's clock
        difference = np.linalg.norm(ours - other(0.0, x[:-1])) / np.linalg.norm(ours)
        worst = max(worst, float(difference))
    return worst


def field_rows(
    loop: CompiledLoop, problem: Problem, repeats: int, rng: np.random.Generator
) -> tuple[list[Row], str]:
    points = [random_point(loop, problem, rng) for _ in range(2000)]
    x, u = (np.array(column) for column in zip(*points, strict=True))
    few, p = 200, problem.numbers
    native, machine, other = loop.fixed_step.rhs, NativeFunction(loop.loop.rhs), plain.PlainLoop(problem)
    times = by_turns(
        repeats,
        lambda: native.map(x, u, p),
        lambda: machine.map(x[:few], u[:few], p),
        lambda: [other(0.0, state) for state in x[:few, :-1]],
    ) / np.array([len(x), few, few])
    ours, in_machine, in_python = (float(t) for t in np.median(times, axis=0))
    return [
        Row("closed-loop vector field, per call in C", ours, in_python, "plain, Python", 3e-6),
        Row("  same, beside CasADi's virtual machine", ours, in_machine, "CasADi VM"),
    ], f"vector field in C: fastest of the {repeats} repeats {pretty(times[:, 0].min())}"


def law_row(loop: CompiledLoop, problem: Problem, repeats: int, rng: np.random.Generator) -> tuple[Row, str]:
    law, n = loop.law, problem.law.robot.n
    fresh = rng.normal(0, 1e-3, n)
    q, theta, *_ = law.inputs
    motion = problem.events[0].motion
    assert motion is not None
    q[:], theta[:] = problem.q, problem.theta
    model, gains = law.inputs[-2:]
    model[:], gains[:] = problem.model, problem.gains
    law.inputs[7][:] = MOTION.pack(motion)

    def cycle() -> None:
        q[:] = problem.q
        theta[:] = fresh
        law.call()

    times = by_turns(repeats, cycle, law.call, loops=5000)
    took, bare = (float(t) for t in np.median(times, axis=0))
    tracemalloc.start()
    for _ in range(10):
        cycle()
    before = tracemalloc.get_traced_memory()[0]
    tracemalloc.reset_peak()
    for _ in range(1000):
        cycle()
    after, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    text = (
        f"control law from Python: fastest repeat {pretty(times[:, 0].min())}; {pretty(bare)} of the median is call() "
        f"alone; over 1000 calls Python's memory grew by {after - before} B, "
        f"and never stood more than {peak - before} B higher"
    )
    return Row("control law from Python (write q, θ; call)", took, asked=5e-6), text


def allocations(loop: CompiledLoop) -> list[str]:
    """Return the calls in the generated C that allocate or free memory."""
    functions = [loop.loop.rhs, loop.loop.outputs, loop.loop.law_function]
    source = library.generate(functions, DRIVER)
    return re.findall(r"\b(?:malloc|calloc|realloc|alloca|free)\s*\(", source)


def fig1_rows(problem: Problem, repeats: int) -> tuple[list[Row], str]:
    """Compare the 30 s run as asked, and then on equal terms."""
    loop, loose = plain.PlainLoop(problem), dataclasses.replace(problem, tolerance=1e-6)

    def with_signals() -> None:
        rows = plain.simulate(problem, rtol=problem.tolerance, atol=problem.tolerance * 1e-2).states
        for row in rows:  # the law once more at each row, for the torques and powers that our run records
            loop(0.0, row)

    ours, loosely, theirs, scipy_default, equal = median_times(
        repeats,
        lambda: simulate_problem(problem),
        lambda: simulate_problem(loose),
        lambda: plain.simulate(problem),
        lambda: plain.simulate(problem, atol=1e-6),
        with_signals,
    )
    run, other = simulate_problem(problem), plain.simulate(problem)
    difference = np.abs(states_of(run) - other.states)
    at_end = difference[-1, :-1].max(), difference[-1, -1]
    text = (
        f"Fig. 1, ours (tolerance {problem.tolerance:g}) against plain BDF (rtol 1e-6, atol 1e-8), {other.calls} "
        f"evaluations: largest difference at the end {at_end[0]:.1e} (rad, rad/s), tank {at_end[1]:.1e} J; over the "
        f"whole run {difference[:, :14].max():.1e} rad, tank {difference[:, -1].max():.1e} J"
    )
    what = f"Fig. 1, {problem.duration:g} s, warm (tolerance {problem.tolerance:g})"
    return [
        Row(
            what,
            ours,
            theirs,
            "plain BDF 1e-6, atol 1e-8",
            50,
            True,
        ),
        Row("  same, SciPy's default atol", ours, scipy_default, "plain BDF 1e-6, atol 1e-6"),
        Row("  equal tolerance 1e-6", loosely, theirs, "plain BDF 1e-6, atol 1e-8"),
        Row("  equal tolerance 1e-9, equal signals", ours, equal, "plain BDF 1e-9 + law at 6001 rows"),
    ], text


def fig3_rows(problem: Problem, ours_for: float, plain_for: float, repeats: int) -> tuple[list[Row], str]:
    """Compare short chunks from the start, both scaled to one simulated second."""

    def chunk(duration: float, interval: float) -> Problem:
        return dataclasses.replace(
            problem, duration=duration, output_interval=interval, events=problem.events[:1]
        )  # the noise is drawn period by period: a shorter run sees the same

    long, short = chunk(ours_for, problem.output_interval), chunk(plain_for, 1e-3)
    ours, bdf, lsoda = np.array(
        median_times(
            repeats,
            lambda: simulate_problem(long),
            lambda: plain.simulate(short),
            lambda: plain.simulate(short, method="LSODA"),
        )
    ) / (ours_for, plain_for, plain_for)
    fine = plain.simulate(short, rtol=1e-9, atol=1e-12).states
    scale = np.abs(fine).max(axis=0)
    errors = [
        np.max(np.abs(states - fine).max(axis=0)[:14] / scale[:14])
        for states in (states_of(simulate_problem(short)), plain.simulate(short).states)
    ]
    tank = states_of(simulate_problem(short))[-1, -1] - fine[-1, -1]
    text = (
        f"Fig. 3: ours over {ours_for:g} s, plain over {plain_for * 1e3:g} ms ({plain.simulate(short).calls} "
        f"evaluations, restarted at each of {round(plain_for / 1e-3)} holds), both scaled to 1 s; against BDF 1e-9: "
        f"largest error of q, θ relative to their size: ours {errors[0]:.1e}, plain BDF 1e-6 {errors[1]:.1e}; "
        f"our tank {tank:.1e} J"
    )
    return [
        Row("Fig. 3 with noise, per simulated second", ours, bdf, "plain BDF 1e-6, scaled", 200, True),
        Row("  same, LSODA", ours, lsoda, "plain LSODA 1e-6, scaled"),
    ], text


def subprocess_seconds(code: str, **environment: str) -> list[float]:
    """Return what `code` prints, as numbers, run in a new interpreter."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return [float(word) for word in done.stdout.split()]


def start_rows(repeats: int) -> list[Row]:
    with tempfile.TemporaryDirectory() as empty:
        cold = subprocess_seconds(COMPILE, PASSIFLEX_CACHE=empty)[1]
        warm = subprocess_seconds(COMPILE, PASSIFLEX_CACHE=empty)[1]

    def imported(module: str) -> float:
        code = f"import time; t = time.perf_counter(); import {module}; print(time.perf_counter() - t)"
        return float(np.median([subprocess_seconds(code)[0] for _ in range(repeats)]))

    return [
        Row("first compile of the closed loop, empty cache", cold, asked=15.0),
        Row("  second process, same cache", warm),
        Row("import passiflex", imported("passiflex"), asked=0.5),
        Row("  import passiflex.simulation", imported("passiflex.simulation")),
    ]


def machine() -> str:
    model = platform.processor()
    if os.path.exists("/proc/cpuinfo"):
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            model = next(
                (line.split(":", 1)[1].strip() for line in file if line.startswith("model name")), model
            )
    compiler = find_compiler()
    identity = " | ".join(compiler.identity.splitlines()[:2]) if compiler else "no compiler"
    flags = " ".join(compiler.flags) if compiler else ""
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return (
        f"{model}, {os.cpu_count()} cores{load}, {platform.system()} {platform.machine()}\n{identity}\n{flags}\n"
        f"Python {platform.python_version()}, NumPy {np.__version__}, SciPy {scipy.__version__}, "
        f"Pinocchio {pinocchio.__version__}, CasADi {cs.__version__}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="fewer repeats and shorter pieces")
    quick = parser.parse_args().quick
    repeats, runs, starts = (3, 3, 1) if quick else (15, 5, 5)
    console, rng = Console(width=150), np.random.default_rng(0)
    console.print(machine(), highlight=False)
    fig1, fig3 = problem_of("fig1"), problem_of("fig3")
    loop = compiled_loop(ClosedLoop(fig1.law))
    apart = [same_field(loop, problem, 200, rng) for problem in (fig1, fig3)]
    if max(apart) > SAME:
        raise SystemExit(
            f"the two ways are not the same closed loop: the vector fields differ by {max(apart):.1e}"
        )
    notes = [
        f"vector fields, largest relative difference at 200 random points: Fig. 1 {apart[0]:.1e}, "
        f"Fig. 3 {apart[1]:.1e} (must be below {SAME:g})",
        f"the vector field has {loop.loop.rhs.n_instructions()} instructions, the law "
        f"{loop.loop.law_function.n_instructions()}; allocating calls in the generated C: "
        f"{allocations(loop) or 'none'}",
    ]
    rows, note = field_rows(loop, fig1, repeats, rng)
    notes.append(note)
    row, note = law_row(loop, fig1, repeats, rng)
    rows.append(row)
    notes.append(note)
    for more, note in (
        fig1_rows(fig1, runs),
        fig3_rows(fig3, *((0.2, 0.005) if quick else (1.0, 0.02)), runs),
    ):
        rows += more
        notes.append(note)
    rows += start_rows(starts)

    table = Table("what", "ours", "alternative", "ratio", "asked", "met")
    for row in rows:
        table.add_row(*row.cells())
    console.print(table)
    for note in notes:
        console.print(f"- {note}", highlight=False)
    console.print(
        f"Medians: {repeats} repeats (Figs. 1 and 3 {runs}, compile 1, imports {starts}), ours and the alternative by "
        "turns, after one call of each to warm up, but for compile and imports.",
        highlight=False,
    )


if __name__ == "__main__":
    main()
