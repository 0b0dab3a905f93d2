"""The settings of the sensors in a scenario: what they make of the truth, and how late they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, field_validator

from passiflex.sampled.sayable import POSITIONS, SAYABLE
from passiflex.scenarios.control_settings import ENDLESS, Frequency, PerJoint, Vector
from passiflex.scenarios.spans import Instant
from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Mistakes, Section

if TYPE_CHECKING:  # who reads a scenario needs no CasADi
    from passiflex.sampled.readings import Lateness

    Sayable = str
else:
    Sayable = Literal[SAYABLE]

Angle = Annotated[float, Quantity("rad", least=0)]
MOST_LATE = 20
"""Longest delay of a sensor, in control periods: its code grows with them."""


class SensorSettings(Section):
    """What the sensors make of the truth; without it they tell the truth.

    Offsets and scale stay what they are for the whole run. The controller is not corrected for them: its
    books know how large they may be, not their sign.
    """

    torque_offset: Annotated[float | Vector, Quantity("N m", PerJoint)] = Field(
        default=0.0, description="τ_a is read this much too high, one number for all joints or one each, N m"
    )
    torque_scale: Annotated[float | Vector, Quantity("1", PerJoint, least=-0.5, most=0.5)] = Field(
        default=0.0, description="τ_a is read 1 + this times as large, one number or one each"
    )
    link_offset: Annotated[float | Vector, Quantity("rad", PerJoint)] = Field(
        default=0.0, description="q is read this much too high, one number or one each, rad"
    )
    motor_offset: Annotated[float | Vector, Quantity("rad", PerJoint)] = Field(
        default=0.0, description="θ is read this much too high, one number or one each, rad"
    )
    link_resolution: Angle = Field(default=0.0, description="resolution of q, rad; 0 for none")
    motor_resolution: Angle = Field(default=0.0, description="resolution of θ, rad; 0 for none")
    says: tuple[Sayable, ...] = Field(
        default=SAYABLE,
        description="what the robot says of its joints, q or theta at least; the law is told what follows from it",
    )
    velocity: Literal["true", "differences"] = Field(
        default="true", description="q̇ and θ̇: the truth, or differences of the position readings"
    )
    velocity_filter: Frequency = Field(
        default=ENDLESS, description="pole of the low-pass of the differences, Hz; inf for none"
    )
    torque_bandwidth: Frequency = Field(
        default=ENDLESS, description="pole of the joint torque sensors, Hz; inf for none"
    )
    wrench_bandwidth: Frequency = Field(
        default=ENDLESS, description="pole of the wrench sensor, Hz; inf for none"
    )
    link_delay: Instant = Field(
        default=0.0,
        description="q and q̇ are read this much late, s; between two samples, linearly; at most 20 periods",
    )
    motor_delay: Instant = Field(default=0.0, description="the same of θ and θ̇, s")
    torque_delay: Instant = Field(default=0.0, description="the same of τ_a, s")
    wrench_delay: Instant = Field(default=0.0, description="the same of the wrench sensor, s")

    @field_validator("says")
    @classmethod
    def _where_it_is(cls, says: tuple[str, ...]) -> tuple[str, ...]:
        if not POSITIONS & set(says):
            raise ValueError("needs q, theta, or both: a law must know where the joints are")
        return tuple(name for name in SAYABLE if name in says)

    @property
    def lateness(self) -> Lateness:
        """Return how late each sensor is."""
        from passiflex.sampled.readings import Lateness

        return Lateness(self.link_delay, self.motor_delay, self.torque_delay, self.wrench_delay)

    def require_soon(self, rate: float) -> None:
        """Raise Mistakes for a sensor that is later than a loop at this rate [Hz] can be."""
        late = {name: getattr(self, name) * rate for name in DELAYS}
        if found := [
            ((name,), f"a sensor is at most {MOST_LATE} periods late; got {periods:.4g} periods")
            for name, periods in late.items()
            if periods > MOST_LATE * (1 + 1e-9)
        ]:
            raise Mistakes(*found)


DELAYS = ("link_delay", "motor_delay", "torque_delay", "wrench_delay")
"""Its entries that are delays, in the order of `Lateness`."""
