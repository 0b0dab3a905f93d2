"""A sampled tank on the bench: compiled once, run on a grid of levels and requests, or on them in a row."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import SimpleNamespace
from typing import NamedTuple

import casadi as cs
import numpy as np

from passiflex.sampled.tank import AbstractTank, PeriodFlows, TankEntry


class Contract(NamedTuple):
    """What a tank says of itself.

    Attributes
    ----------
    flow: What `settle` takes in of `PeriodFlows` [J], negative if out.
    reads: The fields that it reads.
    charges: Whether a change of the reference costs anything.
    gates: Whether its budget has a bound.
    """

    flow: Callable[[PeriodFlows, SimpleNamespace], np.ndarray]
    reads: frozenset[str]
    charges: bool = True
    gates: bool = True


class Case(NamedTuple):
    """A tank's numbers, its first level, and N requests.

    Attributes
    ----------
    g: `AbstractTank.layout`.
    level: T_0.
    flows: `PeriodFlows`, (6, N).
    costs: ΔU that is asked for, (N,).
    speeds: |φ̇|², (N,).
    """

    g: SimpleNamespace
    level: float
    flows: np.ndarray
    costs: np.ndarray
    speeds: np.ndarray

    @property
    def numbers(self) -> np.ndarray:
        return AbstractTank.layout.pack(vars(self.g))

    def levels(self) -> np.ndarray:
        """Return the levels at which something could go wrong, and the first one."""
        floor, low, cap = self.g.tank_floor, self.g.tank_low, self.g.tank_cap
        around = [np.nextafter(x, way) for x in (floor, low, cap) for way in (-np.inf, np.inf)]
        nothing = [0.0, 5e-324, -5e-324, 1e-300, -1e-300]
        return np.array([self.level, floor, low, cap, *around, *nothing, -50, (low + cap) / 2, cap + 1, 1e6])


@lru_cache
def _compiled(tank: AbstractTank) -> dict[str, cs.Function]:
    vector, g = AbstractTank.layout.symbols("g")
    T, cost, elapsed, speed = (cs.SX.sym(name) for name in ("T", "cost", "elapsed", "speed"))
    flows = cs.SX.sym("flows", len(PeriodFlows._fields))
    settled = tank.settle(T, PeriodFlows(*cs.vertsplit(flows)), g)
    afforded = tank.budget(settled.level, flows[0], g)
    price = cs.if_else(g.tank_signed > 0, cost, cs.fabs(cost))
    paid = tank.pay(settled.level, cs.if_else(price > afforded, cs.sign(cost) * afforded, cost), g)
    bodies = {
        "settle": ([T, flows], cs.vertcat(*settled)),
        "pay": ([T, cost], cs.vertcat(*tank.pay(T, cost, g))),
        "budget": ([T, elapsed], tank.budget(T, elapsed, g)),
        "braking": ([T, speed, elapsed], tank.braking(T, speed, elapsed, g)),
        "stiffness_share": ([T], tank.stiffness_share(T, g)),
        "valve": ([T], tank.valve(T, g)),
        "period": ([T, flows, cost], [paid.level, *settled, *paid, tank.valve(paid.level, g)]),
    }
    return {
        name: cs.Function(name, [*x, vector], y if name == "period" else [y])
        for name, (x, y) in bodies.items()
    }


@lru_cache
def _sequence(tank: AbstractTank, length: int) -> cs.Function:
    return _compiled(tank)["period"].mapaccum(length)


@dataclass(frozen=True, eq=False)
class Bench:
    """A tank under one case. `settle` and the others take rows of N requests."""

    tank: AbstractTank
    contract: Contract
    case: Case

    def settle(self, levels: np.ndarray, flows: np.ndarray) -> TankEntry:
        return TankEntry(*self._rows("settle", levels, flows))

    def pay(self, levels: np.ndarray, costs: np.ndarray) -> TankEntry:
        return TankEntry(*self._rows("pay", levels, costs))

    def budget(self, levels: np.ndarray, elapsed: np.ndarray) -> np.ndarray:
        return self._rows("budget", levels, elapsed)[0]

    def braking(self, levels: np.ndarray, speeds: np.ndarray, elapsed: np.ndarray) -> np.ndarray:
        return self._rows("braking", levels, speeds, elapsed)[0]

    def stiffness_share(self, levels: np.ndarray) -> np.ndarray:
        return self._rows("stiffness_share", levels)[0]

    def valve(self, levels: np.ndarray) -> np.ndarray:
        return self._rows("valve", levels)[0]

    def _rows(self, name: str, *rows: np.ndarray) -> np.ndarray:
        return np.array(_compiled(self.tank)[name](*(np.atleast_2d(x) for x in rows), self.case.numbers))

    @cached_property
    def grid(self) -> SimpleNamespace:
        """Return every request at every level, with the entries for it."""
        levels, n = self.case.levels(), self.case.costs.size
        T, flows = np.repeat(levels, n), np.tile(self.case.flows, levels.size)
        costs, speeds = np.tile(self.case.costs, levels.size), np.tile(self.case.speeds, levels.size)
        flow = self.contract.flow(PeriodFlows(*flows), self.case.g)
        entries = {"settled": self.settle(T, flows), "paid": self.pay(T, costs)}
        return SimpleNamespace(
            level=T, flows=flows, flow=flow, costs=costs, speeds=speeds, dt=flows[0], **entries
        )

    @cached_property
    def sequence(self) -> SimpleNamespace:
        """Return the requests one after the other, costs cut to the budget."""
        n = self.case.costs.size
        numbers = np.tile(self.case.numbers[:, None], n)
        out = _sequence(self.tank, n)(self.case.level, self.case.flows, self.case.costs[None], numbers)
        after, *columns, valve = (np.array(row).ravel() for row in out)
        before = np.append(self.case.level, after[:-1])
        return SimpleNamespace(
            before=before, settled=TankEntry(*columns[:6]), paid=TankEntry(*columns[6:]), valve=valve
        )
