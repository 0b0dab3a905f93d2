"""The baseline [23]: impedance control of a rigid robot by exact cancellation of its dynamics."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, final

import casadi as cs
from numpy.typing import ArrayLike

from passiflex.control.gravity import AbstractGravity, RobotGravity
from passiflex.control.law import AbstractLaw, Array, Gains
from passiflex.control.null_space import inverse_cartesian_inertia, null_space_contribution
from passiflex.control.signals import Command, LawEnergy, Measurement, Reference, Stored
from passiflex.control.task import AbstractTask, PoseTask
from passiflex.layout import Field, Layout
from passiflex.robots.arm import SerialArm
from passiflex.robots.flexible import FlexibleJointRobot, RobotNumbers
from passiflex.robots.linear_algebra import solve_spd

SHAPED = "inertia shaped by the law"
"""What it does that no storage of its own accounts for."""


class RigidGains(Gains, Protocol):
    """The gains of the rigid law, as its `layout` says."""

    target_inertia: cs.SX
    null_space_damping: cs.SX
    carried_inertia: cs.SX


@final
@dataclass(frozen=True, eq=False)
class RigidImpedanceLaw(AbstractLaw):
    """The rigid baseline (theory note 2.9), read at and sent to the motors as if the joints were rigid.

        τ_m = M J̄ (M_x⁻¹ (F_e − D_x ẋ − ∂U/∂x) − J̇ q̇) + C q̇ + ∇V − Jᵀ F_e − (I − Jᵀ J̄ᵀ) k_ns M q̇

    A rigid robot has one position, and a robot reads it at its motors: q means θ here. (Read at the
    links, the same law is unstable on the iiwa already at rest: poles 0.25 ± 77j 1/s with the link
    inertia, 1.5 ± 77j 1/s with the motor inertia in it.) M is the link inertia plus `carried_inertia`:
    zero gives the baseline as published, the motor inertia B the variant that knows its motors. It has
    no tank: whoever moves the reference pays. As it shapes nothing, what its motors store is that of
    the real joint (φ = θ, K_e = K, B_e = B).
    """

    robot: FlexibleJointRobot
    task: AbstractTask = PoseTask()
    gravity: AbstractGravity = RobotGravity()
    has_tank = False
    shapes = False
    unbooked = SHAPED

    @property
    def structure(self) -> Hashable:
        """Return the choices."""
        return type(self), self.task, self.gravity

    @cached_property
    def layout(self) -> Layout:
        """Return the gains of the law."""
        k = self.task.size
        return Layout(
            (
                Field("target_inertia", (k, k), "kg, kg m, kg m^2", "M_x"),
                Field("stiffness", (k, k), "N/m, N, N m/rad", "K_x"),
                Field("damping", (k, k), "N s/m, N s, N m s/rad", "D_x"),
                Field("null_space_damping", (), "1/s", "k_ns"),
                Field("regularisation", (), "1/kg", "ε of Λ = (J M⁻¹ Jᵀ + ε I)⁻¹"),
                Field("carried_inertia", (self.robot.n,), "kg m^2", "motor inertia that the law knows of"),
            ),
            RigidGains,
        )

    def stored(self, y: Measurement, m: RobotNumbers, g: RigidGains) -> Stored:
        """Return the real motors as they are measured, with what they and the real joints store."""
        arm, q, dq = self.robot.arm, y.theta, y.dtheta
        motors, springs = _joint_energies(y, m)
        return Stored(q, dq, arm.pose(q, m), motors, springs, -arm.potential_energy(q, m))

    def posture_at_rest(self, q: Array, theta: Array, K: Array, gains: Mapping[str, ArrayLike]) -> Array:
        """Return θ: the law takes the motors for the links."""
        return theta

    def motors(self, m: RobotNumbers, g: RigidGains) -> cs.SX:
        """Return B, whether the law knows of it or not."""
        return m.motor_inertia

    def command(
        self,
        y: Measurement,
        reference: Reference,
        m: RobotNumbers,
        g: RigidGains,
        added: cs.SX | float = 0.0,
    ) -> Command:
        """Return the torque of the rigid law, with U and its damping as the claimed energies."""
        arm, rows = self.robot.arm, slice(0, self.task.size)
        q, dq = y.theta, y.dtheta
        M = arm.mass_matrix(q, m) + cs.diag(g.carried_inertia)
        J_full = arm.jacobian(q, m)
        J = J_full[rows, :]
        dx = J @ dq
        bias = _task_bias(arm, rows, q, dq, m)  # J̇ q̇
        spring = self.task.spring(arm.pose(q, m), reference.pose, g.stiffness)
        mobility = inverse_cartesian_inertia(M, J, g.regularisation)

        wanted = solve_spd(g.target_inertia, y.F_e[rows] - g.damping @ dx - spring.gradient[rows]) - bias
        null = null_space_contribution(M, J, g.null_space_damping, dq, g.regularisation)
        tau_m = (
            J.T @ solve_spd(mobility, wanted)
            + arm.bias_torque(q, dq, m)
            - J_full.T @ y.F_e
            + null.torque
            + added
        )

        stretch = dq - y.dq
        motors, springs = _joint_energies(y, m)
        energy = LawEnergy(
            motor_kinetic=motors,
            joint_spring=springs,
            cartesian_spring=spring.potential,
            gravity_storage=-arm.potential_energy(q, m),
            joint_damping=cs.dot(stretch, m.joint_damping * stretch),
            cartesian_damping=cs.dot(dx, g.damping @ dx),
            null_space_damping=null.dissipation,
            reference_power=cs.dot(spring.reference_gradient, reference.velocity),
        )
        return Command(tau_m, tau_m, q, dq, energy)


def _joint_energies(y: Measurement, m: RobotNumbers) -> tuple[cs.SX, cs.SX]:
    """Return ½ θ̇ᵀ B θ̇ and ½ (θ − q)ᵀ K (θ − q) [J]."""
    stretch = y.theta - y.q
    return cs.dot(y.dtheta, m.motor_inertia * y.dtheta) / 2, cs.dot(stretch, m.joint_stiffness * stretch) / 2


def _task_bias(arm: SerialArm, rows: slice, q: cs.SX, dq: cs.SX, m: RobotNumbers) -> cs.SX:
    """Return J̇ q̇ (k,), also where q and q̇ are expressions."""
    angle, rate = cs.SX.sym("q", arm.n), cs.SX.sym("dq", arm.n)
    free = cs.symvar(cs.vertcat(*(cs.vec(v) for v in vars(m).values())))
    J = arm.jacobian(angle, m)[rows, :]
    f = cs.Function("bias", [angle, rate, *free], [cs.jtimes(J @ rate, angle, rate)], {"cse": True})
    return f(q, dq, *free)
