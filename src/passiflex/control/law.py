"""The proposed law: inner loop (5), impedance (12), gravity and null space (32), as one pure function."""

from __future__ import annotations

import abc
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Protocol, final

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.control.gravity import AbstractGravity, RobotGravity
from passiflex.control.inner_loop import motor_torque, shaped_damping, shaped_motion
from passiflex.control.null_space import null_space_contribution, null_space_damping
from passiflex.control.signals import Command, LawEnergy, Measurement, Reference, Stored
from passiflex.control.task import AbstractTask, PoseTask
from passiflex.layout import Field, Layout
from passiflex.robots.arm import EndEffectorPose
from passiflex.robots.flexible import FlexibleJointRobot, RobotNumbers
from passiflex.robots.linear_algebra import gram, solve_spd

Array = NDArray[np.float64]


class Gains(Protocol):
    """What loops ask of the gains of every law, in symbols; a sampled one sets stiffness and damping every period."""

    stiffness: cs.SX
    damping: cs.SX
    regularisation: cs.SX


class ImpedanceGains(Gains, Protocol):
    """The gains of the paper's law, as `ImpedanceLaw.layout` says."""

    shaped_stiffness: cs.SX
    shaped_inertia: cs.SX
    null_space_damping: cs.SX


class OuterLoop(NamedTuple):
    """The outer loop at φ, with its damping still to be multiplied by φ̇.

    Attributes
    ----------
    torque: −J(φ)ᵀ ∂U/∂x + τ_g, (n,) N m.
    damping: J(φ)ᵀ D_x J(φ) + D_ns, (n, n) N m s/rad.
    cartesian_damping: Its first part.
    """

    torque: cs.SX
    damping: cs.SX
    cartesian_damping: cs.SX


class AbstractLaw(abc.ABC):
    """A control law: a pure function of measurement, reference, the robot's model and gains.

    It holds structure only (which robot, which task, which gravity choice). The numbers, of the model
    (`robot.layout`) and of the gains (`layout`), are run-time inputs.
    """

    robot: FlexibleJointRobot
    task: AbstractTask
    gravity: AbstractGravity
    has_tank: bool
    shapes: bool
    """Whether it gives the joints another stiffness and the motors another inertia."""
    unbooked: str = ""
    """What its books miss by its kind, in words."""

    @property
    def structure(self) -> Hashable:
        """Return what its expressions depend on beside the robot: laws that agree in it share compiled code."""
        return self

    @property
    @abc.abstractmethod
    def layout(self) -> Layout:
        """Return the gains."""

    @abc.abstractmethod
    def command(
        self,
        y: Measurement,
        reference: Reference,
        m: RobotNumbers,
        g: Any,
        added: cs.SX | float = 0.0,
    ) -> Command:
        """Return the motor torque and the energy that the law claims, for the model m and gains g.

        `added` is a torque on the shaped motors from outside the law (n,) N m, which it does not account for.
        """

    @abc.abstractmethod
    def stored(self, y: Measurement, m: RobotNumbers, g: Any) -> Stored:
        """Return the shaped motors and what they store beside the Cartesian spring."""

    def potential(self, at: Stored, reference: EndEffectorPose, stiffness: cs.SX) -> cs.SX:
        """Return what its Cartesian spring stores [J]: that of the task unless a law has another."""
        return self.task.potential(at.pose, reference, stiffness)

    @abc.abstractmethod
    def posture_at_rest(self, q: Array, theta: Array, K: Array, gains: Mapping[str, ArrayLike]) -> Array:
        """Return φ (n,) of a robot at rest, in numbers; the Cartesian spring is slack there."""

    @abc.abstractmethod
    def motors(self, m: RobotNumbers, g: Any) -> cs.SX:
        """Return the inertia (n,) with which the motors move, kg m²; with that of the links, what the task moves."""


@final
@dataclass(frozen=True, eq=False)
class ImpedanceLaw(AbstractLaw):
    """The paper's law: (5) with (12) and (32), and the storage (14).

        τ_u = −J(φ)ᵀ ∂U/∂x − J(φ)ᵀ D_x J(φ) φ̇ + τ_g − D_ns φ̇

    The spring's wrench is the true gradient of the potential; the damper uses the geometric Jacobian.
    """

    robot: FlexibleJointRobot
    task: AbstractTask = PoseTask()
    gravity: AbstractGravity = RobotGravity()
    has_tank = True
    shapes = True

    @property
    def structure(self) -> Hashable:
        """Return the choices."""
        return type(self), self.task, self.gravity

    @cached_property
    def layout(self) -> Layout:
        """Return the gains of the law."""
        n, k = self.robot.n, self.task.size
        return Layout(
            (
                Field("shaped_stiffness", (n,), "N m/rad", "K_e"),
                Field("shaped_inertia", (n,), "kg m^2", "B_e"),
                Field("stiffness", (k, k), "N/m, N, N m/rad", "K_x"),
                Field("damping", (k, k), "N s/m, N s, N m s/rad", "D_x"),
                Field("null_space_damping", (), "1/s", "k_ns"),
                Field("regularisation", (), "1/kg", "ε of Λ = (J M⁻¹ Jᵀ + ε I)⁻¹"),
            ),
            ImpedanceGains,
        )

    def stored(self, y: Measurement, m: RobotNumbers, g: ImpedanceGains) -> Stored:
        """Return φ, φ̇ of (11), f(φ), and (14) without links and Cartesian spring."""
        arm, K_e = self.robot.arm, g.shaped_stiffness
        phi, dphi = shaped_motion(y.q, y.theta, y.dq, y.dtheta, m.joint_stiffness, K_e)
        motors, springs = _shaped_energies(phi, dphi, y.q, g)
        weight = self.gravity.compensation(arm, phi, K_e, m).storage
        return Stored(phi, dphi, arm.pose(phi, m), motors, springs, weight)

    def posture_at_rest(self, q: Array, theta: Array, K: Array, gains: Mapping[str, ArrayLike]) -> Array:
        """Return φ of (11)."""
        return q + K / np.asarray(gains["shaped_stiffness"]) * (theta - q)

    def motors(self, m: RobotNumbers, g: ImpedanceGains) -> cs.SX:
        """Return B_e."""
        return g.shaped_inertia

    def outer(
        self, phi: cs.SX, q: cs.SX, reference: Reference, m: RobotNumbers, g: ImpedanceGains
    ) -> OuterLoop:
        """Return (12) and (32) with their damping as a matrix, for whoever holds it implicitly."""
        arm, rows = self.robot.arm, slice(0, self.task.size)
        J = arm.jacobian(phi, m)[rows, :]
        spring = self.task.spring(arm.pose(phi, m), reference.pose, g.stiffness)
        weight = self.gravity.compensation(arm, phi, g.shaped_stiffness, m)
        S, held = self.task.basis(reference.pose), list(self.task.held)
        J_q = S.T @ arm.jacobian(q, m)[rows, :]
        null = null_space_damping(arm.mass_matrix(q, m), J_q, g.null_space_damping, g.regularisation)
        cartesian = gram(S.T @ J, g.damping[held, held])
        return OuterLoop(weight.torque - J.T @ spring.gradient[rows], cartesian + null, cartesian)

    def command(
        self,
        y: Measurement,
        reference: Reference,
        m: RobotNumbers,
        g: ImpedanceGains,
        added: cs.SX | float = 0.0,
    ) -> Command:
        """Return τ_m of (5) and the energies of (14) and (36)."""
        arm, rows = self.robot.arm, slice(0, self.task.size)
        K, B, K_e, B_e = m.joint_stiffness, m.motor_inertia, g.shaped_stiffness, g.shaped_inertia
        D_e = shaped_damping(K, m.joint_damping, K_e)
        phi, dphi = shaped_motion(y.q, y.theta, y.dq, y.dtheta, K, K_e)  # (11)

        M = arm.mass_matrix(y.q, m)
        J_q = self.task.basis(reference.pose).T @ arm.jacobian(y.q, m)[rows, :]
        J = arm.jacobian(phi, m)[rows, :]
        impedance = self.task.impedance(arm.pose(phi, m), reference.pose, J, J @ dphi, g.stiffness, g.damping)
        spring_damper = impedance.contribution  # (12)
        weight = self.gravity.compensation(arm, phi, K_e, m)
        null = null_space_contribution(M, J_q, g.null_space_damping, dphi, g.regularisation)  # (32)
        tau_u = spring_damper.torque + weight.torque + null.torque + added

        expected = solve_spd(M, y.tau_a + y.tau_e - arm.bias_torque(y.q, y.dq, m))
        tau_m = motor_torque(expected, y.tau_a, tau_u, K, B, K_e, B_e)  # (5)
        stretch = dphi - y.dq
        motors, springs = _shaped_energies(phi, dphi, y.q, g)
        energy = LawEnergy(
            motor_kinetic=motors,
            joint_spring=springs,
            cartesian_spring=spring_damper.storage,
            gravity_storage=weight.storage,
            joint_damping=cs.dot(stretch, D_e * stretch),
            cartesian_damping=spring_damper.dissipation,
            null_space_damping=null.dissipation,
            reference_power=cs.dot(impedance.reference_gradient, reference.velocity),  # (21)
        )
        return Command(tau_m, tau_u, phi, dphi, energy)


def _shaped_energies(phi: cs.SX, dphi: cs.SX, q: cs.SX, g: ImpedanceGains) -> tuple[cs.SX, cs.SX]:
    """Return ½ φ̇ᵀ B_e φ̇ and ½ (φ − q)ᵀ K_e (φ − q) [J]."""
    stretch = phi - q
    return cs.dot(dphi, g.shaped_inertia * dphi) / 2, cs.dot(stretch, g.shaped_stiffness * stretch) / 2
