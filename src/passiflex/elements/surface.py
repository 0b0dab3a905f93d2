"""A surface that gives way: what the hand meets, presses on, and rubs along."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, ClassVar, NamedTuple, final

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.control.motion import Pose
from passiflex.elements.bristle import slipping
from passiflex.elements.element import Effect, Mobility, Touch, nothing
from passiflex.elements.labelled import AbstractLabelled
from passiflex.elements.motion import POSITION, place_at
from passiflex.elements.normal import AbstractNormal, HuntCrossley
from passiflex.elements.shapes import AbstractShape, Plane
from passiflex.errors import ValueRangeError
from passiflex.layout import Field, Layout, Signal
from passiflex.robots.flexible import RobotState

ROUND_OFF = 1e-9
"""Depth [m] at which a hand is taken to be no more than on a surface."""
UPRIGHT = 1e-3
"""Time [s] within which a bristle lies down again where the surface has turned beneath it."""


class _Point(NamedTuple):
    """What happens at one point of the hand, in world axes."""

    depth: cs.SX
    outward: cs.SX
    lever: cs.SX
    force: cs.SX
    lost: cs.SX
    stored: cs.SX
    bending: cs.SX


@final
@dataclass(frozen=True)
class Surface(AbstractLabelled):
    """A body of a shape, at rest or moved, which points of the hand may touch; each is a small sphere.

    At each point it presses back along its normal by a law of the depth, and rubs: dry friction μ f by a bristle that
    sticks, and viscous friction against the sliding. What it is made of stores and loses energy; one that is moved is
    supplied with energy from beyond.

    Attributes
    ----------
    label: What a run calls it.
    shape, normal: What it is, and how it presses back.
    points: How many points of the hand may touch it.
    rubs: Whether there is dry friction.
    moved: Whether it moves.
    values: Its numbers, by the names of its parameters; see `numbers`.
    """

    meaning: ClassVar[str] = "lost in the surface"
    stores: ClassVar[bool] = True
    acts: bool = True
    label: str = "surface"
    shape: AbstractShape = field(default_factory=Plane)
    normal: AbstractNormal = field(default_factory=HuntCrossley)
    points: int = 1
    rubs: bool = False
    moved: bool = False
    values: Mapping[str, ArrayLike] = field(default_factory=dict, compare=False)

    @property
    def supplies(self) -> bool:  # type: ignore[override]
        """Return whether it moves: whatever moves it gives energy."""
        return self.moved

    @property
    def structure(self) -> Hashable:
        """Return what its code depends on: its numbers are parameters."""
        shape, normal = type(self.shape), type(self.normal)
        return type(self), self.acts, self.label, shape, normal, self.points, self.rubs, self.moved

    def parameters(self, n: int) -> Layout:
        """Return where it is, and what it is made of."""
        rubbing = (
            Field("friction", (), "1", "μ, dry friction's share of the normal force"),
            Field("bristle_stiffness", (), "N/m", "against what it sticks to"),
        )
        return self._called(
            Field("place", (3,), "m", "origin of its axes, in world axes"),
            Field("axes", (3, 3), "1", "its axes, as columns in world axes"),
            *self.shape.fields(),
            Field("stiffness", (), "N/m", "k of the surface"),
            Field("damping", (), self.normal.damping_unit, "of the surface, along its normal"),
            Field("viscous", (), "N s/m", "against sliding"),
            *rubbing[: 2 * self.rubs],
            Field("points", (self.points, 3), "m", "of the hand, in the axes of the end effector"),
            Field("roundness", (), "m", "radius of the hand at these points"),
        )

    def numbers(self, n: int) -> Mapping[str, ArrayLike]:
        """Return the values of `parameters`; whatever was not given is 0, the axes are the world's."""
        fields = self.parameters(n)
        given = {**self._own(SimpleNamespace(**fields.zeros()), fields).__dict__}
        given |= {"axes": np.eye(3), **self.shape.numbers(), **self.values}
        return {f"{self.label}_{name}": value for name, value in given.items()}

    def inputs(self) -> Layout:
        """Return how it moves."""
        return self._called(*POSITION.fields * self.moved)

    def state(self, n: int) -> Layout:
        """Return how its bristles are bent, in world axes, and its clock."""
        bristles = Field("bristles", (self.points, 3), "m", "bent by", ("point", "axis"), kept=False)
        clock = Field("clock", (), "s", "time by which it moves", kept=False)
        return self._called(*[bristles] * self.rubs, *[clock] * self.moved)

    def rate(self, free: Mobility) -> float:
        """Return how fast the hand swings on it, with all its points."""
        g = self._own(SimpleNamespace(**self.numbers(0)), self.parameters(0))
        mobility = sum(free.at(point) for point in np.reshape(g.points, (-1, 3)))
        along = self.normal.pole(mobility, float(g.stiffness), float(g.damping))
        sticking = float(np.sqrt(g.bristle_stiffness * mobility)) if self.rubs else 0.0
        return max(along, sticking + float(g.viscous) * mobility)

    def require_apart(self, at: Pose) -> None:
        """Raise ValueRangeError if the hand starts within it."""
        none, still, axes = cs.SX(0, 1), cs.SX.zeros(3), cs.SX(at.rotation)
        own = self.state(0).view(cs.SX.zeros(self.state(0).size))
        rest = Touch(RobotState(*[none] * 4), still, still, cs.SX(at.position), cs.SX.eye(3), axes, own)
        numbers, inputs = self.parameters(0), self.inputs()
        m = numbers.view(cs.SX(numbers.pack(dict(self.numbers(0)))))
        for touch in self._touches(rest, inputs.view(cs.SX.zeros(inputs.size)), m):
            depth, *outward = np.array(cs.evalf(cs.vertcat(touch.depth, touch.outward))).ravel()
            if depth > ROUND_OFF:
                way = ", ".join(f"{v:.3g}" for v in 0.0 - np.round(outward, 4))
                raise ValueRangeError(
                    f"the hand starts within {self.label}",
                    got=f"{1e3 * depth:.3g} mm deep, with the end effector at {np.round(at.position, 4).tolist()} m",
                    needs="a start outside; a surface that is moved may come to the hand",
                    try_=f"a place {1e3 * depth:.3g} mm or more along [{way}]",
                )

    def require_outside(self, joints: NDArray[np.float64]) -> None:
        """Raise ValueRangeError if all joints (n, 3) [m] are within it; a plane has no inside that could be one."""
        depths = self.depths(joints)
        if self.shape.sizes and (depths > 0).all():
            raise ValueRangeError(
                f"{self.label} swallows the robot",
                got=f"all {len(joints)} joints within it at the start, {depths.min():.3g} to {depths.max():.3g} m deep",
                needs="a robot outside; its hand alone touches what is around it",
                try_="another place, or a smaller size",
            )

    def depths(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how deep points (k, 3) [m] in world axes are within it (k,), before it moves; negative outside."""
        g = self._own(SimpleNamespace(**self.numbers(0)), self.parameters(0))
        sizes = {name: cs.SX(float(getattr(g, name))) for name in self.shape.sizes}
        local = (points - np.asarray(g.place)) @ np.asarray(g.axes)
        return np.array([-float(cs.evalf(self.shape.nearest(cs.SX(p), sizes).distance)) for p in local])

    def act(self, at: Touch, s: Any, m: Any) -> Effect:
        """Return force and moment at the end effector, summed over the points."""
        touches = self._touches(at, s, m)
        none = nothing(at.x.q.numel())
        force = sum((t.force for t in touches), none.force)
        moment = sum((cs.cross(t.lever, t.force) for t in touches), none.moment)
        rates = [cs.vertcat(*(t.bending for t in touches))] * self.rubs + [cs.SX(1)] * self.moved
        return none._replace(
            force=at.rotation.T @ force,
            moment=at.rotation.T @ moment,
            lost=sum((t.lost for t in touches), none.lost),
            stored=sum((t.stored for t in touches), none.stored),
            supplied=cs.dot(force, self._motion(at, s)[1]),
            rate=cs.vertcat(cs.SX(0, 1), *rates),
        )

    def seen(self, at: Touch, s: Any, m: Any) -> tuple[Signal, ...]:
        """Return its force on the hand, and how deep that is within it."""
        touches = self._touches(at, s, m)
        force = sum((t.force for t in touches), cs.SX.zeros(3))
        depth = touches[0].depth
        for t in touches[1:]:
            depth = cs.fmax(depth, t.depth)
        place = self._motion(at, s)[0] + self._own(m, self.parameters(at.x.q.numel())).place
        return (
            Signal(Field(f"{self.label}_force", (3,), "N", "on the hand, world axes", axes=("axis",)), force),
            Signal(
                Field(f"{self.label}_depth", (), "m", "of the hand within it; negative where it is apart"),
                depth,
            ),
            *[Signal(Field(f"{self.label}_place", (3,), "m", "where it is", axes=("axis",)), place)]
            * self.moved,
        )

    def _motion(self, at: Touch, s: Any) -> tuple[cs.SX, cs.SX]:
        """Return by how much it has moved, and its velocity, in world axes."""
        if not self.moved:
            return cs.SX.zeros(3), cs.SX.zeros(3)
        clock = getattr(at.own, f"{self.label}_clock")
        return place_at(clock, self._own(s, self.inputs()))

    def _touches(self, at: Touch, s: Any, m: Any) -> list[_Point]:
        n = at.x.q.numel()
        g = self._own(m, self.parameters(n))
        shift, speed = self._motion(at, s)
        sizes = {name: getattr(g, name) for name in self.shape.sizes}
        moving = at.rotation @ at.velocity - speed
        spin, out = at.rotation @ at.spin, []
        for i in range(self.points):
            arm = at.axes @ g.points[i, :].T
            away = at.position + arm - g.place - shift
            nearest = self.shape.nearest(g.axes.T @ away, sizes)
            outward = g.axes @ nearest.outward
            depth = g.roundness - nearest.distance
            lever = arm - (g.roundness - cs.fmax(depth, 0)) * outward  # on the surface, as it is pressed in
            velocity = moving + cs.cross(spin, lever)
            bent = getattr(at.own, f"{self.label}_bristles")[i, :].T if self.rubs else None
            out.append(self._point(g, depth, outward, lever, velocity, bent))
        return out

    def _point(
        self, g: Any, depth: cs.SX, outward: cs.SX, lever: cs.SX, velocity: cs.SX, bent: cs.SX | None
    ) -> _Point:
        rate = -cs.dot(outward, velocity)
        pressed = self.normal.press(cs.fmax(depth, 0), rate, g.stiffness, g.damping)
        touching = cs.if_else(depth > 0, 1, 0)
        sliding = velocity + rate * outward
        viscous = touching * g.viscous
        force = pressed.force * outward - viscous * sliding
        lost = pressed.lost + viscous * cs.sumsqr(sliding)
        if bent is None:
            return _Point(depth, outward, lever, force, lost, pressed.stored, cs.SX(0, 1))
        flat = bent - outward * cs.dot(outward, bent)
        slips = slipping(bent, touching * sliding, g.friction * pressed.force / g.bristle_stiffness)
        # Along the normal, which turns on a curved surface, a bristle is no use, and is let go like a slipping one.
        upright = (bent - flat) / UPRIGHT
        friction = -touching * g.bristle_stiffness * flat
        return _Point(
            depth,
            outward,
            lever,
            force + friction,
            lost + g.bristle_stiffness * (slips.lost + cs.dot(upright, bent)),
            pressed.stored + g.bristle_stiffness * cs.sumsqr(bent) / 2,
            touching * sliding - slips.slip - upright,
        )
