"""What people say of gains, and what would become of an arm: simulated by the nonlinear loop."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.cards.setting import Setting
from passiflex.control.motion import hold, moved
from passiflex.limits.confirmation import disturbed, growth
from passiflex.problems.problem import Event
from passiflex.simulation.simulate_sampled import simulate_unchecked

Array = NDArray[np.float64]

USUAL = 1000.0
"""[N/m] For which the joints are shaped, and at which it is seen what the answer hangs on."""
FOLKLORE = 5000.0
"""[N/m] What people call a typical largest stiffness."""
STEP, LASTS = 0.01, 1.0
"""[m], [s] A step of the reference in the simulations."""


class Told(NamedTuple):
    """A piece of folklore, and what would happen.

    Attributes
    ----------
    said: The gains.
    frequency: Of the slowest mode to die out [Hz].
    growth: Of a push in the nonlinear simulation: it dies out if below 1.
    overshoot: Of a step of the reference in it, as a share of the step; nan if it left the finite numbers.
    """

    said: str
    frequency: float
    growth: float
    overshoot: float


def folklore(own: Setting) -> Iterator[Told]:
    """Yield what becomes of what people say: stiffnesses, and a damping of 2 √K whatever the inertia; simulated."""
    size = 6 if own.task == "pose" else 3
    for k in (USUAL, FOLKLORE):
        K = np.array([k] * 3 + [k / 10] * 3)[:size]
        careless = {"stiffness": np.diag(K), "damping": np.diag(2 * np.sqrt(K))}
        both = f"K_x = {k:g} N/m" + (f", {k / 10:g} N m/rad" if size == 6 else "")
        yield _simulated(own, f"{both}, D_x = 2 √K_x whatever the inertia", careless)
        yield _simulated(own, f"{both}, damped by the inertia that moves", own.gains(k, k / 10))


def _simulated(own: Setting, said: str, gains: Mapping[str, Array]) -> Told:
    """Return what the nonlinear loop does after a step, at the posture and on the robot that like it least."""
    found = own.worst(gains)
    mode, quiet = found.mode(gains), disturbed(own.simulated(found.member, gains))
    grown = growth(quiet)
    goal = moved(quiet.home, (0.0, 0.0, STEP), (0.0, 0.0, 0.0))
    stepped = dataclasses.replace(
        quiet, events=(Event(0.0, hold(goal), np.zeros(6)),), duration=round(LASTS * own.rate) / own.rate
    )
    run = simulate_unchecked(stepped)
    way = (run["position"][:, 2] - run["position"][0, 2]) / STEP
    return Told(said, mode.frequency, grown, math.nan if run.failure else float(way.max() - 1))
