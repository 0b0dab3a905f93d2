"""(5)–(8), (11): the inner loop, which gives the joint another stiffness and the motor another inertia."""

from __future__ import annotations

from typing import NamedTuple

import casadi as cs


class ShapedMotion(NamedTuple):
    """The shaped motor coordinate φ and its velocity, (n,)."""

    phi: cs.SX
    dphi: cs.SX


def shaped_motion(q: cs.SX, theta: cs.SX, dq: cs.SX, dtheta: cs.SX, K: cs.SX, K_e: cs.SX) -> ShapedMotion:
    """Return (11): φ = K_e⁻¹(K_e − K) q + K_e⁻¹ K θ and its derivative; K, K_e are diagonals (n,).

    (11) states the second line for the momenta; with p = M q̇, s = B θ̇, z = B_e φ̇ it is the same line.
    """
    link_share = (K_e - K) / K_e
    return ShapedMotion(link_share * q + K / K_e * theta, link_share * dq + K / K_e * dtheta)


def shaped_damping(K: cs.SX, D: cs.SX, K_e: cs.SX) -> cs.SX:
    """Return D_e = D K⁻¹ K_e [N m s/rad]; the choice of K_e forces it."""
    return D / K * K_e


def motor_torque(
    link_acceleration: cs.SX, tau_a: cs.SX, tau_u: cs.SX, K: cs.SX, B: cs.SX, K_e: cs.SX, B_e: cs.SX
) -> cs.SX:
    """Return τ_m of (5) [N m].

        τ_m = K_F [τ_e − C q̇ − ∇V] − K_G τ_a + K_H τ_u
        K_F = −B K⁻¹ (K_e − K) M⁻¹             (6)
        K_G = B K⁻¹ K_e B_e⁻¹ − K_F − I         (7)
        K_H = B K⁻¹ K_e B_e⁻¹                   (8)

    (7) holds −K_F, so the two terms with K_F are one, K_F [τ_e − C q̇ − ∇V + τ_a]: a multiple of
    the link acceleration that the model expects.

    Parameters
    ----------
    link_acceleration: M⁻¹ (τ_a + τ_e − C q̇ − ∇V) of the law's model, (n,) rad/s².
    tau_a, tau_u: Measured joint torque and outer-loop torque, (n,) N m.
    K, B, K_e, B_e: Diagonals, (n,).
    """
    K_H = B / K * K_e / B_e
    return -B / K * (K_e - K) * link_acceleration - (K_H - 1) * tau_a + K_H * tau_u
