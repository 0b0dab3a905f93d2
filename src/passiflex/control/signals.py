"""What crosses the boundary of a control law: measurements and references in, torque and energy out."""

from __future__ import annotations

from typing import NamedTuple

import casadi as cs

from passiflex.robots.arm import EndEffectorPose


class Measurement(NamedTuple):
    """What the robot tells the law at one instant.

    Attributes
    ----------
    q, theta, dq, dtheta: Link and motor positions and velocities, (n,).
    tau_a: Torque through the joints, positive on the links, (n,) N m.
    F_e: Wrench on the end effector, world axes, linear part first, (6,) N and N m.
    tau_e: The same as joint torque, (n,) N m; by itself if it was observed and no wrench was measured.
    """

    q: cs.SX
    theta: cs.SX
    dq: cs.SX
    dtheta: cs.SX
    tau_a: cs.SX
    F_e: cs.SX
    tau_e: cs.SX


class Reference(NamedTuple):
    """Where the end effector should be.

    Attributes
    ----------
    pose: x_d, in world axes.
    velocity: ẋ_d, linear then angular, world axes, (6,) m/s and rad/s.
    """

    pose: EndEffectorPose
    velocity: cs.SX


class Contribution(NamedTuple):
    """What one element of a law gives to the shaped motors, and what it stores and dissipates by it.

    Attributes
    ----------
    torque: On the shaped motors, (n,) N m.
    storage: [J]; the torque's conservative part is its negative gradient in φ.
    dissipation: [W], ≥ 0: what the torque's other part takes out.
    """

    torque: cs.SX
    storage: cs.SX
    dissipation: cs.SX


class LawEnergy(NamedTuple):
    """What a law claims to store [J] and to dissipate [W]; the claims hold if its model is right.

    Attributes
    ----------
    motor_kinetic: ½ φ̇ᵀ B_e φ̇.
    joint_spring: ½ (φ − q)ᵀ K_e (φ − q).
    cartesian_spring: U(φ; x_d, K_x).
    gravity_storage: −V_γ(φ), −V(φ) or 0, by the choice of gravity compensation.
    joint_damping, cartesian_damping, null_space_damping: The three parts of P_D in (36), each ≥ 0.
    reference_power: P_X of (21), positive when the moving reference gives energy.
    """

    motor_kinetic: cs.SX
    joint_spring: cs.SX
    cartesian_spring: cs.SX
    gravity_storage: cs.SX
    joint_damping: cs.SX
    cartesian_damping: cs.SX
    null_space_damping: cs.SX
    reference_power: cs.SX

    @property
    def dissipated_power(self) -> cs.SX:
        """Return P_D of (20), with the null space (36) [W]."""
        return self.joint_damping + self.cartesian_damping + self.null_space_damping


class Stored(NamedTuple):
    """Where a law sees its shaped motors, and what it stores beside the Cartesian spring [J].

    Attributes
    ----------
    phi, dphi: Shaped motor coordinate of (11), (n,).
    pose: f(φ), where the Cartesian spring takes hold.
    motor_kinetic, joint_spring, gravity_storage: As in `LawEnergy`.
    """

    phi: cs.SX
    dphi: cs.SX
    pose: EndEffectorPose
    motor_kinetic: cs.SX
    joint_spring: cs.SX
    gravity_storage: cs.SX

    @property
    def energy(self) -> cs.SX:
        """Return ½ φ̇ᵀ B_e φ̇ + ½ (φ − q)ᵀ K_e (φ − q) − V_γ(φ) [J]."""
        return self.motor_kinetic + self.joint_spring + self.gravity_storage


class Command(NamedTuple):
    """What a law asks of the motors, and the energy it claims.

    Attributes
    ----------
    tau_m: Motor torque, (n,) N m.
    tau_u: Outer-loop torque on the shaped motor, (n,) N m.
    phi, dphi: Shaped motor coordinate of (11).
    energy: The law's storages and dissipations.
    """

    tau_m: cs.SX
    tau_u: cs.SX
    phi: cs.SX
    dphi: cs.SX
    energy: LawEnergy
