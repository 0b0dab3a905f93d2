"""What every sampled energy tank must do: named properties, for any `AbstractTank` under any sequence of requests.

A property fails where one of its comparisons is true. None is with NaN, so that
`outputs_are_finite` and `bad_numbers_change_nothing` alone answer for numbers that are none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from passiflex.sampled.tank import LARGEST, AbstractTank, PeriodFlows, TankEntry
from sampled.bench import Bench, Case, Contract

ROUND = 8 * np.finfo(float).eps
"""Round-off of a sum of five terms, relative to their magnitudes."""
BAD = (np.nan, np.inf, -np.inf, 10 * LARGEST, -10 * LARGEST)


def _never(where: np.ndarray, what: str) -> None:
    assert not np.any(where), f"{what}: at {np.flatnonzero(where)[:6]} of {np.size(where)}"


def _differ(a: np.ndarray, b: np.ndarray | float) -> np.ndarray:
    return np.abs(a - b) > 0


def _balance(entry: TankEntry) -> np.ndarray:
    return -entry.granted - entry.drawn + entry.refilled - entry.spilled


def _scale(before: np.ndarray, entry: TankEntry) -> np.ndarray:
    return np.abs(before) + sum(np.abs(column) for column in entry[1:5])


def books_close(b: Bench) -> None:
    """T' = T − granted − drawn + refilled − spilled, each ≥ 0: per entry, and summed over a sequence."""
    s = b.sequence
    for level, entry in (
        (b.grid.level, b.grid.settled),
        (b.grid.level, b.grid.paid),
        (s.before, s.settled),
        (s.settled.level, s.paid),
    ):
        _never(
            np.abs(entry.level - level - _balance(entry)) > ROUND * _scale(level, entry),
            "the books do not close",
        )
        _never(np.min(entry[1:5], axis=0) < 0, "a column is negative")
    total = sum(_scale(level, e).sum() for level, e in ((s.before, s.settled), (s.settled.level, s.paid)))
    error = s.paid.level[-1] - s.before[0] - _balance(s.settled).sum() - _balance(s.paid).sum()
    _never(np.abs(error) > ROUND * total, "the sums do not close")


def a_joule_counts_once(b: Bench) -> None:
    """Between floor and cap, `settle` takes in or out what happened: once, one way, and grants nothing."""
    level, e, flow = b.grid.level, b.grid.settled, b.grid.flow
    free = (level >= b.case.g.tank_floor) & (level + 2 * flow <= b.case.g.tank_cap)
    read = np.isin(PeriodFlows._fields, list(b.contract.reads))
    terms = np.abs(b.grid.flows[read]).sum(axis=0)
    _never(free & (np.abs(e.refilled - e.drawn - flow) > ROUND * terms), "not the flow")
    _never(free & (np.minimum(e.refilled, e.drawn) > 0), "in and out at once")
    _never(_differ(e.granted, 0), "settling grants")


def the_floor_lifts_nothing(b: Bench) -> None:
    """At and below the floor and 0, as much comes in as higher up; without inflow no level ever rises."""
    level, g = b.grid.level, b.case.g
    higher = b.settle(np.full_like(level, g.tank_low), b.grid.flows)
    clear = (level <= g.tank_floor) & (2 * b.grid.flow <= g.tank_cap - g.tank_low)
    for column in ("drawn", "refilled"):
        here, there = getattr(b.grid.settled, column), getattr(higher, column)
        _never(clear & (np.abs(here - there) > ROUND * there), f"{column} depends on the level")
    _never((b.grid.flow <= 0) & (b.grid.settled.level > level), "a level rises for nothing")
    back = np.maximum(-b.grid.costs, 0) if g.tank_signed else 0
    _never(b.grid.paid.level - level > back + ROUND * (back + np.abs(level)), "a payment lifts the level")


def the_cap_spills(b: Bench) -> None:
    """What comes in and does not fit is reported as such; above the cap a level may stay, but nothing comes to it."""
    level, g = b.grid.level, b.case.g
    for e in (b.grid.settled, b.grid.paid):
        left = level - e.granted - e.drawn
        most = np.maximum(left, g.tank_cap)
        over = np.maximum(left + e.refilled - most, 0)
        _never(e.level > np.maximum(level, g.tank_cap), "a level rises above the cap")
        _never((e.spilled > 0) & _differ(e.level, most), "a full tank is not full")
        _never(np.abs(e.spilled - over) > ROUND * _scale(level, e), "not what the cap refuses is spilled")
    room = g.tank_cap - g.tank_low
    small = 2 * b.grid.flow <= room
    flows, step = b.grid.flows[:, small], np.minimum(np.abs(b.grid.flow[small]), room)
    free = b.settle(np.full_like(step, g.tank_low), flows)
    for below in (0 * step, step / 2, -step):
        full = b.settle(g.tank_cap - below, flows)
        _never(np.abs(full.refilled - free.refilled) > ROUND * free.refilled, "the cap hides what came in")


def spending_stays_within_the_budget(b: Bench) -> None:
    """0 ≤ budget ≤ P_max Δt; paying what fits never takes the level below the floor, unless it was below."""
    level, g, budget = b.grid.level, b.case.g, b.budget(b.grid.level, b.grid.dt)
    _never(budget < 0, "a budget is negative")
    if b.contract.gates:
        _never(budget > g.tank_power * b.grid.dt, "more power than P_max")
    for share in (-1.0, 0.5, 1.0):
        after = b.pay(level, share * budget).level
        _never(after < np.minimum(level, g.tank_floor) - ROUND * np.abs(level), "the floor is passed")
    before, after = b.sequence.settled.level, b.sequence.paid.level
    _never(after < np.minimum(before, g.tank_floor) - ROUND * np.abs(before), "the floor is passed in a row")


def a_jump_costs_what_it_stores(b: Bench) -> None:
    """ΔU if signed, |ΔU| if not, of the reference or the stiffness; nothing in a tank that does not charge."""
    e, costs = b.grid.paid, b.grid.costs
    price = costs if b.case.g.tank_signed else np.abs(costs)
    if not b.contract.charges:
        price = np.zeros_like(costs)
        _never(_differ(e.level, b.grid.level), "a free change moves the level")
    _never(_differ(e.granted, np.maximum(price, 0)), "not the price is paid")
    _never(_differ(e.refilled, np.maximum(-price, 0)), "not what is given back comes in")
    _never(_differ(e.drawn, 0), "a payment draws")


def the_valve_follows_the_level(b: Bench) -> None:
    """β is 0 up to the floor, 1 from T_low, monotone and continuous, of the level at the end of this period."""
    floor, low, s = b.case.g.tank_floor, b.case.g.tank_low, b.sequence
    levels = np.sort(np.append(b.case.levels(), np.linspace(floor, low, 200)))
    for level, beta in ((levels, b.valve(levels)), (s.paid.level, s.valve)):
        _never((level <= floor) & _differ(beta, 0), "open at the floor")
        _never((level >= low) & _differ(beta, 1), "not open at T_low")
    beta = b.valve(levels)
    _never(np.diff(beta) < -ROUND, "closes as the level rises")
    _never(np.diff(beta) > 4 * np.diff(levels) / (low - floor) + ROUND, "jumps")
    share = b.stiffness_share(levels)
    _never((share < 0) | (share > 1), "a share outside 0..1")


def braking_pays_no_more_than_the_debt(b: Bench) -> None:
    """0 ≤ braking ≤ α_max, 0 without a debt, and in one period α |φ̇|² Δt ≤ −T."""
    level, brake = b.grid.level, b.braking(b.grid.level, b.grid.speeds, b.grid.dt)
    _never((brake < 0) | (brake > b.case.g.tank_braking * (1 + ROUND)), "outside 0..α_max")
    _never((level >= 0) & _differ(brake, 0), "brakes without a debt")
    paid = brake * (b.grid.speeds * b.grid.dt)
    _never(paid > np.maximum(-level, 0) * (1 + ROUND), "brakes more than the debt")


def outputs_are_finite(b: Bench) -> None:
    """For finite requests at any level, 0, ±1e-300 and negative ones included: nothing is divided by the level."""
    grid = b.grid
    outputs = [
        *grid.settled,
        *grid.paid,
        b.budget(grid.level, grid.dt),
        b.braking(grid.level, grid.speeds, grid.dt),
    ]
    for out in (
        *outputs,
        b.stiffness_share(grid.level),
        b.valve(grid.level),
        *b.sequence.settled,
        *b.sequence.paid,
    ):
        _never(~np.isfinite(out), "not a number")


def bad_numbers_change_nothing(b: Bench) -> None:
    """NaN, ±∞ and absurd numbers leave the level as it is, and are reported; fields that are not read do not matter."""
    _never(np.append(b.grid.settled.fault, b.grid.paid.fault) != 0, "a fault without a bad number")
    level = b.case.levels()
    level = level[(level >= b.case.g.tank_floor) & (level > 0)]
    good = np.repeat(b.case.flows[:, :1], level.size, axis=1)
    usual = b.settle(level, good)
    for bad in BAD:
        wrong = np.full_like(level, bad)
        for i, name in enumerate(PeriodFlows._fields):
            entry = b.settle(level, np.insert(np.delete(good, i, 0), i, bad, axis=0))
            same = _refused(level) if name in b.contract.reads else usual
            _never(~np.equal(entry, same), f"{name} = {bad}")
        _never(~np.equal(b.pay(level, wrong), _refused(level)), f"cost = {bad}")
        for entry in (b.settle(wrong, good), b.pay(wrong, good[2])):
            _never(np.isfinite(entry.level) & (entry.level != bad), f"level = {bad} becomes a number")
            _never(~np.equal(entry[1:], _refused(level)[1:]), f"level = {bad}")
        if b.contract.gates:
            _never(np.append(b.budget(wrong, good[0]), b.budget(level, wrong)) != 0, f"grants at {bad}")
        below, dt = np.full_like(level, -1.0), np.full_like(level, 1e-3)
        for args in ((wrong, dt, dt), (below, wrong, dt), (below, dt, wrong)):
            brake = b.braking(*args)
            _never(~((brake >= 0) & (brake <= b.case.g.tank_braking * (1 + ROUND))), f"braking at {bad}")
        _never(~np.isin(b.valve(wrong), (0, 1)), f"valve at {bad}")


def _refused(level: np.ndarray) -> TankEntry:
    nothing = np.zeros_like(level)
    return TankEntry(level, *[nothing] * 4, nothing + 1)


PROPERTIES: tuple[Callable[[Bench], None], ...] = (
    books_close,
    a_joule_counts_once,
    the_floor_lifts_nothing,
    the_cap_spills,
    spending_stays_within_the_budget,
    a_jump_costs_what_it_stores,
    the_valve_follows_the_level,
    braking_pays_no_more_than_the_debt,
    outputs_are_finite,
    bad_numbers_change_nothing,
)


def violated(tank: AbstractTank, contract: Contract, cases: Iterable[Case]) -> set[str]:
    """Return the names of the properties that fail in at least one of the cases."""
    names = set()
    for case in cases:
        bench = Bench(tank, contract, case)
        for holds in PROPERTIES:
            try:
                holds(bench)
            except AssertionError:
                names.add(holds.__name__)
    return names
