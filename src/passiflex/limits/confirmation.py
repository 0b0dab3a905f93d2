"""A point of the limit map in the nonlinear simulation: pushed for a moment, does the motion die out or grow?"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.control.motion import hold
from passiflex.control.tank import NO_CAP
from passiflex.problems.altered import altered
from passiflex.problems.problem import Event, Noise, Problem, SampledProblem, require_sampled
from passiflex.sampled.readings import Lateness
from passiflex.simulation.simulate_sampled import simulate_unchecked
from passiflex.stability.law_slope import IDEAL
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.loop_at_rest import BRIMFUL

Array = NDArray[np.float64]

PUSH = np.array([1.0, 0.7, -0.5, 0.1, -0.07, 0.05])
"""Wrench of the disturbance [N, N m]; no component is 0, so that no symmetry of the posture hides a mode."""
PUSHED = 10
"""Periods that it lasts."""
PERIODS = 2000
"""Periods of a simulation: a mode that grows `VISIBLE`-fold per period grows 1.2-fold from third to third."""
VISIBLE = 1.0003
CALM, NEARLY = 0.35, 0.95
"""Largest torque off its rest, rms, as a share of a motor's limit, and the share of it that is near."""
FADING, QUIET = 0.8, 0.05
"""Without noise: by how much the torque falls from third to third at least, unless below that share of a limit."""
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
    problem: SampledProblem,
    plane: str,
    point: tuple[float, float],
    gains: Mapping[str, Array] | None = None,
    rate: float | None = None,
) -> Confirmation:
    """Return both verdicts on the problem with these gains, at a rate with as many periods of delay, of sensors too."""
    if rate is None:
        changed = altered(problem, gains=gains)
    else:
        stretch = 1 / (problem.period * rate)
        lateness = Lateness(*(late * stretch for late in problem.lateness)) if any(problem.lateness) else None
        changed = altered(problem, rate=rate, delay=problem.delay * stretch, gains=gains, lateness=lateness)
    return Confirmation(plane, *point, LinearLoop(changed).radius(), growth(disturbed(changed)))


def disturbed(problem: Problem, periods: int = PERIODS) -> SampledProblem:
    """Return the problem at rest and pushed for `PUSHED` periods, with nothing that could hide a growing motion.

    No limits, resolution, friction, noise, lost or late periods; a tank that never runs empty.
    """
    s = require_sampled(problem)
    endless = {"tank_cap": NO_CAP, "tank_power": NO_CAP, "tank_trip": -NO_CAP}
    return dataclasses.replace(
        s.with_numbers(IDEAL | endless),
        jitter=0.0,
        missed=0.0,
        lost=(),
        allow_unstable=True,
        gain_changes=(),
        feedforward=(),
        noise=None,
        events=(Event(0.0, hold(problem.home), PUSH), Event(PUSHED * s.period, None, np.zeros(6))),
        duration=periods * s.period,
        output_interval=s.period,
        tank=problem.tank._replace(initial=BRIMFUL),
    )


def settled(problem: SampledProblem, plant: Mapping[str, Array], late: float, variance: float) -> bool:
    """Return whether a robot of a box comes to rest after a push, with its sensors, limits and noise.

    Nothing trembles on: over the last third of the run no motor's torque is off its rest by more than `CALM`
    of its limit, rms, or ever near the limit, and without noise it dies out. A limit cycle in which a tank
    stays full fails here; the tank itself is left aside.

    Parameters
    ----------
    problem: With the gains in question, at the robot's posture.
    plant: Numbers of the robot that are off, of which the law knows nothing.
    late: How late its commands are [s]; the law goes on to expect its own delay.
    variance: Of the torque sensors' noise [(N m)²].
    """
    changed = altered(problem, plant=plant)
    own, robot = disturbed(changed), problem.law.robot
    real = own.parts.unpack("sensors", changed.numbers) | own.parts.unpack("limits", changed.numbers)
    limit = np.minimum(np.asarray(real["torque_limit"]), robot.torque_limit)
    noise = Noise(variance, changed.period) if variance else None
    own = dataclasses.replace(own.with_numbers(real | {"torque_limit": limit}), delay=late, noise=noise)
    run = simulate_unchecked(own)
    if run.failure:
        return False
    third = len(run.time) // 3
    off = np.abs(run["tau_m"] - changed.held)
    middle, end = (np.sqrt(np.mean(part**2, axis=0)) for part in (off[third : 2 * third], off[2 * third :]))
    dies_out = variance > 0 or bool((end <= np.maximum(FADING * middle, QUIET * limit)).all())
    near = np.abs(run["tau_m"][2 * third :]).max(axis=0) >= np.maximum(
        NEARLY * limit, 1.05 * np.abs(changed.held)
    )
    return dies_out and bool((end <= CALM * limit).all()) and not near.any()


def growth(problem: SampledProblem) -> float:
    """Return by how much the motion of a disturbed problem grows: inf if it left the finite numbers.

    The motion is the second difference of the motor velocities over the samples, in which the slow sway
    of the Cartesian spring hardly shows. It has grown if it ever is `SEEN` times as large as at the push; the
    value is then that ratio, whatever becomes of it far away. Otherwise the value is its root mean square
    over the last third of the run, relative to the middle third.
    """
    run = simulate_unchecked(problem)
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
