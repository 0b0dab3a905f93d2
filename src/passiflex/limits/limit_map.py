"""The limit map: which K_e, B_e, K_x and D_x a robot bears at a rate and a delay, confirmed by simulation."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.limits.confirmation import Confirmation, confirm
from passiflex.limits.one_thread import on_one_thread
from passiflex.limits.own_margin import OwnMargin, own_margin
from passiflex.limits.planes import (
    Plane,
    StableRange,
    impedance_plane,
    least_inertias,
    least_inertias_by_rate,
    radii_by_rate,
    shaping_plane,
    stable_damping,
)
from passiflex.limits.points import points_to_confirm
from passiflex.limits.subject import Subject, sampled_problem
from passiflex.problems.altered import altered
from passiflex.simulation import Problem
from passiflex.stability.admissible import Admissible, check
from passiflex.stability.linear_loop import LinearLoop

Array = NDArray[np.float64]
Report = Callable[[str], None]

STIFFNESS_RATIOS = np.geomspace(0.25, 16, 13)
INERTIA_RATIOS = np.geomspace(0.004, 2, 25)
"""K_e/K and B_e/B of the shaping plane; K_e = K is one of them."""
STIFFNESS_SCALES = np.geomspace(0.1, 1000, 13)
DAMPING_SCALES = np.geomspace(0.01, 100, 25)
"""Multiples of K_x and D_x of the impedance plane; 1 is one of them."""
RATES = np.geomspace(250, 32_000, 15)
"""[Hz]"""


class Grids(NamedTuple):
    """Where a map is looked at: K_e/K, B_e/B, multiples of K_x and of D_x, and rates [Hz]."""

    stiffness_ratios: Array
    inertia_ratios: Array
    stiffness_scales: Array
    damping_scales: Array
    rates: Array


PICTURED = Grids(STIFFNESS_RATIOS, INERTIA_RATIOS, STIFFNESS_SCALES, DAMPING_SCALES, RATES)
TOLD = Grids(
    np.array([0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0]),
    np.zeros(0),
    np.array([1.0, 10.0]),
    DAMPING_SCALES,
    RATES[:0],
)
"""For a picture, and for the tables alone."""
PERIODS = (0.0, 1.0, 2.0)
"""Delays that are compared, beside the problem's own."""


@dataclass(frozen=True, eq=False)
class LimitMap:
    """What is stable around a problem's gains.

    Attributes
    ----------
    name, robot: Of the problem.
    admissible: The answer for its own gains, with the sentence.
    shaping: Radii over (K_e/K, B_e/B); None for the rigid law, which shapes nothing.
    impedance: Radii over multiples of (K_x, D_x).
    delays: Delays in periods (d,), the problem's own among them.
    least_inertia: Smallest stable B_e/B (d, a) at each delay and K_e/K; inf if there is none; None for the
        rigid law.
    damping: Stable multiples of D_x at each multiple of K_x.
    rates: [Hz] (r,).
    least_inertia_by_rate: Smallest stable B_e/B with K_e = K (d, r); None for the rigid law.
    radius_by_rate: Radius of the problem's own gains (d, r).
    own_shaping: K_e/K and B_e/B of each joint, (2, n); None for the rigid law.
    confirmations: Points on both sides of the borders, and the problem's own, by theory and by simulation.
    margin: How far the robot may be off before its own gains no longer hold.
    """

    name: str
    robot: str
    admissible: Admissible
    shaping: Plane | None
    impedance: Plane
    delays: Array
    least_inertia: Array | None
    damping: StableRange
    rates: Array
    least_inertia_by_rate: Array | None
    radius_by_rate: Array
    own_shaping: Array | None
    confirmations: tuple[Confirmation, ...]
    margin: OwnMargin

    @property
    def sentence(self) -> str:
        """Return the answer in words."""
        return self.admissible.sentence

    @property
    def own_delay(self) -> int:
        """Return the place of the problem's own delay in `delays`."""
        periods = self.admissible.delay * self.admissible.rate
        return int(np.argmin(np.abs(self.delays - periods)))


@on_one_thread
def limit_map(
    subject: Subject,
    rate: float | str | None = None,
    delay: float | str | None = None,
    *,
    task: str | None = None,
    inner_loop: str | None = None,
    confirmed: bool = True,
    pictured: bool = True,
    report: Report = lambda text: None,
) -> LimitMap:
    """Return the limit map of a scenario, its file or a problem, at its own rate and delay unless given.

    The law always knows the delay: a matched inner loop predicts over as many whole periods.

    Parameters
    ----------
    rate, delay: [Hz], [s]; text may name a unit.
    task, inner_loop: pose or position, plain or matched; its own unless given.
    confirmed: Whether to simulate points on both sides of the borders.
    pictured: Whether the map is to be drawn; without, only its own delay and what the tables say of it are looked at.
    report: Is told what is being done.

    Raises
    ------
    PassiflexError
        If there is no rate, rate or delay make no sense, or the scenario does not fit its robot.
    """
    problem = sampled_problem(subject, rate, delay, task=task, inner_loop=inner_loop)
    name, period = problem.name, problem.period
    report(f"{name}: compiling")
    own = LinearLoop(problem)
    shaped = problem.law.shapes
    report(f"{name}: radii over the gains")
    grids = PICTURED if pictured else TOLD
    rates = grids.rates if shaped or pictured else RATES  # of the rigid law they are what there is to tell
    planes = shaping_plane(own, grids.stiffness_ratios, grids.inertia_ratios) if shaped else None
    impedance = impedance_plane(own, grids.stiffness_scales, grids.damping_scales)
    compared = PERIODS if pictured else ()  # a matched loop is built anew for each delay
    delays = np.unique(np.round([*compared, problem.delay / period], 9))
    report(f"{name}: borders at other delays and rates")
    loops = [LinearLoop(altered(problem, delay=d * period)) for d in delays] if pictured else [own]
    found = LimitMap(
        name=name,
        robot=problem.law.robot.name,
        admissible=check(problem),
        shaping=planes,
        impedance=impedance,
        delays=delays,
        least_inertia=np.array([least_inertias(loop, grids.stiffness_ratios) for loop in loops])
        if shaped
        else None,
        damping=stable_damping(own, impedance),
        rates=rates,
        least_inertia_by_rate=(
            np.array([least_inertias_by_rate(loop, rates) for loop in loops]) if shaped else None
        ),
        radius_by_rate=np.array([radii_by_rate(loop, rates) for loop in loops]),
        own_shaping=_own_shaping(problem) if shaped else None,
        confirmations=(),
        margin=own_margin(problem),
    )
    if not confirmed:
        return found
    report(f"{name}: points on both sides in the nonlinear simulation")
    points = (confirm(problem, p.plane, p.point, p.gains, p.rate) for p in points_to_confirm(found, own))
    return dataclasses.replace(found, confirmations=tuple(points))


def _own_shaping(problem: Problem) -> Array:
    gains, model = problem.law.layout.unpack(problem.gains), problem.law.robot.layout.unpack(problem.model)
    return np.array(
        [
            gains["shaped_stiffness"] / model["joint_stiffness"],
            gains["shaped_inertia"] / model["motor_inertia"],
        ]
    )
