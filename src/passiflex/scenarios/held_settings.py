"""What the hand holds in a scenario: a load that is picked up and set down, and a person who takes hold of the arm."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from passiflex.scenarios.reference import ZERO, Length, Vector
from passiflex.scenarios.spans import TimeSpan
from passiflex.scenarios.touching import KINDS, AbstractTouching, Change, Site
from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Mistakes

if TYPE_CHECKING:  # who reads a scenario needs no CasADi
    from passiflex.elements import AbstractElement

GRIP_RATIO = 0.5
"""Damping ratio of mass and grip, unless the grip's damping is given."""


class AbstractHeld(TimeSpan, AbstractTouching):
    """A point mass that the hand is one with, through a grip, for some time."""

    mass: Annotated[float, Quantity("kg", above=0)] = Field(description="kg")
    grasp: Length = Field(default=ZERO, description="where it is held, in the axes of the end effector, m")
    grip_stiffness: Annotated[float, Quantity("N/m", above=0, most=1e9)] = Field(
        default=2e4, description="of the grip, N/m"
    )
    grip_damping: Annotated[float, Quantity("N s/m", least=0)] | None = Field(
        default=None, description=f"of the grip, N s/m; a ratio of {GRIP_RATIO:g} if left out"
    )

    def _numbers(self) -> dict[str, Any]:
        damping = 2 * GRIP_RATIO * math.sqrt(self.grip_stiffness * self.mass)
        return {
            "mass": self.mass,
            "grasp": np.array(self.grasp),
            "grip_stiffness": self.grip_stiffness,
            "grip_damping": damping if self.grip_damping is None else self.grip_damping,
        }

    def _pushes(self) -> Sequence[Push]:
        return ()

    def changes(self, label: str) -> Sequence[Change]:
        """Return when it is gripped, and what pushes it."""
        pushes = self._pushes()
        times = {self.start, self.end, *(t for p in pushes for t in p.lasts)}
        found = []
        for time in sorted(times):
            forces = [np.array(p.force) for p in pushes if p.start <= time < p.end]
            gripped = float(self.start <= time < self.end)
            push = sum(forces, np.zeros(3))
            found.append(Change(time, {f"{label}_gripped": gripped, f"{label}_push": push}))
        return found


class Load(AbstractHeld):
    """A load that is picked up where the hand is, at rest, and set down where the hand is then."""

    kind: Literal["load"] = Field(description=KINDS)
    known: bool = Field(
        default=False,
        strict=True,
        description="whether the law holds up its weight meanwhile, by a feed-forward force behind the tank's valve",
    )

    def build(self, label: str, site: Site) -> AbstractElement:
        """Return the load."""
        from passiflex.elements import Held

        return Held(label=label, values={**self._numbers(), "weight": np.array(self.gravity(site))})

    @staticmethod
    def gravity(site: Site) -> Vector:
        """Return what pulls at it, m/s²: as the robot is mounted."""
        return tuple(float(g) for g in site.robot.arm.chain.gravity)


class Push(TimeSpan):
    """A force for some time."""

    force: Annotated[Vector, Quantity("N", ((3,),))] = Field(description="force in world axes, N")


class Person(AbstractHeld):
    """Somebody takes hold of the hand and pushes it about; an arm that would stay where it took hold."""

    kind: Literal["person"] = Field(description=KINDS)
    mass: Annotated[float, Quantity("kg", above=0)] = Field(
        default=2.0, description="of hand and forearm, as the hand feels it, kg"
    )
    grip_stiffness: Annotated[float, Quantity("N/m", above=0, most=1e9)] = Field(
        default=5e3, description="of the grip, N/m"
    )
    arm_stiffness: Annotated[float, Quantity("N/m", least=0)] = Field(
        default=300.0, description="toward where the arm took hold, N/m"
    )
    arm_damping: Annotated[float, Quantity("N s/m", least=0)] = Field(
        default=25.0, description="of the same motion, N s/m"
    )
    pushes: tuple[Push, ...] = Field(default=(), description="with what force it pushes, and when")

    @model_validator(mode="after")
    def _pushes_while_it_holds(self) -> Self:
        for i, push in enumerate(self.pushes):
            if push.start < self.start or push.end > self.end:
                needs = f"within the time in which it holds the arm, {self.start:g} to {self.end:g} s"
                raise Mistakes((("pushes", i, "from"), f"{needs}; got {push.start:g} to {push.end:g} s"))
        return self

    def build(self, label: str, site: Site) -> AbstractElement:
        """Return the person."""
        from passiflex.elements import Held

        arm = {"arm_stiffness": self.arm_stiffness, "arm_damping": self.arm_damping}
        return Held(label=label, anchored=True, values=self._numbers() | arm)

    def _pushes(self) -> Sequence[Push]:
        return self.pushes
