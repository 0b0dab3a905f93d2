"""Damping of the self-motion: (32) as printed, invisible at the end effector, never a source of energy."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings

from loops import SEEDS, robots
from passiflex.control.null_space import (
    inverse_cartesian_inertia,
    null_space_contribution,
    null_space_damping,
)
from passiflex.robots.arm import SerialArm
from passiflex.robots.catalogue import read_description
from passiflex.robots.flexible import FlexibleJointRobot

GAIN = 5.0
REGULAR = np.array([0, 0.6, 0, -1.2, 0, 1.0, 0])
SINGULAR_POSTURES = {
    "stretched": np.zeros(7),
    "wrist": np.array([0.3, 0.6, 0.2, -1.2, 0.4, 0.0, 0.5]),  # axes 5 and 7 aligned
    "shoulder": np.array([0.0, 0.0, 0.0, -1.2, 0.0, 1.0, 0.0]),  # axes 1 and 3 aligned
    "elbow": np.array([0.4, 0.7, -0.3, 0.0, 0.2, 0.9, 0.1]),
}


def terms(arm: SerialArm) -> cs.Function:
    q, (vector, m) = cs.SX.sym("q", arm.n), arm.layout.symbols("m")
    M = arm.mass_matrix(q, m)
    return cs.Function("terms", [q, vector], [M, arm.jacobian(q, m)])


@lru_cache
def formulas(n: int, rows: int) -> cs.Function:
    """(M, J, k, φ̇, ε) → D_ns, τ_ns, Λ⁻¹."""
    M, J, k, dphi, eps = (
        cs.SX.sym("M", n, n), cs.SX.sym("J", rows, n), cs.SX.sym("k"), cs.SX.sym("dphi", n), cs.SX.sym("eps")
    )  # fmt: skip
    out = [
        null_space_damping(M, J, k, eps),
        null_space_contribution(M, J, k, dphi, eps).torque,
        inverse_cartesian_inertia(M, J, eps),
    ]
    return cs.Function("null_space", [M, J, k, dphi, eps], out)


@lru_cache
def iiwa() -> tuple[cs.Function, np.ndarray]:
    arm = SerialArm(read_description("iiwa14").chain)
    return terms(arm), arm.layout.pack(arm.nominal())


def check_passive(M: np.ndarray, J: np.ndarray, eps: float, seed: int = 0, bound: float = 1e-10) -> None:
    """D_ns is symmetric and has no negative eigenvalue beyond `bound` of its scale; the torque is −D_ns φ̇."""
    dphi = np.random.default_rng(seed).normal(size=len(M))
    D, tau, _ = (np.array(v) for v in formulas(len(M), len(J))(M, J, GAIN, dphi, eps))
    scale = GAIN * np.abs(M).max()
    assert np.isfinite(D).all()
    assert np.abs(D - D.T).max() <= bound * scale
    assert np.linalg.eigvalsh((D + D.T) / 2).min() >= -bound * scale
    assert dphi @ tau.ravel() <= bound * scale * (dphi @ dphi)


@pytest.mark.parametrize("rows", [3, 6])
@settings(max_examples=10, deadline=None)
@given(robot=robots(1, 8), seed=SEEDS)
def test_damping_only_takes_energy(rows: int, robot: FlexibleJointRobot, seed: int) -> None:
    """Any arm, with fewer joints than the task has rows as well: ε makes Λ exist."""
    rng, arm = np.random.default_rng(seed), robot.arm
    f, m = terms(arm), arm.layout.pack(arm.nominal())
    for _ in range(3):
        M, J = (np.array(v) for v in f(rng.uniform(-2, 2, arm.n), m))
        check_passive(M, J[:rows], 1e-3, seed)


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("posture", SINGULAR_POSTURES)
@pytest.mark.parametrize("eps", [1e-9, 1e-6, 1e-3])
def test_damping_only_takes_energy_at_a_singularity(posture: str, rows: int, eps: float) -> None:
    f, m = iiwa()
    M, J = (np.array(v) for v in f(SINGULAR_POSTURES[posture], m))
    check_passive(M, J[:rows], eps)


@pytest.mark.parametrize("away", 10.0 ** np.arange(-9, 0))
@pytest.mark.parametrize("posture", SINGULAR_POSTURES)
def test_damping_only_takes_energy_near_a_singularity(posture: str, away: float) -> None:
    """Where a singular value of J comes close to √ε, Λ⁻¹ is as ill-conditioned as it gets: 1e2 / 1e-9 = 1e11.

    Jᵀ Λ J is at most M, and made of one triangular solve with the Cholesky factor, whose condition is the
    square root of that: round-off of M times √cond is 2e-16 · 3e5 = 7e-11. (Λ itself, formed as an inverse,
    would lose 1e-8 here.)
    """
    f, m = iiwa()
    rng = np.random.default_rng(3)
    for _ in range(5):
        M, J = (np.array(v) for v in f(SINGULAR_POSTURES[posture] + away * rng.uniform(-1, 1, 7), m))
        check_passive(M, J, 1e-9)


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_torque_is_32_as_printed(seed: int) -> None:
    """τ_u2 = −[I − Jᵀ J̄ᵀ] k_ns M φ̇ with J̄ = M⁻¹ Jᵀ Λ of (31), and = −D_ns φ̇ with (35)."""
    rng, (f, m) = np.random.default_rng(seed), iiwa()
    q = REGULAR + rng.uniform(-0.3, 0.3, 7)
    M, J = (np.array(v) for v in f(q, m))
    dphi = rng.normal(size=7)
    Lambda = np.linalg.inv(J @ np.linalg.inv(M) @ J.T)
    J_bar = np.linalg.inv(M) @ J.T @ Lambda  # (31)
    printed = -(np.eye(7) - J.T @ J_bar.T) @ (GAIN * M) @ dphi  # (32)
    D, tau, mobility = (np.array(v) for v in formulas(7, 6)(M, J, GAIN, dphi, 0.0))
    round_off = (
        1e-15 * np.linalg.cond(J @ np.linalg.inv(M) @ J.T) * np.linalg.cond(M) * GAIN * np.abs(M).max()
    )
    np.testing.assert_allclose(tau.ravel(), printed, rtol=0, atol=10 * round_off)
    np.testing.assert_allclose(tau.ravel(), -D @ dphi, rtol=0, atol=10 * round_off)
    np.testing.assert_allclose(D, GAIN * (M - J.T @ Lambda @ J), rtol=0, atol=10 * round_off)
    np.testing.assert_allclose(mobility @ Lambda, np.eye(6), atol=1e-9)


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_the_end_effector_does_not_feel_it(seed: int) -> None:
    """J M⁻¹ D_ns φ̇ = 0 for ε = 0; with ε > 0 the rest is ε k_ns (Λ⁻¹ + …)⁻¹ J φ̇, exactly ε k_ns Λ_ε J φ̇."""
    rng, (f, m) = np.random.default_rng(seed), iiwa()
    q = REGULAR + rng.uniform(-0.3, 0.3, 7)
    M, J = (np.array(v) for v in f(q, m))
    dphi = rng.normal(size=7)
    felt = J @ np.linalg.inv(M)
    round_off = 1e-14 * np.abs(felt).max() * np.linalg.cond(M) * GAIN * 10
    _, tau, _ = (np.array(v) for v in formulas(7, 6)(M, J, GAIN, dphi, 0.0))
    np.testing.assert_allclose(felt @ tau.ravel(), 0, atol=round_off)
    eps = 0.05
    _, tau, mobility = (np.array(v) for v in formulas(7, 6)(M, J, GAIN, dphi, eps))
    leak = -eps * GAIN * np.linalg.solve(mobility, J @ dphi)
    np.testing.assert_allclose(felt @ tau.ravel(), leak, rtol=0, atol=round_off)


def test_a_larger_regularisation_damps_more() -> None:
    """ε subtracts less: D_ns(ε₂) − D_ns(ε₁) ≥ 0 for ε₂ ≥ ε₁, up to the undiminished k_ns M."""
    f, m = iiwa()
    M, J = (np.array(v) for v in f(np.array([0.1, 0.6, 0, -1.2, 0.2, 1.0, 0]), m))
    ladder = [np.array(formulas(7, 6)(M, J, GAIN, np.zeros(7), eps)[0]) for eps in (0, 1e-3, 1.0, 1e9)]
    for less, more in pairwise(ladder):
        assert np.linalg.eigvalsh(more - less).min() >= -1e-10 * np.abs(M).max()
    np.testing.assert_allclose(ladder[-1], GAIN * M, rtol=0, atol=1e-6)
