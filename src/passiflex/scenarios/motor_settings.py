"""The settings of the motors in a scenario file: limits and friction. SI units."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from passiflex.scenarios.control_settings import ENDLESS, PerJoint, Vector
from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Mistakes, Section

NAMED = ("none", "robot")
TorqueLimit = Annotated[str | float | Vector, Quantity("N m", PerJoint, above=0, names=NAMED)]
STICKING = ("static_friction", "stribeck_speed", "break_away")
"""Entries of friction that sticks."""
SpeedLimit = Annotated[str | float | Vector, Quantity("rad/s", PerJoint, above=0, names=NAMED)]


class MotorSettings(Section):
    """What the motors make of a command; without it they give it exactly."""

    torque_limit: TorqueLimit = Field(
        default="none",
        description="largest torque: none, that of the robot's description, or in N m, one number or one each",
    )
    torque_rate_limit: Annotated[float | Vector, Quantity("N m/s", PerJoint, above=0, finite=False)] = Field(
        default=ENDLESS,
        description="fastest change of the torque, one number or one each, N m/s; inf for none",
    )
    speed_limit: SpeedLimit = Field(
        default="none",
        description="beyond which a motor is braked: none, that of the robot's description, or in rad/s, one number "
        "or one each",
    )
    friction: Literal["sticks", "smooth"] = Field(
        default="smooth",
        description="how coulomb_friction acts: it sticks, or it is smooth and creeps where it should stick",
    )
    coulomb_friction: Annotated[float | Vector, Quantity("N m", PerJoint, least=0)] = Field(
        default=0.0, description="at the motors, one number for all joints or one each, N m"
    )
    viscous_friction: Annotated[float | Vector, Quantity("N m s/rad", PerJoint, least=0)] = Field(
        default=0.0, description="at the motors, one number for all joints or one each, N m s/rad"
    )
    friction_width: Annotated[float, Quantity("rad/s", above=0)] = Field(
        default=0.01, description="speed over which Coulomb friction changes its sign, rad/s"
    )

    static_friction: Annotated[float, Quantity("1", least=1, most=10)] = Field(
        default=1.0, description="of friction that sticks, before it slips, as a multiple of coulomb_friction"
    )
    stribeck_speed: Annotated[float, Quantity("rad/s", above=0)] = Field(
        default=0.01, description="over which it falls from there to coulomb_friction, rad/s"
    )
    break_away: Annotated[float, Quantity("rad", above=0)] = Field(
        default=1e-4, description="by which a motor gives way before it slips, seen from the link, rad"
    )

    @model_validator(mode="after")
    def _of_what_sticks(self) -> Self:
        fields = type(self).model_fields
        unused = [n for n in STICKING if getattr(self, n) != fields[n].default and self.friction == "smooth"]
        if unused:
            what = "friction that is smooth does not use it; take friction: sticks"
            raise Mistakes(*(((name,), what) for name in unused))
        return self

    def require_unlimited(self) -> None:
        """Raise Mistakes for limits, which only a sampled run has."""
        said = {
            "torque_limit": self.torque_limit != "none",
            "torque_rate_limit": min(np.atleast_1d(self.torque_rate_limit)) < ENDLESS,
        }
        if found := [
            ((name,), "needs `control`: only a sampled run has it") for name, is_set in said.items() if is_set
        ]:
            raise Mistakes(*found)
