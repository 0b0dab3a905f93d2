"""What users ask for and passivity does not allow for nothing: the actions that the tank's valve gates."""

from __future__ import annotations

from types import SimpleNamespace

import casadi as cs

from passiflex.control.null_space import inverse_cartesian_inertia
from passiflex.layout import Field, Layout
from passiflex.robots.linear_algebra import solve_spd


def action_layout(n: int) -> Layout:
    """Return the parameters; a zero switches an action off."""
    return Layout(
        (
            Field("posture_stiffness", (n,), "N m/rad", "of the spring in the null space"),
            Field("posture", (n,), "rad", "where that spring pulls the shaped motors to"),
            Field("follow_velocity", (), "1", "share of D_x ẋ_d that is fed forward"),
            Field("follow_acceleration", (), "1", "share of Λ ẍ_d that is fed forward"),
        )
    )


def posture_spring(
    mass_matrix: cs.SX, jacobian: cs.SX, phi: cs.SX, stiffness: cs.SX, posture: cs.SX, regularisation: cs.SX
) -> cs.SX:
    """Return [I − Jᵀ J̄ᵀ] K_n (φ_n − φ) [N m]: toward a posture, without a wrench at the end effector.

    J̄ᵀ = Λ J M⁻¹. A projected spring is not conservative: it can give energy on a closed path.
    """
    pull = stiffness * (posture - phi)
    mobility = inverse_cartesian_inertia(mass_matrix, jacobian, regularisation)
    return pull - jacobian.T @ solve_spd(mobility, jacobian @ solve_spd(mass_matrix, pull))


def tracking_wrench(
    mass_matrix: cs.SX,
    jacobian: cs.SX,
    damping: cs.SX,
    velocity: cs.SX,
    acceleration: cs.SX,
    regularisation: cs.SX,
    a: SimpleNamespace,
) -> cs.SX:
    """Return D_x ẋ_d + Λ ẍ_d, each by its share: with it the end effector does not lag a moving reference."""
    mobility = inverse_cartesian_inertia(mass_matrix, jacobian, regularisation)
    return a.follow_velocity * (damping @ velocity) + a.follow_acceleration * solve_spd(
        mobility, acceleration
    )
