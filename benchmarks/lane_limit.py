"""How near the sampled loop comes to what the core can do, and what holds back the rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from rich.table import Table

from arithmetic import Ops, longest_chain, operations
from lane_parts import Alone, Code, Part, code_of, parts_of, timing_text
from multiply_add import Rates, core_rates
from passiflex.loops.compiled import compiled_sampled_loop
from passiflex.native import compile_source
from passiflex.simulation import Problem
from passiflex.simulation.simulate_sampled import longest_step


class Period(NamedTuple):
    """What one control period is made of.

    Attributes
    ----------
    parts: The functions.
    calls: How often each is called per period.
    length: [s].
    """

    parts: list[Part]
    calls: dict[str, float]
    length: float

    @property
    def total(self) -> Ops:
        """Return the operations of a period."""
        whole = Ops(*[0.0] * len(Ops._fields))
        for part in self.parts:
            whole = whole.plus(operations(part.function).times(self.calls[part.name]))
        return whole


def period_of(problem: Problem) -> Period:
    """Return the period of a problem; what is true is asked for at recorded samples only."""
    s = problem
    assert s is not None
    steps = int(np.ceil(s.period / longest_step(problem, compiled_sampled_loop(s.loop).plant)))
    every = round(problem.output_interval / s.period)
    return Period(
        parts_of(problem), {"plant": 4.0 * steps, "control": 1.0, "row": 1.0, "truth": 1.0 / every}, s.period
    )


def limits(ops: Ops, rates: Rates) -> dict[str, float]:
    """Return the least time of these operations by each of the core's units [s], on one vector of lanes."""
    return {
        "multiply-adds": ops.issued / rates.multiply_adds,
        "and comparisons": (ops.issued + ops.logic) / rates.multiply_adds,
        "divisions": (ops.divisions + ops.roots) / rates.divisions,
    }


def limit_table(period: Period, reached: dict[int, float]) -> Table:
    """Return the limit by arithmetic; `reached` are the robot-seconds per second by number of lanes."""
    ops = period.total
    table = Table(
        "lanes", "10⁹ multiply-adds/s", "10⁹ flop/s", "of the peak",
        "limit by multiply-adds", "… with comparisons", "by divisions", "robot-s per s", "share of the limit",
    )  # fmt: skip
    for lanes, speed in reached.items():
        rates = core_rates(lanes)
        flops = (ops.adds + ops.multiplies + ops.divisions + ops.roots) * speed / period.length
        fast = {k: rates.lanes * period.length / t for k, t in limits(ops, rates).items()}
        least = min(fast.values())
        table.add_row(
            f"{lanes}", f"{rates.multiply_adds * lanes / 1e9:.1f}", f"{flops / 1e9:.1f}",
            f"{flops / (2 * rates.multiply_adds * lanes):.0%}", *(f"{v:.0f}" for v in fast.values()),
            f"{speed:.0f}", f"{speed / fast['multiply-adds']:.0%} … {speed / least:.0%}",
        )  # fmt: skip
    return table


def counted(period: Period) -> str:
    """Return in words what arithmetic a period is."""
    ops = period.total
    return (
        f"{ops.adds:.0f} + and −, {ops.multiplies:.0f} ×, of which {ops.joined:.0f} pairs can be joined: "
        f"{ops.issued:.0f} instructions; {ops.logic:.0f} comparisons and selections, {ops.divisions:.0f} ÷, "
        f"{ops.roots:.0f} √; "
        f"{ops.polynomials:.0f} sin, cos, exp, tanh are in these numbers, {ops.library:.0f} call of the library is not"
    )


def part_times(period: Period, repeats: int, calls: int) -> tuple[dict[str, float], dict[str, Code]]:
    """Return the best time of each part alone in lanes [s], by turns, and what its code is made of."""
    library = compile_source(timing_text(period.parts, None))
    alone = Alone(library, period.parts)
    best: dict[str, float] = {}
    for _ in range(repeats):
        for part in period.parts:
            took = alone.seconds(part.name, calls)
            best[part.name] = min(took, best.get(part.name, took))
    return best, code_of(library, period.parts)


def part_table(
    period: Period,
    rates: Rates,
    times: dict[str, float],
    code: dict[str, Code],
    native: float,
    whole: float,
) -> Table:
    """Return the profile, in cycles: each part alone beside the least that each unit of the core needs for it.

    `native` and `whole` are the times of a period of the compiled loop, and with all that Python does [s].
    """
    table = Table(
        "part", "calls", "cycles each", "share", "arithmetic", "÷ and √", "loads", "stores", "code", "KiB", "instr.",
        "instr./cycle", "nearest limit", "longest chain",
    )  # fmt: skip
    chains = {part.name: longest_chain(part.function) for part in period.parts}
    clock = rates.cycles
    for name, seconds in times.items():
        share, calls = seconds * period.calls[name] / whole, f"{period.calls[name]:g}"
        row = [name, calls, f"{seconds * clock:.0f}", f"{share:.0%}"]
        if name in code:
            c = code[name]
            least = {
                "arithmetic": (c.arithmetic + c.logic) / rates.multiply_adds,
                "÷ and √": c.divisions / rates.divisions,
                "loads": c.loads / rates.loads,
                "stores": c.stores / rates.stores,
                "code": c.size / rates.fetched(c.size),
            }
            nearest = max(least, key=lambda unit: least[unit])
            row += [f"{t * clock:.0f}" for t in least.values()]
            row += [f"{c.size / 1024:.0f}", f"{c.instructions}", f"{c.instructions / seconds / clock:.1f}"]
            row.append(f"{nearest} {least[nearest] / seconds:.0%}")
        table.add_row(*row, *[""] * (13 - len(row)), f"{chains[name]}")
    inside = sum(times[name] * period.calls[name] for name in times)
    for name, rest in {"around them in C": native - inside, "Python": whole - native}.items():
        table.add_row(name, "1", f"{rest * clock:.0f}", f"{rest / whole:.0%}")
    return table
