"""Frames of joints whose z axis is that of the joint, and what is carried from one to the next.

A turn about the joint mixes two coordinates only, and a right angle of the robot's geometry costs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.robots.vectors import Vector, congruent, constants, cross, plus, times

Array = NDArray[np.float64]

ROUNDED = 1e-15
"""An entry of a rotation that is nearer than this to −1, 0 or 1 is that: angles in files are rounded."""


class Inertia(NamedTuple):
    """The inertia of a body about the origin of its joint, in the axes of the joint.

    Attributes
    ----------
    mass: m [kg].
    moment: m c [kg m].
    tensor: xx, xy, xz, yy, yz, zz [kg m²].
    """

    mass: cs.SX
    moment: Vector
    tensor: Vector

    def seen(self, axes: Array) -> Inertia:
        """Return it in other axes at the same origin; these are columns in them."""
        return Inertia(self.mass, times(axes, self.moment), congruent(axes, self.tensor))


class Wrench(NamedTuple):
    """A force [N] and a moment [N m] about the origin of the frame in whose axes both are."""

    force: Vector
    moment: Vector


@dataclass(frozen=True, eq=False)
class JointFrame:
    """Where a joint is: in the frame of the joint before it, of the base for the first one.

    Attributes
    ----------
    origin: Its origin [m].
    axes: Its axes before it has moved, as columns; z is the axis of the joint.
    link: Axes of its link, as a URDF has them, as columns in the axes of the joint.
    slides: Whether it slides along z, rather than turning about it.
    """

    origin: Array
    axes: Array
    link: Array
    slides: bool

    def moved(self, q: cs.SX) -> Moved:
        """Return the frame at the joint position q [rad or m]."""
        if self.slides:
            origin = [
                o + z * q for o, z in zip(constants(self.origin), constants(self.axes[:, 2]), strict=True)
            ]
            return Moved(origin, self.axes, None)
        return Moved(constants(self.origin), self.axes, (cs.cos(q), cs.sin(q)))


class Moved(NamedTuple):
    """A frame in the one before it: at `origin`, with axes C Rz(q); `turn` is cos q and sin q, None without a turn."""

    origin: Vector
    axes: Array
    turn: tuple[cs.SX, cs.SX] | None

    def inward(self, v: Vector) -> Vector:
        """Return a vector of the frame before in the axes of this one."""
        x, y, z = times(self.axes.T, v)
        if self.turn is None:
            return [x, y, z]
        c, s = self.turn
        return [c * x + s * y, c * y - s * x, z]

    def outward(self, v: Vector) -> Vector:
        """Return a vector of this frame in the axes of the one before."""
        x, y, z = v
        if self.turn is not None:
            c, s = self.turn
            x, y = c * x - s * y, s * x + c * y
        return times(self.axes, [x, y, z])

    def wrench_outward(self, w: Wrench) -> Wrench:
        """Return a wrench at this frame as one at the frame before."""
        force = self.outward(w.force)
        return Wrench(force, plus(self.outward(w.moment), cross(self.origin, force)))

    def inertia_outward(self, body: Inertia) -> Inertia:
        """Return an inertia about this frame as one about the frame before."""
        m, h, r = body.mass, self.outward(body.moment), self.origin
        tensor = congruent(self.axes, self._turned(body.tensor))
        # about r: I − [r]×[h]× − [h]×[r]× − m [r]×[r]×, and with k = h + m r / 2 the last three are one
        k = [a + m * b / 2 for a, b in zip(h, r, strict=True)]
        xx, yy, zz = (2 * a * b for a, b in zip(r, k, strict=True))
        shift = [
            yy + zz, -(r[0] * k[1] + r[1] * k[0]), -(r[0] * k[2] + r[2] * k[0]),
            xx + zz, -(r[1] * k[2] + r[2] * k[1]), xx + yy,
        ]  # fmt: skip
        return Inertia(m, [a + m * b for a, b in zip(h, r, strict=True)], plus(tensor, shift))

    def _turned(self, tensor: Vector) -> Vector:
        """Return Rz I Rzᵀ."""
        if self.turn is None:
            return tensor
        c, s = self.turn
        xx, xy, xz, yy, yz, zz = tensor
        a, b = c * xx - s * xy, c * xy - s * yy
        first = a * c - b * s
        return [first, a * s + b * c, c * xz - s * yz, xx + yy - first, s * xz + c * yz, zz]


def aligned(axis: Array) -> Array:
    """Return right-handed axes whose z is `axis`, as columns; those of the link in another order where that can be."""
    first = np.eye(3)[(int(np.argmax(np.abs(axis))) + 1) % 3]
    y = np.cross(axis, first)
    y /= np.linalg.norm(y)
    return exact(np.column_stack([np.cross(y, axis), y, axis]))


def exact(rotation: Array) -> Array:
    """Return a rotation with its right angles exact."""
    nearest = np.round(rotation)
    return np.where(np.abs(rotation - nearest) < ROUNDED, nearest, rotation)
