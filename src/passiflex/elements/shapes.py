"""Shapes that may be touched: how far a point is from each, and which way is out, in the shape's own axes."""

from __future__ import annotations

import abc
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple, final

import casadi as cs
import numpy as np

from passiflex.layout import Field

TINY = 1e-12
"""Length [m] that keeps a direction from being none."""
ENDLESS = 1e6
"""Half length [m] of what has no ends."""


class Nearest(NamedTuple):
    """Distance of a point from a surface [m], negative within it, and the direction out of it (3,)."""

    distance: cs.SX
    outward: cs.SX


class AbstractShape(abc.ABC):
    """A body with a surface. Its sizes are numbers of a plant, so that a larger one needs no new build."""

    sizes: ClassVar[Mapping[str, str]] = {}
    """Its lengths: name → what it is."""

    def fields(self) -> tuple[Field, ...]:
        """Return the fields of its sizes."""
        return tuple(Field(name, (), "m", meaning) for name, meaning in self.sizes.items())

    def numbers(self) -> dict[str, float]:
        """Return its sizes."""
        return {name: float(getattr(self, name)) for name in self.sizes}

    @abc.abstractmethod
    def nearest(self, p: cs.SX, g: Mapping[str, cs.SX]) -> Nearest:
        """Return how far a point p (3,) is, with the sizes g by name."""


@final
@dataclass(frozen=True)
class Plane(AbstractShape):
    """All below z = 0."""

    def nearest(self, p: cs.SX, g: Mapping[str, cs.SX]) -> Nearest:
        """Return the height, and z."""
        return Nearest(p[2], cs.SX([0, 0, 1]))


@final
@dataclass(frozen=True)
class Sphere(AbstractShape):
    """Around the origin."""

    sizes: ClassVar[Mapping[str, str]] = {"radius": "of the sphere"}
    radius: float = field(default=1.0, compare=False)

    def nearest(self, p: cs.SX, g: Mapping[str, cs.SX]) -> Nearest:
        """Return the distance from the centre less the radius, and the way from there."""
        away = _length(p)
        return Nearest(away - g["radius"], p / away)


@final
@dataclass(frozen=True)
class Cylinder(AbstractShape):
    """Around z, with flat ends."""

    sizes: ClassVar[Mapping[str, str]] = {
        "radius": "of the cylinder",
        "half_length": "from its middle to an end",
    }
    radius: float = field(default=1.0, compare=False)
    half_length: float = field(default=ENDLESS, compare=False)

    def nearest(self, p: cs.SX, g: Mapping[str, cs.SX]) -> Nearest:
        """Return the distance from mantle, end, or the edge between them."""
        away = _length(p[:2])
        across = cs.vertcat(p[:2] / away, 0)
        along = cs.vertcat(0, 0, _sign(p[2]))
        return _of_faces([away - g["radius"], cs.fabs(p[2]) - g["half_length"]], [across, along])


@final
@dataclass(frozen=True)
class Box(AbstractShape):
    """Around the origin, with its edges along the axes."""

    sizes: ClassVar[Mapping[str, str]] = {f"half_{axis}": f"half its length along {axis}" for axis in "xyz"}
    half_x: float = field(default=1.0, compare=False)
    half_y: float = field(default=1.0, compare=False)
    half_z: float = field(default=1.0, compare=False)

    def nearest(self, p: cs.SX, g: Mapping[str, cs.SX]) -> Nearest:
        """Return the distance from a face, an edge or a corner."""
        beyond = [cs.fabs(p[i]) - g[f"half_{axis}"] for i, axis in enumerate("xyz")]
        ways = [_sign(p[i]) * cs.SX(np.eye(3)[i]) for i in range(3)]
        return _of_faces(beyond, ways)


def _of_faces(beyond: list[cs.SX], ways: list[cs.SX]) -> Nearest:
    """Return what is nearest of faces that meet at right angles.

    Parameters
    ----------
    beyond: How far the point is beyond each face [m]; negative within.
    ways: Direction out of each face (3,).
    """
    out = [cs.fmax(b, 0) for b in beyond]
    away = _length(cs.vertcat(*out))
    outside = sum((o * w for o, w in zip(out, ways, strict=True)), cs.SX.zeros(3)) / away
    deepest, way = beyond[0], ways[0]
    for b, w in zip(beyond[1:], ways[1:], strict=True):
        way = cs.if_else(b > deepest, w, way)
        deepest = cs.fmax(b, deepest)
    within = deepest <= 0
    return Nearest(cs.if_else(within, deepest, away), cs.if_else(within, way, outside))


def _length(v: cs.SX) -> cs.SX:
    return cs.sqrt(cs.sumsqr(v) + TINY**2)


def _sign(value: cs.SX) -> cs.SX:
    return cs.if_else(value < 0, -1, 1)
