"""What every entry of a scenario's `environment` has in common, and the hand that it touches."""

from __future__ import annotations

import abc
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple

from pydantic import Field

from passiflex.scenarios.reference import ZERO, Vector
from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Section

if TYPE_CHECKING:  # who reads a scenario needs no CasADi
    from passiflex.control.motion import Pose
    from passiflex.elements import AbstractElement
    from passiflex.robots.flexible import FlexibleJointRobot

KINDS = "plane, sphere, cylinder, box, load, person, end_stops, or drag"


class Change(NamedTuple):
    """From an instant on, these inputs of an element hold."""

    time: float
    inputs: Mapping[str, Any]


class Hand(Section):
    """Where the end effector may touch surfaces: at points of it, each a small sphere."""

    radius: Annotated[float, Quantity("m", least=0)] = Field(
        default=0.0, description="radius of the sphere at each point, m"
    )
    points: Annotated[tuple[Vector, ...], Quantity("m", ((None, 3),))] = Field(
        default=(ZERO,), description="centres of the spheres, in the axes of the end effector, m"
    )


class Site(NamedTuple):
    """Where an element is built.

    Attributes
    ----------
    robot: The robot that it touches.
    at: Where the end effector starts.
    hand: Where that may touch surfaces.
    """

    robot: FlexibleJointRobot
    at: Pose
    hand: Hand


class AbstractTouching(Section, abc.ABC):
    """An entry of `environment`; each has a `kind`."""

    single: ClassVar[bool] = False
    """Whether there can be one of its kind only."""
    name: str = Field(
        default="",
        pattern=r"^([a-z][a-z0-9_]*)?$",
        max_length=40,
        description="what a run calls it, in small letters, digits and _; its kind if left out",
    )

    @property
    def usual(self) -> str:
        """Return what a run calls it unless it has a name."""
        return type(self).__name__.lower()

    @property
    def acts(self) -> bool:
        """Return whether it does anything."""
        return True

    @property
    def lasts(self) -> tuple[float, float]:
        """Return from when to when it is there [s]."""
        return 0.0, math.inf

    @abc.abstractmethod
    def build(self, label: str, site: Site) -> AbstractElement:
        """Return the element that a run calls by a label."""

    def changes(self, label: str) -> Sequence[Change]:
        """Return what changes of its inputs, in the order of time."""
        return ()
