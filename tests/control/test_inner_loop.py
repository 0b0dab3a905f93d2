"""The inner loop against (5)–(8) and (11) as printed, in plain numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from loops import SEEDS, definite
from passiflex.control.inner_loop import motor_torque, shaped_damping, shaped_motion


def numbers(seed: int, n: int) -> tuple[np.random.Generator, dict[str, np.ndarray]]:
    rng = np.random.default_rng(seed)
    return rng, {
        "K": rng.uniform(1e3, 3e4, n),
        "K_e": rng.uniform(1e3, 3e5, n),
        "B": rng.uniform(0.05, 2, n),
        "B_e": rng.uniform(1e-3, 2, n),
    }


@given(SEEDS, st.integers(1, 8))
@settings(deadline=None)
def test_motor_torque_is_5_with_6_7_and_8(seed: int, n: int) -> None:
    """τ_m = K_F [τ_e − C q̇ − ∇V] − K_G τ_a + K_H τ_u with the printed matrices.

    Both are sums of the same terms; the tolerance is round-off of the largest, times cond(M) ≤ 1e3.
    """
    rng, d = numbers(seed, n)
    K, K_e, B, B_e = (np.diag(d[k]) for k in ("K", "K_e", "B", "B_e"))
    M = definite(rng, n, 0.01, 10)
    tau_e, coriolis, gravity, tau_a, tau_u = rng.normal(scale=50, size=(5, n))
    K_F = -B @ np.linalg.inv(K) @ (K_e - K) @ np.linalg.inv(M)  # (6)
    K_G = B @ np.linalg.inv(K) @ K_e @ np.linalg.inv(B_e) - K_F - np.eye(n)  # (7)
    K_H = B @ np.linalg.inv(K) @ K_e @ np.linalg.inv(B_e)  # (8)
    printed = K_F @ (tau_e - coriolis - gravity) - K_G @ tau_a + K_H @ tau_u  # (5)
    acceleration = np.linalg.solve(M, tau_a + tau_e - coriolis - gravity)
    ours = motor_torque(acceleration, tau_a, tau_u, d["K"], d["B"], d["K_e"], d["B_e"])
    scale = sum(np.abs(A).max() for A in (K_F, K_G, K_H)) * 500
    np.testing.assert_allclose(ours, printed, rtol=0, atol=1e-13 * scale)


@given(SEEDS, st.integers(1, 8))
@settings(deadline=None)
def test_shaped_motion_is_11_in_both_lines(seed: int, n: int) -> None:
    """φ as printed; z = B_e K_e⁻¹(K_e − K) M⁻¹ p + B_e K_e⁻¹ K B⁻¹ s is B_e φ̇ for p = M q̇, s = B θ̇."""
    rng, d = numbers(seed, n)
    K, K_e, B, B_e = (np.diag(d[k]) for k in ("K", "K_e", "B", "B_e"))
    M = definite(rng, n, 0.01, 10)
    q, theta, dq, dtheta = rng.normal(size=(4, n))
    p, s = M @ dq, B @ dtheta
    inverse = np.linalg.inv(K_e)
    phi = inverse @ (K_e - K) @ q + inverse @ K @ theta
    z = B_e @ inverse @ (K_e - K) @ np.linalg.inv(M) @ p + B_e @ inverse @ K @ np.linalg.inv(B) @ s
    ours = shaped_motion(q, theta, dq, dtheta, d["K"], d["K_e"])
    scale = 1 + (d["K"] / d["K_e"]).max()
    np.testing.assert_allclose(ours.phi, phi, rtol=0, atol=1e-13 * scale * 10)
    np.testing.assert_allclose(d["B_e"] * ours.dphi, z, rtol=0, atol=1e-12 * scale * 10)


@given(SEEDS, st.integers(1, 8))
@settings(deadline=None)
def test_the_shaped_spring_carries_the_same_torque(seed: int, n: int) -> None:
    """(11) is made so that K_e (φ − q) + D_e (φ̇ − q̇) = K (θ − q) + D (θ̇ − q̇): the links see no change."""
    rng, d = numbers(seed, n)
    D = rng.uniform(0.1, 10, n)
    q, theta, dq, dtheta = rng.normal(size=(4, n))
    phi, dphi = shaped_motion(q, theta, dq, dtheta, d["K"], d["K_e"])
    D_e = shaped_damping(d["K"], D, d["K_e"])
    real = d["K"] * (theta - q) + D * (dtheta - dq)
    round_off = 1e-14 * (d["K_e"].max() + d["K"].max()) * 10
    np.testing.assert_allclose(d["K_e"] * (phi - q) + D_e * (dphi - dq), real, rtol=0, atol=round_off)


def test_without_stiffness_shaping_the_motor_is_the_motor() -> None:
    """K_e = K: φ = θ exactly, and with B_e = B the law is τ_m = τ_u."""
    rng, d = numbers(0, 7)
    q, theta, dq, dtheta, tau_a, tau_u, ddq = rng.normal(size=(7, 7))
    phi, dphi = shaped_motion(q, theta, dq, dtheta, d["K"], d["K"])
    np.testing.assert_array_equal(phi, theta)
    np.testing.assert_array_equal(dphi, dtheta)
    tau_m = motor_torque(ddq, tau_a, tau_u, d["K"], d["B"], d["K"], d["B"])
    np.testing.assert_allclose(tau_m, tau_u, rtol=0, atol=1e-14)


def test_shaped_damping_is_forced() -> None:
    """D_e = D K⁻¹ K_e; ten times the stiffness makes ten times the damping."""
    _, d = numbers(1, 7)
    D = np.linspace(1, 7, 7)
    np.testing.assert_allclose(shaped_damping(d["K"], D, 10 * d["K"]), 10 * D, rtol=1e-14)
    assert shaped_damping(8e3, 4.0, 2e3) == pytest.approx(1.0, rel=1e-15)
