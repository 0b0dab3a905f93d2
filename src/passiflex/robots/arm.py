"""Rigid-body expressions of a serial arm, with every physical parameter symbolic.

The recursions are adam's; this module gives them exact right angles, the inertial parameters as
symbols, and the end-effector offset as a run-time input.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import NamedTuple

import casadi as cs
import numpy as np
from adam.casadi.casadi_like import CasadiLike, SpatialMath
from adam.core import RBDAlgorithms
from adam.model import Inertia, Inertial, Model, Pose
from adam.model.std_factories.std_joint import StdJoint
from adam.model.std_factories.std_model import URDFModelFactory

from passiflex.layout import Field, Layout
from passiflex.robots.chain import SerialChain


class EndEffectorPose(NamedTuple):
    """An element of SE(3) in world axes: position [m] (3×1) and rotation matrix (3×3)."""

    position: cs.SX
    rotation: cs.SX


class _ExactMath(SpatialMath):
    """adam's spatial algebra with cos(π/2) = 0: half the operations, and exact for right angles."""

    def R_from_RPY(self, rpy: CasadiLike) -> CasadiLike:  # noqa: N802 (adam's name)
        rotation = super().R_from_RPY(rpy).array
        if not rotation.is_constant():
            return CasadiLike(rotation)
        entries = np.array(cs.DM(rotation))
        nearest = np.round(entries)
        exact = np.where(np.abs(entries - nearest) < 1e-15, nearest, entries)
        return CasadiLike(cs.SX(cs.sparsify(cs.DM(exact))))

    def H_prismatic_joint(  # noqa: N802
        self, xyz: CasadiLike, rpy: CasadiLike, axis: CasadiLike, q: CasadiLike
    ) -> CasadiLike:
        """Return the frame moved by q along the axis; adam 0.5 forgets that the origin's rpy turns the axis."""
        rotation = self.R_from_RPY(rpy)
        return self.homogeneous(rotation, CasadiLike(xyz.array + rotation.array @ (q.array * axis.array)))


class _ExactJoint(StdJoint):
    """adam's joint, with the motion of a prismatic one along its own axis (adam 0.5 gives 12 rows)."""

    def motion_subspace(self) -> CasadiLike:
        if self.type != "prismatic":
            return super().motion_subspace()
        zero = self.math.zeros(1)
        return self.math.vertcat(self.axis[0], self.axis[1], self.axis[2], zero, zero, zero)


class _ExactFactory(URDFModelFactory):
    def build_joint(self, joint: object) -> StdJoint:
        return _ExactJoint(joint, self.math)


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
                Field("link_com", (n, 3), "m", "centre of mass in the link frame"),
                Field(
                    "link_inertia",
                    (n, 6),
                    "kg m^2",
                    "Ixx Ixy Ixz Iyy Iyz Izz at the centre of mass, link axes",
                ),
                Field("gravity", (3,), "m/s^2", "gravitational acceleration in world axes"),
                Field("tool_position", (3,), "m", "end effector in the frame of the last link"),
                Field("tool_rotation", (3, 3), "1", "axes of the end effector in the frame of the last link"),
            )
        )

    def nominal(self, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)) -> dict[str, np.ndarray]:
        """Return the numbers of the URDF for `layout`."""
        bodies = self.chain.bodies
        return {
            "link_mass": np.array([b.mass for b in bodies]),
            "link_com": np.array([b.com for b in bodies]),
            "link_inertia": np.array([b.inertia for b in bodies]),
            "gravity": np.array(gravity),
            "tool_position": np.array(self.chain.tip_xyz, dtype=float),
            "tool_rotation": np.array(self.chain.tip_rotation, dtype=float),
        }

    def _algorithms(self, m: SimpleNamespace) -> RBDAlgorithms:
        math = _ExactMath()
        names = [f"joint_{i + 1}" for i in range(self.n)]
        model = Model.build(_ExactFactory(self.chain.to_urdf(), math), names)
        for i in range(self.n):
            ixx, ixy, ixz, iyy, iyz, izz = cs.vertsplit(m.link_inertia[i, :].T)
            model.links[f"link_{i + 1}"].inertial = Inertial(
                mass=math.asarray(m.link_mass[i]),
                inertia=Inertia.build(ixx, ixy, ixz, iyy, iyz, izz, math),
                origin=Pose(CasadiLike(m.link_com[i, :].T), math.asarray([0.0, 0.0, 0.0])),
            )
        return RBDAlgorithms(model, math)

    def mass_matrix(self, q: cs.SX, m: SimpleNamespace) -> cs.SX:
        """Return M(q) (n, n) kg m², link side only."""
        M, _ = self._algorithms(m).crba(cs.SX.eye(4), q)
        return cs.densify(M.array[6:, 6:])

    def bias_torque(self, q: cs.SX, dq: cs.SX, m: SimpleNamespace) -> cs.SX:
        """Return C(q, q̇) q̇ + ∇V(q) (n,) N m: what keeps the arm at constant velocity."""
        gravity = cs.vertcat(m.gravity, cs.SX.zeros(3))
        bias = self._algorithms(m).rnea(cs.SX.eye(4), q, cs.SX.zeros(6), dq, gravity)
        return cs.densify(bias.array[6:])

    def coriolis_torque(self, q: cs.SX, dq: cs.SX, m: SimpleNamespace) -> cs.SX:
        """Return C(q, q̇) q̇ (n,) N m."""
        weightless = SimpleNamespace(**(vars(m) | {"gravity": cs.SX.zeros(3)}))
        return self.bias_torque(q, dq, weightless)

    def gravity_torque(self, q: cs.SX, m: SimpleNamespace) -> cs.SX:
        """Return ∇V(q) (n,) N m."""
        return self.bias_torque(q, cs.SX.zeros(self.n), m)

    def _steps(self, q: cs.SX, m: SimpleNamespace) -> list[cs.SX]:
        """Return the frame of each link in that of the link before it, as a 4×4 matrix."""
        adam = self._algorithms(m)
        joints = adam.model.get_joints_chain(adam.root_link, f"link_{self.n}")
        return [joint.homogeneous(CasadiLike(q[joint.idx])).array for joint in joints]

    def kinetic_energy(self, q: cs.SX, dq: cs.SX, m: SimpleNamespace) -> cs.SX:
        """Return ½ q̇ᵀ M(q) q̇ [J], from the velocity of each link in its own axes: a quarter of what M takes."""
        spin, speed, energy = cs.SX.zeros(3), cs.SX.zeros(3), cs.SX(0)
        for i, (joint, step) in enumerate(zip(self.chain.joints, self._steps(q, m), strict=True)):
            turn, own = step[:3, :3].T, cs.sparsify(cs.DM(joint.axis)) * dq[i]
            speed = turn @ (speed + cs.cross(spin, step[:3, 3]))
            spin = turn @ spin
            if joint.kind == "prismatic":
                speed += own
            else:
                spin += own
            at_com = speed + cs.cross(spin, m.link_com[i, :].T)
            x, y, z = cs.vertsplit(spin)
            products = cs.vertcat(x * x, 2 * x * y, 2 * x * z, y * y, 2 * y * z, z * z)
            energy += m.link_mass[i] * cs.dot(at_com, at_com) + cs.dot(m.link_inertia[i, :].T, products)
        return energy / 2

    def potential_energy(self, q: cs.SX, m: SimpleNamespace) -> cs.SX:
        """Return V(q) = −Σ mᵢ gᵀ rᵢ(q) [J], zero with all mass at the base's origin; g in the axes of each link."""
        gravity, origin, energy = m.gravity, cs.SX(0), cs.SX(0)  # origin: gᵀ times that of the link's frame
        for i, step in enumerate(self._steps(q, m)):
            origin += cs.dot(gravity, step[:3, 3])
            gravity = step[:3, :3].T @ gravity
            energy -= m.link_mass[i] * (origin + cs.dot(gravity, m.link_com[i, :].T))
        return energy

    def pose(self, q: cs.SX, m: SimpleNamespace) -> EndEffectorPose:
        """Return x = f(q), the end-effector frame in world axes."""
        frame = self._algorithms(m).forward_kinematics(f"link_{self.n}", cs.SX.eye(4), q).array
        rotation = frame[:3, :3]
        return EndEffectorPose(frame[:3, 3] + rotation @ m.tool_position, rotation @ m.tool_rotation)

    def jacobian(self, q: cs.SX, m: SimpleNamespace) -> cs.SX:
        """Return J(q) (6×n): linear, then angular velocity at the end-effector point, world axes."""
        adam = self._algorithms(m)
        tip = self.pose(q, m).position
        columns = []
        for i, joint in enumerate(self.chain.joints):
            frame = adam.forward_kinematics(f"link_{i + 1}", cs.SX.eye(4), q).array
            axis = frame[:3, :3] @ cs.sparsify(cs.DM(joint.axis))
            if joint.kind == "prismatic":
                columns.append(cs.vertcat(axis, cs.SX.zeros(3)))
            else:
                columns.append(cs.vertcat(cs.cross(axis, tip - frame[:3, 3]), axis))
        return cs.densify(cs.horzcat(*columns))

    def coriolis_matrix(self, q: cs.SX, dq: cs.SX, m: SimpleNamespace) -> cs.SX:
        """Return the C(q, q̇) of the Christoffel symbols, for which ∂M/∂t = C + Cᵀ.

        Built by differentiation of M: for analysis and tests, not for control.
        """
        mass_matrix = self.mass_matrix(q, m)
        slopes = [cs.reshape(cs.jacobian(cs.vec(mass_matrix), q[k]), self.n, self.n) for k in range(self.n)]
        along = sum(slopes[k] * dq[k] for k in range(self.n))
        across = cs.horzcat(*(slope @ dq for slope in slopes))  # ∂(M q̇)/∂q
        return (along + across - across.T) / 2
