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
            Field("posture_damping", (n,), "N m s/rad", "of the same motion"),
            Field("posture", (n,), "rad", "where that spring pulls the shaped motors to"),
            Field("follow_velocity", (), "1", "share of D_x ẋ_d that is fed forward"),
            Field("follow_acceleration", (), "1", "share of Λ ẍ_d that is fed forward"),
        )
    )


def posture_spring(
    mass_matrix: cs.SX,
    jacobian: cs.SX,
    phi: cs.SX,
    dphi: cs.SX,
    regularisation: cs.SX,
    a: SimpleNamespace,
) -> cs.SX:
    """Return N [K_n Nᵀ (φ_n − φ) − D_n Nᵀ φ̇] [N m], N = I − Jᵀ J̄ᵀ: toward a posture, no wrench at the end effector.

    J̄ᵀ = Λ J M⁻¹, and J̄ᵀ N = 0. N stands on both sides, so that the stiffness is symmetric and ≥ 0; N K_n alone is
    not, and flutters at a few N m/rad. N moves with the arm all the same, so that this spring is not conservative:
    it can give energy on a closed path.
    """
    mobility = inverse_cartesian_inertia(mass_matrix, jacobian, regularisation)

    def hidden(motion: cs.SX) -> cs.SX:
        """Return Nᵀ times a motion: what of it the end effector does not see."""
        return motion - solve_spd(mass_matrix, jacobian.T @ solve_spd(mobility, jacobian @ motion))

    pull = a.posture_stiffness * hidden(a.posture - phi) - a.posture_damping * hidden(dphi)
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
