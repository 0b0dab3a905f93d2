"""How fast is the sampled loop: 30 s at 1 kHz with sensors, tank and the whole energy ledger, on one core?

Run `PYTHONPATH=src:benchmarks python benchmarks/sampled.py [--quick]`. Ours and the alternatives by turns in one run on
one machine: read the ratios. No test asserts a time.
"""

from __future__ import annotations

import argparse
import dataclasses

import numpy as np
from rich.console import Console
from rich.table import Table

from passiflex.loops.compiled import CompiledSampledLoop, compiled_sampled_loop
from passiflex.native import HeldLoop, NativeFunction
from passiflex.problems.problem import SampledProblem
from passiflex.simulation import Problem, simulate_problem
from passiflex.simulation.schedule import PeriodRows
from passiflex.simulation.simulate_sampled import longest_step, start
from speed import Row, by_turns, machine, median_times, problem_of

ASKED = 0.8
"""Seconds for 30 s at 1 kHz, warm, on one core."""


def compiled_of(problem: Problem) -> CompiledSampledLoop:
    assert isinstance(problem, SampledProblem)
    return compiled_sampled_loop(problem.loop)


def in_machine(problem: Problem, seconds: float) -> None:
    """Run the same loop with CasADi's virtual machine, period by period from Python."""
    s, compiled = problem, compiled_of(problem)
    assert s is not None
    loop = HeldLoop(compiled.loop.plant.rhs, compiled.loop.control)
    rows, timing = PeriodRows(problem, compiled.loop.period, compiled.row).take(0, round(seconds / s.period))
    longest = longest_step(problem, compiled.plant)
    begin = start(problem, compiled)
    unwatched = loop.start(begin.x, begin.controller, s.held)
    loop.advance(unwatched, rows, timing, s.plant, s.numbers, s.period, longest)


def compiled_from_python(problem: Problem, seconds: float) -> None:
    """Run it with compiled functions, but the loop over periods and steps in Python, as one writes it first."""
    s, compiled = problem, compiled_of(problem)
    assert s is not None
    count = round(seconds / s.period)
    rows, _ = PeriodRows(problem, compiled.loop.period, compiled.row).take(0, count)
    steps = int(np.ceil(s.period / longest_step(problem, compiled.plant)))
    h, state = s.period / steps, start(problem, compiled)
    x, memory, held = state.x, state.controller, s.held
    n_s = compiled.held.n_s
    for row in rows:
        memory, command, _ = compiled.control(x, memory, row, s.numbers)
        u = np.concatenate([held, row[:n_s]])
        for _ in range(steps):
            k1 = compiled.plant(x, u, s.plant)[0]
            k2 = compiled.plant(x + h / 2 * k1, u, s.plant)[0]
            k3 = compiled.plant(x + h / 2 * k2, u, s.plant)[0]
            k4 = compiled.plant(x + h * k3, u, s.plant)[0]
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        held = command


def per_call(function: NativeFunction, columns: list[np.ndarray], repeats: int) -> float:
    return float(np.median(by_turns(repeats, lambda: function.map(*columns)))) / len(columns[0])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="fewer repeats and shorter pieces")
    quick = parser.parse_args().quick
    repeats, chunk = (3, 0.05) if quick else (7, 0.2)
    console = Console(width=150)
    console.print(machine(), highlight=False)
    problem = problem_of("fig1_sampled")
    assert isinstance(problem, SampledProblem)
    compiled = compiled_of(problem)
    coarse = dataclasses.replace(problem, output_interval=0.005)
    whole, sparse, python, vm = median_times(
        repeats,
        lambda: simulate_problem(problem),
        lambda: simulate_problem(coarse),
        lambda: compiled_from_python(problem, chunk),
        lambda: in_machine(problem, chunk),
    )
    scale = problem.duration / chunk
    x, c, row = (np.tile(v, (2000, 1)) for v in _point(problem, compiled))
    u = np.tile(np.concatenate([problem.held, np.zeros(compiled.held.n_s)]), (2000, 1))
    rows = [
        Row("30 s at 1 kHz, every sample recorded", whole, python * scale, "compiled, loop in Python", ASKED),
        Row("  same, every fifth recorded", sparse, vm * scale, "CasADi VM, loop in Python", ASKED),
        Row(
            "one period of the controller, in C",
            per_call(compiled.control, [x, c, row, problem.numbers], repeats),
        ),
        Row("one slope of the plant, in C", per_call(compiled.plant, [x, u, problem.plant], repeats)),
    ]
    table = Table("what", "ours", "alternative", "ratio", "asked", "met")
    for line in rows:
        table.add_row(*line.cells())
    console.print(table)
    steps = int(np.ceil(problem.period / longest_step(problem, compiled.plant)))
    console.print(
        f"- {steps} plant steps of order 4 per period; the controller has {compiled.loop.control.n_instructions()} "
        f"instructions, the plant {compiled.loop.plant.rhs.n_instructions()}; alternatives scaled from {chunk:g} s",
        highlight=False,
    )


def _point(problem: Problem, compiled: CompiledSampledLoop) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    state = start(problem, compiled)
    rows, _ = PeriodRows(problem, compiled.loop.period, compiled.row).take(0, 1)
    return state.x, state.controller, rows[0]


if __name__ == "__main__":
    main()
