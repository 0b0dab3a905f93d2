"""How fast is a sampled run in MuJoCo, with the law stepped from Python, beside the native loop; and how far apart?

Run `PYTHONPATH=src:benchmarks python benchmarks/engines.py [--quick]`. Both by turns in one run on one machine: read
the ratios. No test asserts a time.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from passiflex.passivity import audit
from passiflex.problems.problem import Problem
from passiflex.simulation import resolve, simulate_problem
from passiflex.studies import shipped_scenario
from passiflex.texts.changes import changed
from speed import machine, median_times

WALL: dict[str, Any] = {"kind": "plane", "point": [0, 0, -0.03], "normal": [0, 0, 1], "relative": True}
"""Three centimetres below the hand; the reference goes ten."""


def problems(seconds: float) -> dict[str, Problem]:
    """Return Fig. 1's task at 1 kHz, and presses on surfaces."""
    base = {"duration": seconds, "reference": [{"at": 0.2, "kind": "step", "by": [0, 0, 0.1]}], "forces": []}
    down = base | {"reference": [{"at": 0.2, "kind": "step", "by": [0, 0, -0.1]}]}
    changes: dict[str, dict[str, Any]] = {"without contact": base}
    for stiffness in (1e4, 1e6):
        surface = WALL | {"stiffness": stiffness, "dissipation": 1.0}
        changes[f"on {stiffness:g} N/m"] = down | {"environment": [surface]}
    changes["on 1e+04 N/m, rubbing"] = down | {
        "environment": [WALL | {"stiffness": 1e4, "dissipation": 1.0, "friction": 0.3}]
    }
    scenario = shipped_scenario("fig1_sampled")
    return {name: resolve(changed(scenario, entries)) for name, entries in changes.items()}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="fewer repeats and a shorter run")
    quick = parser.parse_args().quick
    repeats, seconds = (2, 0.5) if quick else (5, 4.0)
    console = Console(width=150)
    console.print(machine(), highlight=False)
    table = Table(
        "iiwa14 at 1 kHz", "native", "mujoco", "ratio", "mujoco, × real time", "q apart, rad",
        "peak force, native", "mujoco", "integration error, native", "mujoco",
    )  # fmt: skip
    for name, problem in problems(seconds).items():
        native, other = simulate_problem(problem), simulate_problem(problem, "mujoco")
        times = median_times(
            repeats, lambda p=problem: simulate_problem(p), lambda p=problem: simulate_problem(p, "mujoco")
        )
        runs = (native, other)
        peaks = [f"{np.abs(run['wrench'][:, :3]).max():.4g} N" for run in runs]
        errors = [f"{audit(run).integration_error:.1e} J" for run in runs]
        table.add_row(
            name,
            *(f"{time:.3f} s" for time in times),
            f"{times[1] / times[0]:.1f}",
            f"{seconds / times[1]:.1f}",
            f"{np.abs(native['q'] - other['q']).max():.1e}",
            *peaks,
            *errors,
        )
    console.print(table)


if __name__ == "__main__":
    main()
