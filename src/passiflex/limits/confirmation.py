"""A point of the limit map in the nonlinear simulation: pushed for a moment, does the motion die out or grow?"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.control.tank import NO_CAP
from passiflex.errors import ValueRangeError
from passiflex.simulation import Problem, simulate_problem
from passiflex.simulation.altered import altered, replaced
from passiflex.simulation.linear_loop import IDEAL, LinearLoop
from passiflex.simulation.loop_at_rest import BRIMFUL
from passiflex.simulation.motion import hold
from passiflex.simulation.problem import Event
from passiflex.simulation.sampled_loop import SampledLoop

Array = NDArray[np.float64]

PUSH = np.array([1.0, 0.7, -0.5, 0.1, -0.07, 0.05])
"""Wrench of the disturbance [N, N m]; no component is 0, so that no symmetry of the posture hides a mode."""
PUSHED = 10
"""Periods that it lasts."""
PERIODS = 2000
"""Periods of a simulation: a mode that grows `VISIBLE`-fold per period grows 1.2-fold from third to third."""
VISIBLE = 1.0003
SEEN = 10.0
"""Growth since the push that settles the matter; the motion is then still small enough for linear theory."""


class Confirmation(NamedTuple):
    """A point of the map, by the linear theory and by the nonlinear simulation.

    Attributes
    ----------
    plane: shaping (K_e/K, B_e/B), impedance (multiples of K_x, D_x), or rate (Hz, B_e/B with K_e = K; for the
        rigid law the radius).
    horizontal, vertical: The point.
    radius: Of the linear loop per period; theory calls it stable below 1.
    growth: Of the simulated motion, as `growth` has it; it died out if below 1.
    """

    plane: str
    horizontal: float
    vertical: float
    radius: float
    growth: float

    @property
    def stable(self) -> bool:
        """Return what the linear theory says."""
        return self.radius < 1

    @property
    def settles(self) -> bool:
        """Return what the simulation says."""
        return self.growth < 1

    @property
    def agrees(self) -> bool:
        """Return whether the two say the same."""
        return self.stable == self.settles


def confirm(
    problem: Problem,
    plane: str,
    point: tuple[float, float],
    gains: Mapping[str, Array] | None = None,
    rate: float | None = None,
) -> Confirmation:
    """Return both verdicts on the problem with these gains, at a rate with as many periods of delay."""
    assert problem.sampling is not None
    late = None if rate is None else problem.sampling.delay / problem.sampling.period / rate
    changed = altered(problem, rate=rate, delay=late, gains=gains)
    return Confirmation(plane, *point, LinearLoop(changed).radius(), growth(disturbed(changed)))


def disturbed(problem: Problem, periods: int = PERIODS) -> Problem:
    """Return the problem at rest and pushed for `PUSHED` periods, with nothing that could hide a growing motion.

    No limits, resolution, friction, noise, lost or late periods; a tank that never runs empty.
    """
    s = problem.sampling
    if s is None:
        raise ValueRangeError("the problem has no control rate", got=problem.name, needs="a sampled one")
    parts = SampledLoop(s.controller).parameters
    endless = {"tank_cap": NO_CAP, "tank_power": NO_CAP, "tank_trip": -NO_CAP}
    numbers = replaced(parts, s.numbers, IDEAL | endless)
    sampling = dataclasses.replace(
        s,
        jitter=0.0,
        missed=0.0,
        insist=True,
        numbers=numbers,
        plant=numbers[: parts.plant.size],
        gains=(),
        feedforward=(),
        drags=(),
    )
    return dataclasses.replace(
        problem,
        sampling=sampling,
        noise=None,
        events=(Event(0.0, hold(problem.home), PUSH), Event(PUSHED * s.period, None, np.zeros(6))),
        duration=periods * s.period,
        output_interval=s.period,
        tank=problem.tank._replace(initial=BRIMFUL),
    )


def growth(problem: Problem) -> float:
    """Return by how much the motion of a disturbed problem grows: inf if it left the finite numbers.

    The motion is the second difference of the motor velocities over the samples, in which the slow sway
    of the Cartesian spring hardly shows. It has grown if it ever is `SEEN` times as large as at the push; the
    value is then that ratio, whatever becomes of it far away. Otherwise the value is its root mean square
    over the last third of the run, relative to the middle third.
    """
    run = simulate_problem(problem)
    if run.failure:
        return math.inf
    jolt = np.linalg.norm(np.diff(run["dtheta"], n=2, axis=0), axis=1)
    pushed, third = jolt[: 2 * PUSHED].max(), jolt.size // 3
    if jolt.max() > SEEN * pushed:
        return float(jolt.max() / pushed)
    middle, end = _rms(jolt[third : 2 * third]), _rms(jolt[-third:])
    return end / middle if middle > 0 else 0.0


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
