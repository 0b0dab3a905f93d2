"""How far the robot is from its description, and how far the law's model of it is."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Section

Vector = tuple[float, ...]
Relative = Annotated[float | Vector, Quantity("1", ((), (None,)), above=-1)]


class AbstractRelative(Section):
    """By how much numbers differ from the robot's description, relative to it."""

    joint_stiffness: Relative = Field(
        default=0.0, description="K, relative, one number for all joints or one each, > -100 %"
    )
    joint_damping: Relative = Field(
        default=0.0, description="D, relative, one number for all joints or one each, > -100 %"
    )
    motor_inertia: Relative = Field(
        default=0.0, description="B, relative, one number for all joints or one each, > -100 %"
    )
    link_inertia: Relative = Field(
        default=0.0,
        description="mass and inertia of the links, relative, one number for all links or one each, > -100 %; "
        "a joint has one link, with everything fixed to it, and the base has no number",
    )


class Deviations(AbstractRelative):
    """By how much the robot differs from its description, which the law goes by: 20 % means 1.2 times it."""


class ModelErrors(AbstractRelative):
    """By how much the law's model differs from the robot's description: 50 % means 1.5 times it."""
