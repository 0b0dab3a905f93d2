"""What users ask for and passivity does not allow for nothing: the actions that the tank's valve gates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import casadi as cs

from passiflex.control.law import AbstractLaw, Gains, Stored
from passiflex.control.null_space import inverse_cartesian_inertia
from passiflex.control.signals import Measurement
from passiflex.layout import Field, Layout
from passiflex.robots.linear_algebra import solve_spd

if TYPE_CHECKING:
    from passiflex.sampled.period import Granted
    from passiflex.sampled.signals import ControlParameters, Setpoint

FARTHEST = 1.0
"""Most that the error of the end effector is taken to have moved the joints [rad], near a singular posture too."""


class ActionNumbers(Protocol):
    """The numbers of the actions in symbols, as `action_layout` says."""

    posture_stiffness: cs.SX
    posture_damping: cs.SX
    posture: cs.SX
    follow_velocity: cs.SX
    follow_acceleration: cs.SX
    coulomb_compensation: cs.SX
    viscous_compensation: cs.SX
    compensation_width: cs.SX


def action_layout(n: int) -> Layout:
    """Return the parameters; a zero switches an action off."""
    return Layout(
        (
            Field("posture_stiffness", (n,), "N m/rad", "K_n of the spring in the null space"),
            Field("posture_damping", (n,), "N m s/rad", "of the same motion"),
            Field("posture", (n,), "rad", "where that spring pulls the shaped motors to"),
            Field("follow_velocity", (), "1", "share of D_x ẋ_d that is fed forward"),
            Field("follow_acceleration", (), "1", "share of Λ ẍ_d that is fed forward"),
            Field("coulomb_compensation", (n,), "N m", "dry friction that is made up for"),
            Field("viscous_compensation", (n,), "N m s/rad", "viscous friction that is made up for"),
            Field("compensation_width", (), "rad/s", "speed at which half of the first is made up for"),
        ),
        ActionNumbers,
    )


def posture_spring(
    inertia: cs.SX,
    jacobian: cs.SX,
    error: cs.SX,
    phi: cs.SX,
    dphi: cs.SX,
    regularisation: cs.SX,
    a: ActionNumbers,
) -> cs.SX:
    """Return N [K_n (φ_n − φ + J̄ e) − D_n Nᵀ φ̇] [N m], N = I − Jᵀ J̄ᵀ: toward a posture, no wrench at the end effector.

    J̄ = M̃⁻¹ Jᵀ (J M̃⁻¹ Jᵀ + ε I)⁻¹, with the inertia M̃ that moves and J at φ, hides it from the end effector:
    J̄ᵀ N = 0. As N keeps what acts along a self-motion z, it rests where zᵀ K_n (φ_n − φ) = 0 for all of them: at the
    point of the self-motion nearest to the posture in the metric of K_n; and along the self-motion it gives exactly
    what ½ (φ_n − φ)ᵀ K_n (φ_n − φ) loses.

    φ − J̄ e is where the joints would be with the end effector on its reference, to first order in its error
    e = x − x_d. So a motion of the end effector does not stretch this spring: its stiffness N K_n Nᵀ is symmetric
    and ≥ 0, where that of N K_n (φ_n − φ) is not, and flutters at a few N m/rad. N moves with the arm all the same,
    so that this spring is not conservative: it can give energy on a closed path.
    """
    mobility = inverse_cartesian_inertia(inertia, jacobian, regularisation)

    def joints(task_motion: cs.SX) -> cs.SX:
        """Return J̄ times a motion of the end effector."""
        return solve_spd(inertia, jacobian.T @ solve_spd(mobility, task_motion))

    moved = joints(error)
    moved /= cs.sqrt(1 + cs.sumsqr(moved) / FARTHEST**2)
    pull = a.posture_stiffness * (a.posture - phi + moved)
    pull -= a.posture_damping * (dphi - joints(jacobian @ dphi))
    return pull - jacobian.T @ solve_spd(mobility, jacobian @ solve_spd(inertia, pull))


def tracking_wrench(
    mass_matrix: cs.SX,
    jacobian: cs.SX,
    damping: cs.SX,
    velocity: cs.SX,
    acceleration: cs.SX,
    regularisation: cs.SX,
    a: ActionNumbers,
) -> cs.SX:
    """Return D_x ẋ_d + Λ ẍ_d, each by its share: with it the end effector does not lag a moving reference."""
    mobility = inverse_cartesian_inertia(mass_matrix, jacobian, regularisation)
    return a.follow_velocity * (damping @ velocity) + a.follow_acceleration * solve_spd(
        mobility, acceleration
    )


def friction_compensation(dtheta: cs.SX, a: ActionNumbers) -> cs.SX:
    """Return c θ̇|θ̇| / (θ̇² + w²) + v θ̇ [N m], on the motors: what friction of that size takes, if they move.

    It gives power, always. Where friction takes less, what is left makes the motor move on by itself. At rest the
    first part has no slope: one as of c tanh(θ̇/w) would be a negative damping of c/w on a motor that sticks.
    """
    dry = a.coulomb_compensation * dtheta * cs.fabs(dtheta) / (dtheta**2 + a.compensation_width**2)
    return dry + a.viscous_compensation * dtheta


def gated_torque(
    law: AbstractLaw,
    y: Measurement,
    now: Stored,
    setpoint: Setpoint,
    granted: Granted,
    g: Gains,
    p: ControlParameters,
) -> cs.SX:
    """Return the torque on the shaped motors of what only the tank's valve lets through (n,) N m."""
    arm, rows = law.robot.arm, slice(0, law.task.size)
    S, held, a = law.task.basis(granted.pose), list(law.task.held), p.actions
    M, J = arm.mass_matrix(y.q, p.model), S.T @ arm.jacobian(y.q, p.model)[rows, :]
    velocity, acceleration = S.T @ setpoint.velocity[rows], S.T @ setpoint.acceleration[rows]
    follow = granted.pose_share * tracking_wrench(
        M, J, g.damping[held, held], velocity, acceleration, g.regularisation, a
    )
    at_end = arm.jacobian(now.phi, p.model)
    J_held = S.T @ at_end[rows, :]
    moving = M + cs.diag(law.motors(p.model, g))
    error = S.T @ law.task.error(now.pose, granted.pose)
    posture = posture_spring(moving, J_held, error, now.phi, now.dphi, g.regularisation, a)
    return at_end.T @ setpoint.wrench + J_held.T @ follow + posture
