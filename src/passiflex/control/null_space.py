"""(30)–(32), (35): damping of the motion that the end effector does not see."""

from __future__ import annotations

import casadi as cs

from passiflex.control.signals import Contribution
from passiflex.robots.linear_algebra import gram, half_solve_spd, solve_spd


def inverse_cartesian_inertia(
    mass_matrix: cs.SX, jacobian: cs.SX, regularisation: cs.SX | float = 0.0
) -> cs.SX:
    """Return Λ⁻¹ = J M⁻¹ Jᵀ + ε I of (31), the mobility of the end effector.

    Near a singular posture ε > 0 bounds Λ; it makes Λ smaller, so that D_ns of (35) stays ≥ 0.
    """
    half = half_solve_spd(mass_matrix, jacobian.T)
    return gram(half) + regularisation * cs.SX.eye(jacobian.shape[0])


def null_space_damping(
    mass_matrix: cs.SX, jacobian: cs.SX, gain: cs.SX, regularisation: cs.SX | float = 0.0
) -> cs.SX:
    """Return D_ns = k_ns (M − Jᵀ Λ J) of (35) [N m s/rad], symmetric and ≥ 0; (33) is not needed."""
    mobility = inverse_cartesian_inertia(mass_matrix, jacobian, regularisation)
    half = half_solve_spd(mobility, jacobian)  # halfᵀ half = Jᵀ Λ J, symmetric to the last bit
    return gain * (mass_matrix - gram(half))


def null_space_contribution(
    mass_matrix: cs.SX, jacobian: cs.SX, gain: cs.SX, dphi: cs.SX, regularisation: cs.SX | float = 0.0
) -> Contribution:
    """Return τ_u2 = −[I − Jᵀ J̄ᵀ] k_ns M φ̇ = −D_ns φ̇ of (32) [N m]; it stores nothing and dissipates φ̇ᵀ D_ns φ̇."""
    mobility = inverse_cartesian_inertia(mass_matrix, jacobian, regularisation)
    torque = -gain * (mass_matrix @ dphi - jacobian.T @ solve_spd(mobility, jacobian @ dphi))
    return Contribution(torque, cs.SX(0), -cs.dot(dphi, torque))
