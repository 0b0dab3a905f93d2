"""Surfaces in a scenario: planes, spheres, cylinders and boxes that the hand may meet."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from passiflex.scenarios.reference import ZERO, Circle, Hold, Length, Move, Step, Turn, Vector
from passiflex.scenarios.touching import KINDS, AbstractTouching, Change, Site
from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Mistakes

if TYPE_CHECKING:  # who reads a scenario needs no CasADi
    from passiflex.elements import AbstractElement, AbstractShape

Moved = Annotated[Step | Move | Circle | Hold, Field(discriminator="kind")]
"""How a surface moves."""
Size = Annotated[float, Quantity("m", above=0)]
BRISTLE = 1e4
"""Stiffness [N/m] against which a hand sticks to a surface that is not softer, unless another is given."""


class AbstractSurface(AbstractTouching):
    """A body that gives way like a spring where the hand presses on it, and rubs."""

    stiffness: Annotated[float, Quantity("N/m", above=0, most=1e9)] = Field(
        description="how hard it is, along its normal, N/m"
    )
    law: Literal["hunt_crossley", "linear"] = Field(
        default="hunt_crossley",
        description="of the depth δ: hunt_crossley, k δ (1 + c δ̇), or linear, k δ + d δ̇; neither pulls",
    )
    dissipation: Annotated[float, Quantity("s/m", least=0)] = Field(
        default=0.0,
        description="c of hunt_crossley, s/m; the bounce off it has about 1 − ⅔ c v of its speed v",
    )
    damping: Annotated[float, Quantity("N s/m", least=0)] = Field(
        default=0.0, description="d of linear, N s/m"
    )
    friction: Annotated[float, Quantity("1", least=0, most=10)] = Field(
        default=0.0, description="μ: dry friction as a share of the force along the normal; it sticks"
    )
    viscous: Annotated[float, Quantity("N s/m", least=0)] = Field(
        default=0.0, description="against sliding along it, N s/m"
    )
    bristle_stiffness: Annotated[float, Quantity("N/m", above=0)] | None = Field(
        default=None,
        description=f"what the hand sticks to, N/m; the smaller of stiffness and {BRISTLE:g} N/m if left out",
    )
    relative: bool = Field(
        default=False,
        strict=True,
        description="its place counts from where the end effector starts, along the world's axes",
    )
    motion: tuple[Moved, ...] = Field(
        default=(), description="how it moves, as a reference does; turns are not among it"
    )

    @model_validator(mode="after")
    def _of_its_law(self) -> Self:
        for name, law in (("dissipation", "hunt_crossley"), ("damping", "linear")):
            if getattr(self, name) and self.law != law:
                raise Mistakes(((name,), f"is of law: {law}; this one is {self.law}"))
        return self

    @model_validator(mode="after")
    def _moves_in_order(self) -> Self:
        for i, event in enumerate(self.motion[1:], 1):
            if not event.at > self.motion[i - 1].at:
                raise Mistakes((("motion", i, "at"), f"later than the one before; got {event.at:g} s"))
        for i, event in enumerate(self.motion):
            turned = [name for name in ("turn", "turns") if np.any(getattr(event, name, 0.0))]
            if turned:
                raise Mistakes((("motion", i, turned[0]), "a surface moves, and does not turn"))
        return self

    @property
    @abc.abstractmethod
    def place(self) -> Vector:
        """Return a point on it, or its centre."""

    @property
    @abc.abstractmethod
    def axes(self) -> NDArray[np.float64]:
        """Return its axes, as columns in world axes (3, 3)."""

    @abc.abstractmethod
    def shape(self) -> AbstractShape:
        """Return its shape, in these axes."""

    def build(self, label: str, site: Site) -> AbstractElement:
        """Return the surface."""
        from passiflex.elements import HuntCrossley, Linear, Surface

        rubs, hand = self.friction > 0, site.hand
        bristles = min(self.stiffness, BRISTLE) if self.bristle_stiffness is None else self.bristle_stiffness
        values: dict[str, Any] = {
            "place": np.array(self.place) + self.relative * site.at.position,
            "axes": self.axes,
            "stiffness": self.stiffness,
            "damping": self.damping if self.law == "linear" else self.dissipation,
            "viscous": self.viscous,
            "points": np.array(hand.points),
            "roundness": hand.radius,
        }
        values |= {"friction": self.friction, "bristle_stiffness": bristles} if rubs else {}
        return Surface(
            label=label,
            shape=self.shape(),
            normal=Linear() if self.law == "linear" else HuntCrossley(),
            points=len(hand.points),
            rubs=rubs,
            moved=bool(self.motion),
            values=values,
        )

    def changes(self, label: str) -> Sequence[Change]:
        """Return its motions, each from its instant on."""
        if not self.motion:
            return ()
        from passiflex.control.motion import Pose, hold, pose_at
        from passiflex.elements import motion_of

        began, motion = 0.0, hold(Pose(np.zeros(3), np.eye(3)))
        changes = [(began, motion)]
        for event in self.motion:
            motion = dict(event.build(pose_at(motion, event.at - began)))
            began = event.at
            changes.append((began, motion))
        return [
            Change(time, {f"{label}_{name}": value for name, value in motion_of(motion, time).items()})
            for time, motion in dict(changes).items()
        ]


def _towards(z: Vector) -> NDArray[np.float64]:
    """Return axes at right angles with their z along a direction."""
    from scipy.spatial.transform import Rotation

    largest = max(abs(part) for part in z)
    return Rotation.align_vectors([[part / largest for part in z]], [(0, 0, 1)])[0].as_matrix()


def _direction(name: str, v: Vector) -> None:
    """Raise Mistakes for a direction that is none."""
    if not any(v):
        raise Mistakes(((name,), "is no direction; got [0, 0, 0]"))


class Plane(AbstractSurface):
    """All on one side of a plane."""

    kind: Literal["plane"] = Field(description=KINDS)
    point: Length = Field(description="a point on it, m")
    normal: Annotated[Vector, Quantity("1", ((3,),))] = Field(
        description="out of it, towards the hand, in world axes; of any length"
    )

    @model_validator(mode="after")
    def _normal_is_one(self) -> Self:
        _direction("normal", self.normal)
        return self

    @property
    def place(self) -> Vector:
        """Return the point."""
        return self.point

    @property
    def axes(self) -> NDArray[np.float64]:
        """Return axes with z along the normal."""
        return _towards(self.normal)

    def shape(self) -> AbstractShape:
        """Return the half space below z."""
        from passiflex.elements import Plane

        return Plane()


class _Body(AbstractSurface):
    centre: Length = Field(description="of it, m")

    @property
    def place(self) -> Vector:
        """Return the centre."""
        return self.centre


class Sphere(_Body):
    """A ball."""

    kind: Literal["sphere"] = Field(description=KINDS)
    radius: Size = Field(description="of it, m")

    @property
    def axes(self) -> NDArray[np.float64]:
        """Return any axes."""
        return np.eye(3)

    def shape(self) -> AbstractShape:
        """Return the sphere."""
        from passiflex.elements import Sphere

        return Sphere(self.radius)


class Cylinder(_Body):
    """A cylinder with flat ends."""

    kind: Literal["cylinder"] = Field(description=KINDS)
    axis: Annotated[Vector, Quantity("1", ((3,),))] = Field(
        default=(0.0, 0.0, 1.0), description="along it, in world axes"
    )
    radius: Size = Field(description="of it, m")
    length: Annotated[float, Quantity("m", above=0, finite=False)] = Field(
        default=float("inf"), description="from end to end, m; inf for none"
    )

    @model_validator(mode="after")
    def _axis_is_one(self) -> Self:
        _direction("axis", self.axis)
        return self

    @property
    def axes(self) -> NDArray[np.float64]:
        """Return axes with z along it."""
        return _towards(self.axis)

    def shape(self) -> AbstractShape:
        """Return the cylinder."""
        from passiflex.elements import Cylinder
        from passiflex.elements.shapes import ENDLESS

        return Cylinder(self.radius, min(self.length / 2, ENDLESS))


class Box(_Body):
    """A box."""

    kind: Literal["box"] = Field(description=KINDS)
    size: Annotated[Vector, Quantity("m", ((3,),), above=0)] = Field(description="its three edges, m")
    rotation_vector: Turn = Field(default=ZERO, description="turn of its edges from the world's axes, rad")

    @property
    def axes(self) -> NDArray[np.float64]:
        """Return the directions of its edges."""
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_rotvec(self.rotation_vector).as_matrix())

    def shape(self) -> AbstractShape:
        """Return the box."""
        from passiflex.elements import Box

        return Box(*(edge / 2 for edge in self.size))
