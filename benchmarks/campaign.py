"""How fast are thousands of robots, beside what one would otherwise take, and how far from the limit of the machine?

Run `PYTHONPATH=src:benchmarks python benchmarks/campaign.py [--quick] [--compilers]`. All numbers come from one run on
one machine, by turns: read the ratios. Where others use the machine too, the time that the core worked (CPU) says
more than the clock on the wall. No test asserts a time.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from core_time import best_times, walls_and_cores
from lane_compilers import tried
from lane_limit import Period, counted, limit_table, part_table, part_times, period_of
from lane_parts import native_seconds
from multiply_add import core_rates
from other_ways import alternatives
from passiflex.campaigns import draws, parse_campaign, sample_scenario
from passiflex.campaigns.evaluate import evaluate_samples
from passiflex.chunks.engines import LocalProcesses
from passiflex.metrics.measures import SIGNALS, measures
from passiflex.metrics.steps import step_window
from passiflex.simulation import Problem, resolve, simulate_problem
from passiflex.simulation.batch import lane_loop, simulate_batch
from passiflex.studies.paper import shipped_scenario
from speed import machine
from stored_campaign import TWO_CORES, campaign_text, stored

ONE_CORE = 400.0
"""Asked of one core: robot-seconds per second."""


def speeds(console: Console, problem: Problem, repeats: int) -> dict[int, float]:
    """Print robot-seconds per second of the complete loop; return the best on one core, by lanes."""
    sparse, width = dataclasses.replace(problem, output_interval=0.005), lane_loop(problem).width
    seconds, text, two = problem.duration, campaign_text(64), 2 * lane_loop(problem).width
    with LocalProcesses(2) as engine:

        def processes() -> None:
            futures = [engine.submit(evaluate_samples, text, range(k * two, (k + 1) * two)) for k in range(2)]
            for future in futures:
                future.result()

        works: list[tuple[str, float, float | None, bool, Callable[[], object]]] = [
            (
                f"{width} lanes, one core, every fifth sample recorded", width, ONE_CORE, True,
                lambda: simulate_batch([sparse] * width, SIGNALS),
            ),
            (
                "  every sample recorded", width, None, True,
                lambda: simulate_batch([problem] * width, SIGNALS),
            ),
            (
                "  two threads, every fifth", two, TWO_CORES, False,
                lambda: simulate_batch([sparse] * two, SIGNALS, threads=2),
            ),
            (
                "draws to rows of a campaign, one core", two, ONE_CORE, True,
                lambda: evaluate_samples(text, range(two)),
            ),
            ("  two processes", 2 * two, TWO_CORES, False, processes),
            ("one robot alone, every fifth", 1, None, True, lambda: simulate_problem(sparse)),
        ]  # fmt: skip
        times = walls_and_cores(repeats, *(work for *_, work in works))
    table = Table(
        "robot-seconds per second", "median", "best", "best per core-second", "asked", "best meets it"
    )
    for (what, robots, asked, one_core, _), taken in zip(works, np.moveaxis(times, 1, 0), strict=True):
        wall = robots * seconds / taken[:, 0]
        core = f"{robots * seconds / taken[:, 1].min():.0f}" if one_core or "threads" in what else ""
        met = "" if asked is None else "yes" if wall.max() >= asked else "NO"
        table.add_row(
            what, f"{np.median(wall):.0f}", f"{wall.max():.0f}", core, f"≥ {asked:g}" if asked else "", met
        )
    console.print(table)
    best = times.min(axis=(0, 2))
    return {width: width * seconds / best[0], 1: seconds / best[-1]}


def shares(console: Console, repeats: int) -> None:
    """Print where the time of a campaign's samples goes, on one core."""
    samples = range(16)
    campaign = parse_campaign(campaign_text(64))
    drawn = [sample_scenario(campaign, i) for i in samples]
    problems = [resolve(scenario) for scenario in drawn]
    runs = simulate_batch(problems, SIGNALS)

    def measured() -> None:
        for scenario, problem, run in zip(drawn, problems, runs, strict=True):
            measures(problem, step_window(scenario), run)

    works: dict[str, Callable[[], object]] = {
        "draw": lambda: (draws(campaign, samples), [sample_scenario(campaign, i) for i in samples]),
        "resolve": lambda: [resolve(scenario) for scenario in drawn],
        "run in lanes": lambda: simulate_batch(problems, SIGNALS),
        "measure": measured,
    }
    taken = np.array(best_times(repeats, *works.values()))
    parts = ", ".join(
        f"{name} {t / len(samples) * 1e3:.1f} ms ({t / taken.sum():.0%})"
        for name, t in zip(works, taken, strict=True)
    )
    console.print(f"- per sample of a campaign, best of {repeats}: {parts}", highlight=False)


def limit(console: Console, sparse: Problem, reached: dict[int, float], repeats: int) -> None:
    """Print what the core could do, what is reached, and what each part of the loop waits for."""
    period = period_of(sparse)
    console.print(limit_table(period, reached))
    console.print(f"- arithmetic of a period: {counted(period)}", highlight=False)
    rates, (width, speed) = core_rates(), next(iter(reached.items()))
    times, code = part_times(period, repeats, 1000)
    whole = width * period.length / speed
    native = min(native_seconds(sparse, 2000) for _ in range(repeats))
    console.print(part_table(period, rates, times, code, native, whole))
    units = ("multiply_adds", "divisions", "loads", "stores")
    each = ", ".join(f"{getattr(rates, unit) / rates.cycles:.2g} {unit.replace('_', '-')}" for unit in units)
    fetched = ", ".join(f"{v / rates.cycles:.0f} of {size >> 10} KiB" for size, v in rates.code.items())
    console.print(
        f"- one core, {rates.lanes} lanes, measured: {rates.cycles / 1e9:.2f} GHz; per cycle {each}; bytes of straight "
        f"code per cycle: {fetched or 'not measured'}\n"
        "- arithmetic … code: least cycles by that unit alone, from the machine code; longest chain: least cycles in "
        "which results that wait for each other are there",
        highlight=False,
    )


def compilers(console: Console, period: Period, repeats: int) -> None:
    """Print what other ways to compile make of plant and control."""
    parts = [part for part in period.parts if part.name in ("plant", "control")]
    with tempfile.TemporaryDirectory() as folder:
        ways = tried(parts, Path(folder), 500, repeats)
    table = Table("compiled", "in", "plant, per lane", "control, per lane", "both, a period", "faster")
    both = [sum(period.calls[name] * t for name, t in way.per_lane.items()) for way in ways]
    for way, total in zip(ways, both, strict=True):
        plant, control = way.per_lane["plant"] * 1e9, way.per_lane["control"] * 1e9
        table.add_row(
            way.name, f"{way.compiled_in:.0f} s", f"{plant:.0f} ns", f"{control:.0f} ns", f"{total * 1e6:.2f} µs",
            f"{both[0] / total - 1:+.0%}",
        )  # fmt: skip
    console.print(table)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="fewer repeats and shorter pieces")
    parser.add_argument(
        "--compilers", action="store_true", help="try other compilers and flags, too (minutes)"
    )
    options = parser.parse_args()
    repeats, seconds, samples = (3, 0.2, 192) if options.quick else (9, 1.0, 1000)
    console = Console(width=160)
    console.print(machine(), highlight=False)
    problem = resolve(shipped_scenario("fig1_sampled"))
    sparse = dataclasses.replace(problem, output_interval=0.005)
    reached = speeds(console, problem, repeats)
    shares(console, repeats)
    alternatives(console, next(iter(reached.values())), seconds, repeats)
    stored(console, samples)
    limit(console, sparse, reached, 3 * repeats)
    if options.compilers:
        compilers(console, period_of(sparse), repeats)
    console.print(f"load at the end: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores", highlight=False)


if __name__ == "__main__":
    main()
