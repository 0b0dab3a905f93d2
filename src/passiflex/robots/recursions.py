"""The recursions of Newton and Euler and of composite bodies, each quantity in the frame of its joint.

Inertias are (m, m c, I about the joint's origin): forces are linear in them and need no shift to a centre of mass.
Featherstone, *Rigid Body Dynamics Algorithms* (2008), has both recursions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as cs
import numpy as np

from passiflex.robots.bodies import rotation_of
from passiflex.robots.chain import SerialChain
from passiflex.robots.joint_frames import Inertia, JointFrame, Moved, Wrench, aligned, exact
from passiflex.robots.vectors import Vector, combined, constants, cross, dot, plus, scalars, through, zero


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
            Inertia(mass[i], scalars(moment[i, :]), scalars(tensor[i, :])).seen(joint.link)
            for i, joint in enumerate(self.joints)
        ]

    @cached_property
    def joints(self) -> tuple[JointFrame, ...]:
        """Return the frames of the joints."""
        out, before = [], np.eye(3)
        for joint in self.chain.joints:
            own = aligned(joint.axis)
            axes = before @ rotation_of(joint.rpy) @ own
            out.append(
                JointFrame(before @ joint.xyz, exact(axes), exact(own.T), slides=joint.kind == "prismatic")
            )
            before = own.T
        return tuple(out)

    def newton_euler(
        self,
        bodies: Sequence[Inertia],
        q: cs.SX,
        dq: cs.SX,
        gravity: cs.SX,
        *,
        pushed: Wrench | None = None,
    ) -> cs.SX:
        """Return C q̇ + ∇V − τ_e (n,) [N m], with τ_e of what pushes the last link.

        Parameters
        ----------
        gravity: Acceleration of free fall, world axes (3,) [m/s²].
        pushed: On the last link from outside, at the origin of its joint and in the axes of that.
        """
        spin, turning, falling = zero(), zero(), [-g for g in cs.vertsplit(gravity)]
        wrenches, frames = [], self.moved(q)
        for i, (frame, body) in enumerate(zip(frames, bodies, strict=True)):
            rate = dq[i]
            falling = plus(falling, through(_rates(spin, turning), frame.origin))
            spin, turning, falling = (frame.inward(v) for v in (spin, turning, falling))
            if self.joints[i].slides:
                falling = plus(falling, [2 * spin[1] * rate, -2 * spin[0] * rate, cs.SX(0)])
            else:
                turning = [turning[0] + spin[1] * rate, turning[1] - spin[0] * rate, turning[2]]
                spin = [spin[0], spin[1], spin[2] + rate]
            wrenches.append(_inertial(body, _rates(spin, turning), falling))
        torque, carried = [cs.SX(0)] * len(frames), Wrench(zero(), zero())
        if pushed is not None:
            carried = Wrench([-f for f in pushed.force], [-m for m in pushed.moment])
        for i in reversed(range(len(frames))):
            carried = Wrench(*(plus(a, b) for a, b in zip(wrenches[i], carried, strict=True)))
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
        energy = cs.SX(0)
        for (speed, spin), body in zip(self.velocities(q, dq), bodies, strict=True):
            (x, y, z), (xx, xy, xz, yy, yz, zz) = spin, body.tensor
            energy += body.mass * dot(speed, speed) / 2 + dot(speed, cross(spin, body.moment))
            energy += (x * x * xx + y * y * yy + z * z * zz) / 2 + x * y * xy + x * z * xz + y * z * yz
        return energy

    def velocities(self, q: cs.SX, dq: cs.SX) -> Iterator[tuple[Vector, Vector]]:
        """Yield linear and angular velocity of each joint's frame as it has moved, at its origin and in its axes."""
        speed, spin = zero(), zero()
        for i, frame in enumerate(self.moved(q)):
            speed, spin = frame.inward(plus(speed, cross(spin, frame.origin))), frame.inward(spin)
            driven = speed if self.joints[i].slides else spin
            driven[2] += dq[i]
            yield speed, spin

    def inward(self, q: cs.SX, v: Vector) -> Vector:
        """Return a vector of world axes in the axes of the last joint."""
        for frame in self.moved(q):
            v = frame.inward(v)
        return v

    def outward(self, q: cs.SX, v: Vector) -> Vector:
        """Return a vector in the axes of the last joint in world axes."""
        for frame in reversed(self.moved(q)):
            v = frame.outward(v)
        return v

    def potential_energy(self, bodies: Sequence[Inertia], q: cs.SX, gravity: cs.SX) -> cs.SX:
        """Return V(q) = −Σ mᵢ gᵀ rᵢ(q) [J], zero with all mass at the base's origin."""
        down, depth, energy = cs.vertsplit(gravity), cs.SX(0), cs.SX(0)  # gᵀ r of the frame's origin
        for frame, body in zip(self.moved(q), bodies, strict=True):
            depth += dot(down, frame.origin)
            down = frame.inward(down)
            energy -= body.mass * depth + dot(down, body.moment)
        return energy

    def placed(self, q: cs.SX) -> Iterator[Placed]:
        """Yield the frame of each joint, as it has moved, in world axes."""
        position, axes = zero(), [[cs.SX(float(i == j)) for i in range(3)] for j in range(3)]
        for frame in self.moved(q):
            position = plus(position, combined(axes, frame.origin))
            axes = [combined(axes, constants(column)) for column in frame.axes.T]
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
    force = [m * a + b for a, b in zip(falling, through(rates, h), strict=True)]
    half = (xx + yy + zz) / 2
    second = [[half - xx, -xy, -xz], [-xy, half - yy, -yz], [-xz, -yz, half - zz]]  # ∫ d dᵀ dm
    moved = [through(rates, row) for row in second]  # (U ∫ d dᵀ dm)ᵀ
    turned = [moved[1][2] - moved[2][1], moved[2][0] - moved[0][2], moved[0][1] - moved[1][0]]
    return Wrench(force, plus(turned, cross(h, falling)))


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
        first.mass + second.mass, plus(first.moment, second.moment), plus(first.tensor, second.tensor)
    )
