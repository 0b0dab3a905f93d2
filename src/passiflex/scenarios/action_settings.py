"""What is not passive in a scenario file, and only acts as far as the tank's valve is open. SI units."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from passiflex.scenarios.control_settings import PerJoint, Share, Vector
from passiflex.scenarios.spans import TimeSpan
from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Section


class Actions(Section):
    """What is not passive, and only acts as far as the tank's valve is open."""

    posture_stiffness: Annotated[float | Vector, Quantity("N m/rad", PerJoint, least=0)] = Field(
        default=0.0, description="of a spring in the null space toward `posture`, N m/rad"
    )
    posture_damping: Annotated[float | Vector, Quantity("N m s/rad", PerJoint, least=0)] | None = Field(
        default=None,
        description="of the same motion, N m s/rad; a ratio of 0.7 of each joint at the start if left out",
    )
    posture: Annotated[Vector, Quantity("rad", ((None,),))] | None = Field(
        default=None, description="joint angles that this spring pulls to, rad; the start if left out"
    )
    follow_velocity: Share = Field(default=0.0, description="share of D_x ẋ_d that is fed forward, 0 to 1")
    follow_acceleration: Share = Field(default=0.0, description="share of Λ ẍ_d that is fed forward, 0 to 1")
    coulomb_compensation: Annotated[float | Vector, Quantity("N m", PerJoint, least=0)] = Field(
        default=0.0, description="dry friction of the motors that is made up for, one number or one each, N m"
    )
    viscous_compensation: Annotated[float | Vector, Quantity("N m s/rad", PerJoint, least=0)] = Field(
        default=0.0, description="viscous friction that is made up for, one number or one each, N m s/rad"
    )
    compensation_width: Annotated[float, Quantity("rad/s", above=0)] = Field(
        default=0.05,
        description="speed at which half of the dry friction is made up for, rad/s; at rest none of it is",
    )

    @property
    def compensates(self) -> bool:
        """Return whether any friction is made up for."""
        return bool(np.any(self.coulomb_compensation) or np.any(self.viscous_compensation))


class Feedforward(TimeSpan):
    """A wrench that the end effector is to exert for some time, as far as the valve is open."""

    force: Annotated[Vector, Quantity("N", ((3,),))] = Field(
        default=(0.0, 0.0, 0.0), description="force in world axes, N"
    )
    moment: Annotated[Vector, Quantity("N m", ((3,),))] = Field(
        default=(0.0, 0.0, 0.0), description="moment in world axes, N m"
    )
