"""What joints are like whose maker says nothing: K, D and B by the class of their drive and their torque rating.

Laws of few numbers through what is published (`docs/robots.md` has the neighbours), and how far what is published is
off them. Nothing of it is known of a robot: it is where one begins, and a range over which answers are looked at.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.errors import NameUnknownError
from passiflex.robots.bodies import Array

SMALLEST = 0.1
"""A torque rating [N m] below which none is believed."""


class Estimate(NamedTuple):
    """Numbers of the joints, shares of them between which the true ones are looked for, and the reason."""

    value: Array
    low: float
    high: float
    why: str


@dataclass(frozen=True)
class Drive:
    """A class of drives: K = stiffness √τ, B = inertia τ, D = 2 ζ √(K B) with the torque rating τ in N m.

    Attributes
    ----------
    title: In words.
    stiffness: [N m/rad/√(N m)]; published values lie within a factor of `stiffness_factor`.
    inertia: [kg m²/(N m)], behind the gear; likewise.
    damping: ζ of the motor against a locked link; likewise.
    neighbours: What is published.
    sensed: Whether it has torque sensors.
    """

    title: str
    stiffness: float
    stiffness_factor: float
    inertia: float
    inertia_factor: float
    damping: float
    damping_factor: float
    neighbours: str
    sensed: bool = False

    def estimates(self, rating: Array) -> dict[str, Estimate]:
        """Return the numbers of joints with these torque ratings [N m], by entry of a robot file."""
        tau = np.maximum(rating, SMALLEST)
        K, B = self.stiffness * np.sqrt(tau), self.inertia * tau
        D = 2 * self.damping * np.sqrt(K * B)
        laws = {
            "joint_stiffness": (
                K,
                self.stiffness_factor,
                f"{self.stiffness:g} N m/rad times √(rating / 1 N m)",
            ),
            "joint_damping": (D, self.damping_factor, f"{self.damping:g} of critical against a locked link"),
            "motor_inertia": (B, self.inertia_factor, f"{self.inertia:g} kg m^2 per N m of rating"),
        }
        return {
            entry: Estimate(value, 1 / factor, factor, f"{law}, as {self.title} have: {self.neighbours}")
            for entry, (value, factor, law) in laws.items()
        }


DRIVES: Mapping[str, Drive] = {
    "sensed": Drive(
        "strain wave gears with torque sensors",
        700.0, 3.0, 0.012, 2.5, 0.01, 4.0,
        "LWR IV, FR3, Gen3",
        sensed=True,
    ),
    "industrial": Drive(
        "strain wave gears without torque sensors",
        2000.0, 3.0, 0.012, 2.5, 0.02, 4.0,
        "gear makers' tables of torsional stiffness; inertia as with torque sensors",
    ),
    "servo": Drive(
        "geared servos",
        300.0, 5.0, 0.012, 3.0, 0.05, 4.0,
        "spur gears of 1:200 to 1:350, whose play is not in a spring",
    ),
    "direct": Drive(
        "quasi-direct drives",
        700.0, 5.0, 0.0015, 4.0, 0.02, 4.0,
        "planetary gears of 1:6 to 1:40",
    ),
}  # fmt: skip
"""Name → class of drives."""
SLIDE_SWING, SLIDE_SHARE, SLIDE_DAMPING = 20.0, 1.0, 0.02
"""Of a slide: how fast its belt or screw swings with what it carries [Hz], what its motor weighs behind the gear as a
share of that, and its share of critical damping."""
SLIDE = (
    f"; slides: {SLIDE_SWING:g} Hz with what they carry, a motor of {SLIDE_SHARE:g} times that, {SLIDE_DAMPING:g} of "
    "critical, of no neighbour"
)
"""The same in words."""
WEAKEST_ARM = 15.0
"""[N m] An arm whose strongest joint is weaker is taken for one of servos, any other for one without torque sensors."""


def drive_of(name: str | None, rating: Array) -> tuple[str, Drive]:
    """Return a class of drives by name; without one that of arms as strong as this.

    Raises
    ------
    NameUnknownError
        For a class that there is not.
    """
    if name is None:
        name = "servo" if rating.max(initial=0.0) < WEAKEST_ARM else "industrial"
    if name not in DRIVES:
        raise NameUnknownError("class of drives", name, list(DRIVES))
    return name, DRIVES[name]


def with_slides(
    estimates: Mapping[str, Estimate], slides: NDArray[np.bool_], carried: Array
) -> dict[str, Estimate]:
    """Return estimates in which slides have numbers by what they carry [kg]: torque says nothing of them."""
    if not slides.any():
        return dict(estimates)
    B = SLIDE_SHARE * carried
    K = (2 * np.pi * SLIDE_SWING) ** 2 * carried
    own = {"joint_stiffness": K, "joint_damping": 2 * SLIDE_DAMPING * np.sqrt(K * B), "motor_inertia": B}
    return {
        entry: one._replace(value=np.where(slides, own[entry], one.value), why=one.why + SLIDE)
        for entry, one in estimates.items()
    }
