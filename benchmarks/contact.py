"""What does touch cost: 30 s against a wall at 1 kHz with the whole ledger, alone, in lanes, and in MuJoCo?

Run `PYTHONPATH=src:benchmarks python benchmarks/contact.py [--quick]`. All by turns in one run on one machine: read the
ratios. No test asserts a time. The law in MuJoCo's way is called from Python once per period, as a robot would.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

from rich.console import Console
from rich.table import Table

from passiflex.loops.compiled import compiled_sampled_loop
from passiflex.problems.problem import require_sampled
from passiflex.simulation import resolve, simulate_problem
from passiflex.simulation.batch import lane_loop, simulate_batch
from passiflex.simulation.simulate_sampled import longest_step
from passiflex.studies import shipped_scenario
from passiflex.texts.changes import changed
from speed import machine, median_times

WALL: dict[str, Any] = {
    "kind": "plane", "point": [0, 0, -0.03], "normal": [0, 0, 1], "relative": True, "stiffness": 1e5,
    "dissipation": 0.5,
}  # fmt: skip
"""Three centimetres below the hand; the reference goes ten."""
WAYS: dict[str, list[dict[str, Any]]] = {
    "without": [],
    "1e5 N/m": [WALL],
    "1e5 N/m, rubbing": [WALL | {"friction": 0.3}],
    "1e6 N/m": [WALL | {"stiffness": 1e6}],
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="fewer repeats and a shorter run")
    quick = parser.parse_args().quick
    repeats, seconds = (1, 1.0) if quick else (3, 30.0)
    short = seconds / 10
    console = Console(width=150)
    console.print(machine(), highlight=False)
    table = Table(
        "iiwa14 at 1 kHz", "steps per period", f"alone, {seconds:g} s", "× without", "a lane, same time",
        "rate of lanes, of that without", "mujoco, same time", "mujoco / alone",
    )  # fmt: skip
    first: tuple[float, float] | None = None
    for name, environment in WAYS.items():
        moves = {"reference": [{"at": 0.2, "kind": "step", "by": [0, 0, -0.1]}], "forces": []}
        entries = moves | {"environment": environment, "duration": seconds}
        whole = require_sampled(resolve(changed(shipped_scenario("fig1_sampled"), entries)))
        part = require_sampled(
            resolve(changed(shipped_scenario("fig1_sampled"), entries | {"duration": short}))
        )
        width = lane_loop(whole).width
        alone, lanes, other = median_times(
            repeats,
            lambda p=whole: simulate_problem(p),
            lambda p=part, n=width: simulate_batch([p] * n, ["q"], threads=1),
            lambda p=part: simulate_problem(p, "mujoco"),
        )
        lane, theirs = lanes / width * seconds / short, other * seconds / short
        first = first or (alone, lane)
        steps = math.ceil(whole.period / longest_step(whole, compiled_sampled_loop(whole.loop).plant))
        table.add_row(
            name, f"{steps}", f"{alone:.2f} s", f"{alone / first[0]:.2f}", f"{lane:.3f} s",
            f"{first[1] / lane:.2f}", f"{theirs:.1f} s", f"{theirs / alone:.0f}",
        )  # fmt: skip
    console.print(table)


if __name__ == "__main__":
    main()
