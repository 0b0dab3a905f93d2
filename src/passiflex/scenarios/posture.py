"""Where an arm begins: its joint angles, or a pose of its end effector for which they are looked for."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag

from passiflex.scenarios.reference import Length, Turn
from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Section

Angles = Annotated[tuple[float, ...], Quantity("rad", ((None,),))]


class Pose(Section):
    """A pose of the end effector, the tool's if there is one, in the axes of the base."""

    position: Length = Field(description="m")
    rotation_vector: Turn | None = Field(
        default=None, description="turn from the axes of the base, rad; any orientation if left out"
    )


class AtPose(Section):
    """The joint angles with the end effector at a pose: of those that are found the ones farthest from singular."""

    pose: Pose = Field(description="of the end effector")
    near: Angles | None = Field(
        default=None, description="where to begin: the first found from there is taken, rad"
    )


def _kind(written: Any) -> str:
    return "pose" if isinstance(written, dict | AtPose) else "angles"


StartPosture = Annotated[
    Annotated[Angles, Tag("angles")] | Annotated[AtPose, Tag("pose")], Discriminator(_kind)
]
