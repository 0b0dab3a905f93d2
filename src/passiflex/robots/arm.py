"""Rigid-body expressions of a serial arm, with every physical parameter symbolic."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import casadi as cs
import numpy as np

from passiflex.layout import Field, Layout
from passiflex.robots.bodies import about_origin
from passiflex.robots.chain import SerialChain
from passiflex.robots.joint_frames import Inertia, Wrench
from passiflex.robots.recursions import Placed, Recursions
from passiflex.robots.vectors import cross, plus


class ArmNumbers(Protocol):
    """The physical parameters of a rigid arm in symbols, as `SerialArm.layout` says."""

    link_mass: cs.SX
    link_moment: cs.SX
    link_inertia: cs.SX
    gravity: cs.SX
    tool_position: cs.SX
    tool_rotation: cs.SX


class EndEffectorPose(NamedTuple):
    """An element of SE(3) in world axes: position [m] (3×1) and rotation matrix (3×3)."""

    position: cs.SX
    rotation: cs.SX


class TipVelocity(NamedTuple):
    """Velocity [m/s] and spin [rad/s] of the end effector, in the axes of the last joint, (3,) each."""

    velocity: cs.SX
    spin: cs.SX


class TipWrench(NamedTuple):
    """Force [N] and moment [N m] on the end effector, in the axes of the last joint, (3,) each."""

    force: cs.SX
    moment: cs.SX


@dataclass(frozen=True, eq=False)
class SerialArm:
    """A fixed-base serial arm as a family of CasADi expressions.

    Every method takes the joint position `q` (n×1) and a view `m` of `layout`: the inertial
    parameters, gravity and tool are inputs of the compiled code, so an uncertain arm or another
    tool needs no new build. Torques are in N m (N for a prismatic joint), world axes are the base's.
    """

    chain: SerialChain

    @property
    def n(self) -> int:
        """Return the number of joints."""
        return self.chain.n

    @cached_property
    def layout(self) -> Layout:
        """Return the physical parameters of the rigid arm."""
        n = self.n
        return Layout(
            (
                Field("link_mass", (n,), "kg", "mass of each link"),
                Field("link_moment", (n, 3), "kg m", "mass times centre of mass in the link frame"),
                Field(
                    "link_inertia",
                    (n, 6),
                    "kg m^2",
                    "Ixx Ixy Ixz Iyy Iyz Izz about the origin of the link frame, link axes",
                ),
                Field("gravity", (3,), "m/s^2", "gravitational acceleration in world axes"),
                Field("tool_position", (3,), "m", "end effector in the frame of the last link"),
                Field("tool_rotation", (3, 3), "1", "axes of the end effector in the frame of the last link"),
            ),
            ArmNumbers,
        )

    def nominal(self, gravity: tuple[float, float, float] | None = None) -> dict[str, np.ndarray]:
        """Return the numbers of the URDF for `layout`, with the gravity [m/s²] of its mount unless another is given."""
        bodies = self.chain.bodies
        gravity = self.chain.gravity if gravity is None else gravity
        return {
            "link_mass": np.array([b.mass for b in bodies]),
            "link_moment": np.array([b.mass * b.com for b in bodies]),
            "link_inertia": np.array([about_origin(b) for b in bodies]),
            "gravity": np.array(gravity),
            "tool_position": np.array(self.chain.tip_xyz, dtype=float),
            "tool_rotation": np.array(self.chain.tip_rotation, dtype=float),
        }

    @cached_property
    def _recursions(self) -> Recursions:
        return Recursions(self.chain)

    def _bodies(self, m: ArmNumbers) -> list[Inertia]:
        return self._recursions.bodies(m.link_mass, m.link_moment, m.link_inertia)

    def mass_matrix(self, q: cs.SX, m: ArmNumbers) -> cs.SX:
        """Return M(q) (n, n) kg m², link side only."""
        return self._recursions.mass_matrix(self._bodies(m), q)

    def bias_torque(self, q: cs.SX, dq: cs.SX, m: ArmNumbers, pushed: TipWrench | None = None) -> cs.SX:
        """Return C(q, q̇) q̇ + ∇V(q) (n,) N m: what keeps the arm at constant velocity.

        With a wrench that pushes the end effector it is less by Jᵀ F, at half of what J takes.
        """
        wrench = None
        if pushed is not None:
            force, point = cs.vertsplit(pushed.force), cs.vertsplit(self._tip(m))
            wrench = Wrench(force, plus(cs.vertsplit(pushed.moment), cross(point, force)))
        return self._recursions.newton_euler(self._bodies(m), q, dq, m.gravity, pushed=wrench)

    def tip_velocity(self, q: cs.SX, dq: cs.SX, m: ArmNumbers) -> TipVelocity:
        """Return how the end effector moves, in the axes of the last joint."""
        *_, (speed, spin) = self._recursions.velocities(q, dq)
        at_tip = plus(speed, cross(spin, cs.vertsplit(self._tip(m))))
        return TipVelocity(cs.vertcat(*at_tip), cs.vertcat(*spin))

    def in_tip_axes(self, q: cs.SX, v: cs.SX) -> cs.SX:
        """Return a vector of world axes in the axes of the last joint (3,)."""
        return cs.vertcat(*self._recursions.inward(q, cs.vertsplit(v)))

    def in_world_axes(self, q: cs.SX, v: cs.SX) -> cs.SX:
        """Return a vector in the axes of the last joint in world axes (3,)."""
        return cs.vertcat(*self._recursions.outward(q, cs.vertsplit(v)))

    def _tip(self, m: ArmNumbers) -> cs.SX:
        """Return the end effector in the frame of the last joint (3,) [m]."""
        return self._link @ m.tool_position

    @cached_property
    def _link(self) -> cs.SX:
        """Return the axes of the last link in those of its joint, as columns."""
        return cs.sparsify(cs.DM(self._recursions.joints[-1].link))

    def coriolis_torque(self, q: cs.SX, dq: cs.SX, m: ArmNumbers) -> cs.SX:
        """Return C(q, q̇) q̇ (n,) N m."""
        return self._recursions.newton_euler(self._bodies(m), q, dq, cs.SX(3, 1))

    def gravity_torque(self, q: cs.SX, m: ArmNumbers) -> cs.SX:
        """Return ∇V(q) (n,) N m."""
        return self._recursions.newton_euler(self._bodies(m), q, cs.SX(self.n, 1), m.gravity)

    def kinetic_energy(self, q: cs.SX, dq: cs.SX, m: ArmNumbers) -> cs.SX:
        """Return ½ q̇ᵀ M(q) q̇ [J]."""
        return self._recursions.kinetic_energy(self._bodies(m), q, dq)

    def potential_energy(self, q: cs.SX, m: ArmNumbers) -> cs.SX:
        """Return V(q) = −Σ mᵢ gᵀ rᵢ(q) [J], zero with all mass at the base's origin."""
        return self._recursions.potential_energy(self._bodies(m), q, m.gravity)

    def pose(self, q: cs.SX, m: ArmNumbers) -> EndEffectorPose:
        """Return x = f(q), the end-effector frame in world axes."""
        return self._pose(list(self._recursions.placed(q))[-1], m)

    def _pose(self, last: Placed, m: ArmNumbers) -> EndEffectorPose:
        """Return the end-effector frame from that of the last joint."""
        link = cs.horzcat(*(cs.vertcat(*axis) for axis in last.axes)) @ self._link
        return EndEffectorPose(cs.vertcat(*last.origin) + link @ m.tool_position, link @ m.tool_rotation)

    def jacobian(self, q: cs.SX, m: ArmNumbers) -> cs.SX:
        """Return J(q) (6×n): linear, then angular velocity at the end-effector point, world axes."""
        placed = list(self._recursions.placed(q))
        tip = self._pose(placed[-1], m).position
        columns = []
        for joint, frame in zip(self._recursions.joints, placed, strict=True):
            axis = cs.vertcat(*frame.axes[2])
            if joint.slides:
                columns.append(cs.vertcat(axis, cs.SX.zeros(3)))
            else:
                columns.append(cs.vertcat(cs.cross(axis, tip - cs.vertcat(*frame.origin)), axis))
        return cs.densify(cs.horzcat(*columns))

    def coriolis_matrix(self, q: cs.SX, dq: cs.SX, m: ArmNumbers) -> cs.SX:
        """Return the C(q, q̇) of the Christoffel symbols, for which ∂M/∂t = C + Cᵀ.

        Built by differentiation of M: for analysis and tests, not for control.
        """
        mass_matrix = self.mass_matrix(q, m)
        slopes = [cs.reshape(cs.jacobian(cs.vec(mass_matrix), q[k]), self.n, self.n) for k in range(self.n)]
        along = sum(slopes[k] * dq[k] for k in range(self.n))
        across = cs.horzcat(*(slope @ dq for slope in slopes))  # ∂(M q̇)/∂q
        return (along + across - across.T) / 2
