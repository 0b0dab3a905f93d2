"""The settings of the noise in a scenario, and whether its hold fits the rate at which sensors are read."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Mistakes, Section

Deviation = Annotated[float, Quantity("rad", least=0)]
SAID = ("torque_variance", "link_deviation", "motor_deviation")


class Noise(Section):
    """White noise of the sensors: on the measured joint torque, held between samples, and on positions."""

    torque_variance: Annotated[float, Quantity("(N m)^2", least=0)] = Field(
        default=0.0, description="variance per joint, (N m)^2"
    )
    link_deviation: Deviation = Field(
        default=0.0,
        description="standard deviation of the readings of q, new in each period, rad; with control only",
    )
    motor_deviation: Deviation = Field(default=0.0, description="the same of θ, rad; with control only")
    hold: Annotated[float, Quantity("s", above=0)] = Field(
        default=0.001,
        description="time between two samples of the torque's noise, s; with control a whole multiple of the period, "
        "and the nearest one if left out",
    )

    @model_validator(mode="after")
    def _of_something(self) -> Self:
        if not self.model_fields_set & set(SAID):
            raise Mistakes(
                (
                    ("torque_variance",),
                    "missing: variance per joint, (N m)^2; or link_deviation, motor_deviation, of positions",
                )
            )
        return self

    def require_torque_only(self) -> None:
        """Raise Mistakes for noise on positions, which only sensors that are read have."""
        if found := [
            ((name,), "needs `control`: in continuous time nothing is read")
            for name in SAID[1:]
            if getattr(self, name)
        ]:
            raise Mistakes(*found)

    def fitted(self, rate: float) -> Self:
        """Return the noise with a sample held for whole periods of this rate [Hz], the nearest if none was asked for.

        Raises
        ------
        Mistakes
            If a hold was asked for that is no multiple of the period.
        """
        if "hold" not in self.model_fields_set:
            hold = max(1, round(self.hold * rate)) / rate
            return type(self).model_construct(self.model_fields_set, **dict(self) | {"hold": hold})
        if not is_multiple(self.hold * rate):
            needs = f"a whole multiple of the control period, {1 / rate:g} s: sensors are read once in it"
            raise Mistakes((("hold",), f"needs {needs}; got {self.hold:g} s"))
        return self


def is_multiple(ratio: float) -> bool:
    """Return whether a ratio of two times is whole, but for rounding, and at least 1."""
    return 0.5 < ratio < 1e9 and abs(ratio - round(ratio)) <= 1e-9 * ratio
