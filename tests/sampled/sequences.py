"""Requests to a tank: random, adversarial, and recorded from a mass on a sampled spring and damper."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from sampled.bench import Case

SIZES: dict[str, Callable[[np.random.Generator, tuple[int, int], float], np.ndarray]] = {
    "ordinary": lambda rng, shape, room: rng.normal(size=shape) * room,
    "alternating": lambda rng, shape, room: (-1.0) ** np.arange(shape[1]) * 10 ** rng.uniform(-6, 6, shape),
    "extreme": lambda rng, shape, room: (
        rng.choice([0.0, 5e-324, 1e-300, 1e-17, room / 2, room, 1.0, 1e12, 1e90], shape)
        * rng.choice([-1, 1], shape)
    ),
}
"""(generator, shape, T_max − T_low) → energies [J]."""


def tank_numbers(**numbers: float) -> SimpleNamespace:
    """Return the parameters of a signed tank with levels in the usual range, unless told."""
    usual = {"floor": 0.1, "low": 0.3, "cap": 2.0, "power": 50.0, "trip": 0.05}
    usual |= {"signed": 1.0, "fill": 1.0, "braking": 100.0}
    return SimpleNamespace(**{f"tank_{name}": value for name, value in (usual | numbers).items()})


def random_case(seed: int, kind: str, length: int) -> Case:
    """Return random numbers of a tank, and requests of one kind of `SIZES`."""
    rng = np.random.default_rng(seed)
    floor = rng.choice([0.0, 10 ** rng.uniform(-4, 0)])
    low = floor + 10 ** rng.uniform(-3, 0)
    cap = low + 10 ** rng.uniform(-2, 1)
    g = tank_numbers(
        floor=floor,
        low=low,
        cap=cap,
        power=10 ** rng.uniform(-1, 4),
        signed=float(rng.integers(2)),
        fill=rng.choice([0.0, rng.uniform(), 1.0]),
        braking=10 ** rng.uniform(-1, 4),
    )
    energies = SIZES[kind](rng, (6, length), cap - low)
    elapsed = rng.choice([0.0, 1e-9, 1e-3, 1.0], length)
    speeds = rng.choice([0.0, 1e-300, 1e-9, 1.0, 1e4], length) * rng.uniform(0.5, 1, length)
    level = rng.choice([floor, low, cap, 0.0, rng.uniform(-1, 1), rng.uniform(low, 2 * cap)])
    return Case(g, level, np.vstack([elapsed, energies[:5]]), energies[5], speeds)


class MassOnSpring(NamedTuple):
    """A mass m under f = −k (x − x_d) − d v, held over each period of Δt: exact, since f is constant in it.

    a = d Δt / m decides: the damper alone brakes while a < 2, and what it is said to dissipate, d v² Δt, is
    2a times the kinetic energy, where (2 − a) a times it is the truth.
    """

    m: float = 2.0
    k: float = 40.0
    d: float = 8.0
    dt: float = 1e-3

    def record(
        self, length: int, level: float, jumps: float, **numbers: float
    ) -> tuple[Case, SimpleNamespace]:
        """Return the requests of a tank at the port (f, v), and x, v and x_d; x_d jumps every 20 periods."""
        x, v, goal = 0.1, 0.0, 0.0
        rows, costs, speeds, path = [], [], [], [(x, v, goal)]
        for i in range(length):
            f = -self.k * (x - goal) - self.d * v
            dx = v * self.dt + f / self.m * self.dt**2 / 2
            w = f * dx
            dS = self.spring(x + dx, goal) - self.spring(x, goal)
            claimed = self.d * v**2 * self.dt
            x, v = x + dx, v + f / self.m * self.dt
            wanted = goal + jumps * (-1) ** (i // 20) if i % 20 == 10 else goal
            costs.append(self.spring(x, wanted) - self.spring(x, goal))
            goal = wanted
            rows.append([self.dt, w, dS, claimed, claimed, -dS])
            speeds.append(v**2)
            path.append((x, v, goal))
        case = Case(tank_numbers(**numbers), level, np.array(rows).T, np.array(costs), np.array(speeds))
        x, v, goal = np.array(path).T
        return case, SimpleNamespace(x=x, v=v, goal=goal)

    def spring(self, x: float | np.ndarray, goal: float | np.ndarray) -> float | np.ndarray:
        """Return S = ½ k (x − x_d)² [J]."""
        return self.k * (x - goal) ** 2 / 2

    def kinetic(self, v: float | np.ndarray) -> float | np.ndarray:
        """Return ½ m v² [J]."""
        return self.m * v**2 / 2


STABLE, UNSTABLE = MassOnSpring(), MassOnSpring(d=2.2 * 2.0 / 1e-3)
"""a = 0.004, and a = 2.2: the velocity changes its sign and grows by a fifth in every period."""


def adversarial_cases() -> list[Case]:
    """Return cases of every kind, signed and not, for a verdict without a search."""
    random = [random_case(seed, kind, 24) for kind in SIZES for seed in range(5)]
    recorded = [
        plant.record(40, level, 0.05, signed=signed)[0]
        for plant in (STABLE, UNSTABLE)
        for level in (1.0, 0.1)
        for signed in (0.0, 1.0)
    ]
    return random + recorded
