"""What is recorded of a law, by its own claims: the same in continuous time and period by period."""

from __future__ import annotations

import casadi as cs

from passiflex.control.signals import Command
from passiflex.layout import Field, Signal
from passiflex.robots.flexible import FlexibleJointRobot


def shaped_motion(robot: FlexibleJointRobot, command: Command) -> tuple[Signal, ...]:
    """Return the coordinate of the shaped motors and its velocity."""
    n, (angle, speed, _) = robot.n, robot.arm.chain.joint_units
    return (
        Signal(Field("phi", (n,), angle, "shaped motor coordinate of (11)"), command.phi),
        Signal(Field("dphi", (n,), speed, "its velocity"), command.dphi),
    )


def outer_torque(robot: FlexibleJointRobot, command: Command) -> Signal:
    """Return the torque of the outer loop."""
    return Signal(
        Field("tau_u", (robot.n,), robot.arm.chain.joint_units[2], "outer-loop torque"), command.tau_u
    )


def claimed_energies(command: Command, carried: cs.SX, reference: str) -> tuple[Signal, ...]:
    """Return what a law claims to store; `carried` is V̂(q), `reference` the symbol of the one in force."""
    claim = command.energy
    claims = {
        "compensated_energy": ("V̂(q) of the law's model", carried),
        "shaped_kinetic_energy": ("½ φ̇ᵀ B_e φ̇", claim.motor_kinetic),
        "shaped_spring_energy": ("½ (φ−q)ᵀ K_e (φ−q)", claim.joint_spring),
        "cartesian_spring_energy": (f"U(φ; {reference})", claim.cartesian_spring),
        "gravity_storage": ("of the gravity compensation", claim.gravity_storage),
    }
    return tuple(
        Signal(Field(name, (), "J", f"{what}, claimed by the law"), value)
        for name, (what, value) in claims.items()
    )
