"""The recursions of Newton and Euler and of composite bodies, in frames whose z axis is that of their joint.

Everything is expressed in the frame of a joint, at its origin: there, a turn about the joint mixes two coordinates
only, a right angle of the robot's geometry costs nothing, and forces and inertias need no shift to a centre of mass.
Inertias are (m, m c, I about the joint's origin), in which all forces are linear; Featherstone, *Rigid Body Dynamics
Algorithms* (2008), has both recursions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.robots.bodies import rotation_of
from passiflex.robots.chain import SerialChain

Array = NDArray[np.float64]
Vector = list[cs.SX]
"""Three numbers, each a scalar expression."""

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
        return Inertia(self.mass, _times(axes, self.moment), _congruent(axes, self.tensor))


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
                o + z * q for o, z in zip(_constants(self.origin), _constants(self.axes[:, 2]), strict=True)
            ]
            return Moved(origin, self.axes, None)
        return Moved(_constants(self.origin), self.axes, (cs.cos(q), cs.sin(q)))


class Moved(NamedTuple):
    """A frame in the one before it: at `origin`, with axes C Rz(q); `turn` is cos q and sin q, None without a turn."""

    origin: Vector
    axes: Array
    turn: tuple[cs.SX, cs.SX] | None

    def inward(self, v: Vector) -> Vector:
        """Return a vector of the frame before in the axes of this one."""
        x, y, z = _times(self.axes.T, v)
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
        return _times(self.axes, [x, y, z])

    def wrench_outward(self, w: Wrench) -> Wrench:
        """Return a wrench at this frame as one at the frame before."""
        force = self.outward(w.force)
        return Wrench(force, _sum(self.outward(w.moment), _cross(self.origin, force)))

    def inertia_outward(self, body: Inertia) -> Inertia:
        """Return an inertia about this frame as one about the frame before."""
        m, h, r = body.mass, self.outward(body.moment), self.origin
        tensor = _congruent(self.axes, self._turned(body.tensor))
        # about r: I − [r]×[h]× − [h]×[r]× − m [r]×[r]×, and with k = h + m r / 2 the last three are one
        k = [a + m * b / 2 for a, b in zip(h, r, strict=True)]
        xx, yy, zz = (2 * a * b for a, b in zip(r, k, strict=True))
        shift = [
            yy + zz, -(r[0] * k[1] + r[1] * k[0]), -(r[0] * k[2] + r[2] * k[0]),
            xx + zz, -(r[1] * k[2] + r[2] * k[1]), xx + yy,
        ]  # fmt: skip
        return Inertia(m, [a + m * b for a, b in zip(h, r, strict=True)], _sum(tensor, shift))

    def _turned(self, tensor: Vector) -> Vector:
        """Return Rz I Rzᵀ."""
        if self.turn is None:
            return tensor
        c, s = self.turn
        xx, xy, xz, yy, yz, zz = tensor
        a, b = c * xx - s * xy, c * xy - s * yy
        first = a * c - b * s
        return [first, a * s + b * c, c * xz - s * yz, xx + yy - first, s * xz + c * yz, zz]


class Placed(NamedTuple):
    """A frame in world axes: its origin [m], and its axes x, y, z."""

    origin: Vector
    axes: list[Vector]


@dataclass(frozen=True, eq=False)
class Recursions:
    """Dynamics of a chain as expressions of joint positions and of the inertias of its links."""

    chain: SerialChain

    def bodies(self, mass: cs.SX, moment: cs.SX, tensor: cs.SX) -> list[Inertia]:
        """Return the inertias of the links, given in link axes: (n,), (n, 3), (n, 6)."""
        return [
            Inertia(mass[i], _scalars(moment[i, :]), _scalars(tensor[i, :])).seen(joint.link)
            for i, joint in enumerate(self.joints)
        ]

    @cached_property
    def joints(self) -> tuple[JointFrame, ...]:
        """Return the frames of the joints."""
        out, before = [], np.eye(3)
        for joint in self.chain.joints:
            aligned = _aligned(joint.axis)
            axes = before @ rotation_of(joint.rpy) @ aligned
            out.append(
                JointFrame(
                    before @ joint.xyz, _exact(axes), _exact(aligned.T), slides=joint.kind == "prismatic"
                )
            )
            before = aligned.T
        return tuple(out)

    def newton_euler(
        self, bodies: Sequence[Inertia], q: cs.SX, dq: cs.SX, gravity: cs.SX, ddq: cs.SX | None = None
    ) -> cs.SX:
        """Return M q̈ + C q̇ + ∇V (n,) [N m], without the first part if no q̈ is given.

        Parameters
        ----------
        gravity: Acceleration of free fall, world axes (3,) [m/s²].
        """
        spin, turning, falling = _zero(), _zero(), [-g for g in cs.vertsplit(gravity)]
        wrenches, frames = [], self.moved(q)
        for i, (frame, body) in enumerate(zip(frames, bodies, strict=True)):
            rate, change = dq[i], cs.SX(0) if ddq is None else ddq[i]
            falling = _sum(falling, _through(_rates(spin, turning), frame.origin))
            spin, turning, falling = (frame.inward(v) for v in (spin, turning, falling))
            if self.joints[i].slides:
                falling = _sum(falling, [2 * spin[1] * rate, -2 * spin[0] * rate, change])
            else:
                turning = [turning[0] + spin[1] * rate, turning[1] - spin[0] * rate, turning[2] + change]
                spin = [spin[0], spin[1], spin[2] + rate]
            wrenches.append(_inertial(body, _rates(spin, turning), falling))
        torque, carried = [cs.SX(0)] * len(frames), Wrench(_zero(), _zero())
        for i in reversed(range(len(frames))):
            carried = Wrench(*(_sum(a, b) for a, b in zip(wrenches[i], carried, strict=True)))
            torque[i] = carried.force[2] if self.joints[i].slides else carried.moment[2]
            carried = frames[i].wrench_outward(carried)
        return cs.densify(cs.vertcat(*torque))

    def mass_matrix(self, bodies: Sequence[Inertia], q: cs.SX) -> cs.SX:
        """Return M(q) (n, n), symmetric to the last bit."""
        n, frames = len(bodies), self.moved(q)
        M, carried = cs.SX.zeros(n, n), None
        for i in reversed(range(n)):
            carried = bodies[i] if carried is None else _together(bodies[i], carried)
            wrench = _of_motion_along_z(carried, slides=self.joints[i].slides)
            for j in range(i, -1, -1):
                M[i, j] = M[j, i] = wrench.force[2] if self.joints[j].slides else wrench.moment[2]
                wrench = frames[j].wrench_outward(wrench) if j else wrench
            carried = frames[i].inertia_outward(carried) if i else carried
        return cs.densify(M)

    def kinetic_energy(self, bodies: Sequence[Inertia], q: cs.SX, dq: cs.SX) -> cs.SX:
        """Return ½ q̇ᵀ M(q) q̇ [J] from the velocity of each link: a quarter of what M takes."""
        spin, speed, energy = _zero(), _zero(), cs.SX(0)
        for i, (frame, body) in enumerate(zip(self.moved(q), bodies, strict=True)):
            speed = frame.inward(_sum(speed, _cross(spin, frame.origin)))
            spin = frame.inward(spin)
            driven = speed if self.joints[i].slides else spin
            driven[2] += dq[i]
            (x, y, z), (xx, xy, xz, yy, yz, zz) = spin, body.tensor
            energy += body.mass * _dot(speed, speed) / 2 + _dot(speed, _cross(spin, body.moment))
            energy += (x * x * xx + y * y * yy + z * z * zz) / 2 + x * y * xy + x * z * xz + y * z * yz
        return energy

    def potential_energy(self, bodies: Sequence[Inertia], q: cs.SX, gravity: cs.SX) -> cs.SX:
        """Return V(q) = −Σ mᵢ gᵀ rᵢ(q) [J], zero with all mass at the base's origin."""
        down, depth, energy = cs.vertsplit(gravity), cs.SX(0), cs.SX(0)  # gᵀ r of the frame's origin
        for frame, body in zip(self.moved(q), bodies, strict=True):
            depth += _dot(down, frame.origin)
            down = frame.inward(down)
            energy -= body.mass * depth + _dot(down, body.moment)
        return energy

    def placed(self, q: cs.SX) -> Iterator[Placed]:
        """Yield the frame of each joint, as it has moved, in world axes."""
        position, axes = _zero(), [[cs.SX(float(i == j)) for i in range(3)] for j in range(3)]
        for frame in self.moved(q):
            position = _sum(position, _combined(axes, frame.origin))
            axes = [_combined(axes, _constants(column)) for column in frame.axes.T]
            if frame.turn is not None:
                (c, s), (x, y, z) = frame.turn, axes
                axes = [
                    [c * a + s * b for a, b in zip(x, y, strict=True)],
                    [c * b - s * a for a, b in zip(x, y, strict=True)],
                    z,
                ]
            yield Placed(position, axes)

    def moved(self, q: cs.SX) -> list[Moved]:
        """Return the frame of each joint in that of the joint before it."""
        return [joint.moved(q[i]) for i, joint in enumerate(self.joints)]


def _inertial(body: Inertia, rates: list[Vector], falling: Vector) -> Wrench:
    """Return the wrench that moves a body: m a + U m c and what turns it, with U of `_rates` and a of its origin."""
    m, h, (xx, xy, xz, yy, yz, zz) = body
    force = [m * a + b for a, b in zip(falling, _through(rates, h), strict=True)]
    half = (xx + yy + zz) / 2
    second = [[half - xx, -xy, -xz], [-xy, half - yy, -yz], [-xz, -yz, half - zz]]  # ∫ d dᵀ dm
    moved = [_through(rates, row) for row in second]  # (U ∫ d dᵀ dm)ᵀ
    turned = [moved[1][2] - moved[2][1], moved[2][0] - moved[0][2], moved[0][1] - moved[1][0]]
    return Wrench(force, _sum(turned, _cross(h, falling)))


def _rates(spin: Vector, turning: Vector) -> list[Vector]:
    """Return the rows of [ω̇]× + [ω]×²: times d, it is the acceleration at d beyond that of the origin."""
    (x, y, z), (a, b, c) = spin, turning
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    return [[-(yy + zz), xy - c, xz + b], [xy + c, -(xx + zz), yz - a], [xz - b, yz + a, -(xx + yy)]]


def _of_motion_along_z(body: Inertia, *, slides: bool) -> Wrench:
    """Return the wrench that accelerates a body at rest by 1 along z, or about it."""
    x, y, _ = body.moment
    zero = cs.SX(0)
    if slides:
        return Wrench([zero, zero, body.mass], [y, -x, zero])
    return Wrench([-y, x, zero], [body.tensor[2], body.tensor[4], body.tensor[5]])


def _together(first: Inertia, second: Inertia) -> Inertia:
    return Inertia(
        first.mass + second.mass, _sum(first.moment, second.moment), _sum(first.tensor, second.tensor)
    )


def _aligned(axis: Array) -> Array:
    """Return right-handed axes whose z is `axis`, as columns; those of the link in another order where that can be."""
    first = np.eye(3)[(int(np.argmax(np.abs(axis))) + 1) % 3]
    y = np.cross(axis, first)
    y /= np.linalg.norm(y)
    return _exact(np.column_stack([np.cross(y, axis), y, axis]))


def _exact(rotation: Array) -> Array:
    nearest = np.round(rotation)
    return np.where(np.abs(rotation - nearest) < ROUNDED, nearest, rotation)


def _scalars(row: cs.SX) -> Vector:
    return cs.horzsplit(row)


def _constants(v: Array) -> Vector:
    return [cs.SX(float(x)) for x in v]


def _zero() -> Vector:
    return [cs.SX(0)] * 3


def _sum(a: Vector, b: Vector) -> Vector:
    return [x + y for x, y in zip(a, b, strict=True)]


def _cross(a: Vector, b: Vector) -> Vector:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _dot(a: Vector, b: Vector) -> cs.SX:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _combined(columns: Sequence[Vector], v: Vector) -> Vector:
    """Return the vector with the coordinates v along these axes."""
    return [sum((axis[i] * x for axis, x in zip(columns, v, strict=True)), cs.SX(0)) for i in range(3)]


def _through(rows: Sequence[Vector], v: Vector) -> Vector:
    return [_dot(row, v) for row in rows]


def _times(constant: Array, v: Vector) -> Vector:
    """Return a constant matrix times a vector; zeros and ones cost nothing."""
    return [sum((float(c) * x for c, x in zip(row, v, strict=True) if c), cs.SX(0)) for row in constant]


def _congruent(constant: Array, tensor: Vector) -> Vector:
    """Return C I Cᵀ."""
    xx, xy, xz, yy, yz, zz = tensor
    columns = [_times(constant, v) for v in ([xx, xy, xz], [xy, yy, yz], [xz, yz, zz])]  # of C I
    rows = [_times(constant, [column[i] for column in columns]) for i in range(3)]
    return [rows[0][0], rows[0][1], rows[0][2], rows[1][1], rows[1][2], rows[2][2]]
