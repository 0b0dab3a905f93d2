"""The gated actions against NumPy: a posture spring that the end effector does not feel, and a wrench that leads."""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace

import casadi as cs
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from loops import SEEDS, definite, robots
from passiflex.robots.arm import SerialArm
from passiflex.robots.catalogue import read_description
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.sampled.actions import FARTHEST, action_layout, posture_spring, tracking_wrench

SIZES = ((4, 3), (7, 6), (7, 3), (3, 2))
"""(joints, rows of the task), with a null space."""

each_size = pytest.mark.parametrize(("n", "k"), SIZES)


@lru_cache
def terms(arm: SerialArm) -> cs.Function:
    q, (vector, m) = cs.SX.sym("q", arm.n), arm.layout.symbols("m")
    return cs.Function("terms", [q, vector], [arm.mass_matrix(q, m), arm.jacobian(q, m)])


@lru_cache
def spring_function(n: int, k: int) -> cs.Function:
    M, J, error = cs.SX.sym("M", n, n), cs.SX.sym("J", k, n), cs.SX.sym("x", k)
    phi, stiffness, posture, dphi, damping = (cs.SX.sym(name, n) for name in ("f", "K", "p", "v", "D"))
    eps = cs.SX.sym("e")
    a = SimpleNamespace(posture_stiffness=stiffness, posture_damping=damping, posture=posture)
    arguments = [M, J, phi, stiffness, posture, eps, dphi, damping, error]
    return cs.Function("posture", arguments, [posture_spring(M, J, error, phi, dphi, eps, a)])


@lru_cache
def wrench_function(n: int, k: int) -> cs.Function:
    M, J, D = cs.SX.sym("M", n, n), cs.SX.sym("J", k, n), cs.SX.sym("D", k, k)
    v, dv, eps, shares = (cs.SX.sym(name, size) for name, size in {"v": k, "a": k, "e": 1, "s": 2}.items())
    a = SimpleNamespace(follow_velocity=shares[0], follow_acceleration=shares[1])
    return cs.Function("follow", [M, J, D, v, dv, eps, shares], [tracking_wrench(M, J, D, v, dv, eps, a)])


def spring(M: np.ndarray, J: np.ndarray, *numbers: np.ndarray | float) -> np.ndarray:
    n, k = len(M), len(J)  # at rest, undamped, and with the end effector on its reference unless given
    still = (np.zeros(n), np.zeros(n), np.zeros(k))[len(numbers) - 4 :]
    return np.array(spring_function(len(M), len(J))(M, J, *numbers, *still)).ravel()


def follow(M: np.ndarray, J: np.ndarray, *numbers: np.ndarray | float) -> np.ndarray:
    return np.array(wrench_function(len(M), len(J))(M, J, *numbers)).ravel()


def matrices(n: int, k: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return M with cond ≤ 100 and J with singular values in 0.3..1.5: cond(J M⁻¹ Jᵀ) ≤ 2500."""
    left, _ = np.linalg.qr(rng.normal(size=(k, k)))
    right, _ = np.linalg.qr(rng.normal(size=(n, n)))
    return definite(rng, n, 0.1, 10), left @ np.diag(rng.uniform(0.3, 1.5, k)) @ right[:k]


def weighted_inverse(M: np.ndarray, J: np.ndarray) -> np.ndarray:
    """Return J̄ = M⁻¹ Jᵀ (J M⁻¹ Jᵀ)⁻¹."""
    return np.linalg.inv(M) @ J.T @ np.linalg.inv(J @ np.linalg.inv(M) @ J.T)


@each_size
@settings(max_examples=20, deadline=None)
@given(seed=SEEDS)
def test_the_end_effector_does_not_feel_the_posture_spring(n: int, k: int, seed: int) -> None:
    """J̄ᵀ τ = 0, and no acceleration, J M⁻¹ τ = 0: to 1e-9 of a pull of 100 N m; wherever the end effector is."""
    rng = np.random.default_rng(seed)
    M, J = matrices(n, k, rng)
    stiffness, phi, posture = rng.uniform(0, 100, n), *rng.uniform(-1, 1, (2, n))
    error, still = rng.uniform(-0.3, 0.3, k), np.zeros(n)
    tau = spring(M, J, phi, stiffness, posture, 0.0, still, still, error)
    J_bar = weighted_inverse(M, J)
    np.testing.assert_allclose(J_bar.T @ tau, 0, atol=1e-9)
    np.testing.assert_allclose(J @ np.linalg.solve(M, tau), 0, atol=1e-9)
    moved = J_bar @ error
    moved /= np.sqrt(1 + moved @ moved)
    N = np.eye(n) - J.T @ J_bar.T
    np.testing.assert_allclose(tau, N @ (stiffness * (posture - phi + moved)), atol=1e-9)


@each_size
@settings(max_examples=300, deadline=None)
@given(seed=SEEDS)
def test_what_the_posture_spring_gives_its_distance_loses(n: int, k: int, seed: int) -> None:
    """Along every self-motion, J v = 0: τᵀ v = −d/dt ½ dᵀ K_n d, weights of 0 among them; 1200 cases.

    And where it accelerates to from rest, M⁻¹ τ, the distance falls.
    """
    rng = np.random.default_rng(seed)
    M, J = matrices(n, k, rng)
    stiffness, phi, posture = rng.uniform(0, 400, n), *rng.uniform(-2, 2, (2, n))
    stiffness[rng.uniform(size=n) < 0.3] = 0
    tau = spring(M, J, phi, stiffness, posture, 0.0)
    v = np.linalg.svd(J)[2][k:].T @ rng.normal(size=n - k)
    gained = (stiffness * (posture - phi)) @ v
    assert tau @ v == pytest.approx(gained, rel=1e-9, abs=1e-8)
    falls = (stiffness * (posture - phi)) @ np.linalg.solve(M, tau)
    assert falls == pytest.approx(tau @ np.linalg.solve(M, tau), rel=1e-8, abs=1e-8)
    assert falls > 0 or not stiffness.any()


@each_size
@settings(max_examples=20, deadline=None)
@given(seed=SEEDS)
def test_a_posture_spring_is_slack_at_the_nearest_point_and_nowhere_else(n: int, k: int, seed: int) -> None:
    """Nearest by least squares: the self-motion z s with the least ½ (d − z s)ᵀ K_n (d − z s) leaves no torque."""
    rng = np.random.default_rng(seed)
    M, J = matrices(n, k, rng)
    stiffness, d = rng.uniform(1, 400, n), rng.uniform(-1, 1, n)
    Z = np.linalg.svd(J)[2][k:].T
    root = np.sqrt(stiffness)
    s = np.linalg.lstsq(root[:, None] * Z, root * d, rcond=None)[0]
    zero = np.zeros(n)
    np.testing.assert_allclose(spring(M, J, zero, stiffness, d - Z @ s, 0.0), 0, atol=1e-8)
    there = spring(M, J, zero, stiffness, d, 0.0)
    # N has the left null space Jᵀ alone, so that τ = 0 exactly where Zᵀ K_n d = 0
    np.testing.assert_allclose(Z.T @ there, Z.T @ (stiffness * d), rtol=1e-9, atol=1e-8)


@each_size
@settings(max_examples=10, deadline=None)
@given(seed=SEEDS)
def test_no_stiffness_and_no_distance_are_no_torque(n: int, k: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    M, J = matrices(n, k, rng)
    phi, posture, stiffness = rng.uniform(-1, 1, (3, n))
    assert not spring(M, J, phi, 0 * phi, posture, 0.0).any()
    assert not spring(M, J, phi, np.abs(stiffness), phi, 0.0).any()


@each_size
@settings(max_examples=20, deadline=None)
@given(seed=SEEDS, exponent=st.floats(-6, 2))
def test_with_regularisation_the_end_effector_feels_its_share(
    n: int, k: int, seed: int, exponent: float
) -> None:
    """J M⁻¹ τ = ε Λ_ε J M⁻¹ K_n (φ_n − φ), exactly: all of the spring for a large ε, nothing for a small one."""
    rng, eps = np.random.default_rng(seed), 10**exponent
    M, J = matrices(n, k, rng)
    stiffness, phi, posture = rng.uniform(0, 100, n), *rng.uniform(-1, 1, (2, n))
    felt = J @ np.linalg.inv(M)
    leak = eps * np.linalg.solve(felt @ J.T + eps * np.eye(k), felt @ (stiffness * (posture - phi)))
    np.testing.assert_allclose(felt @ spring(M, J, phi, stiffness, posture, eps), leak, rtol=0, atol=1e-9)


@each_size
@settings(max_examples=20, deadline=None)
@given(seed=SEEDS)
def test_the_springs_stiffness_and_damping_are_symmetric_and_never_negative(
    n: int, k: int, seed: int
) -> None:
    """−∂τ/∂φ on the reference, where a motion of the joints is also one of the end effector, and −∂τ/∂φ̇.

    Both are N K Nᵀ. N K_n alone, with the end effector's motion left out, would not be, and flutters.
    """
    rng = np.random.default_rng(seed)
    M, J = matrices(n, k, rng)
    gains, zero, h = rng.uniform(1, 100, n), np.zeros(n), 1e-6
    stiffness = -np.array(
        [spring(M, J, h * e, gains, zero, 0.0, zero, zero, J @ (h * e)) / h for e in np.eye(n)]
    ).T
    damping = -np.array([spring(M, J, zero, zero, zero, 0.0, e, gains) for e in np.eye(n)]).T
    scale = np.abs(damping).max()
    N = np.eye(n) - J.T @ weighted_inverse(M, J).T
    np.testing.assert_allclose(damping, N @ np.diag(gains) @ N.T, atol=1e-9 * scale)
    np.testing.assert_allclose(damping, damping.T, atol=1e-9 * scale)
    np.testing.assert_allclose(stiffness, damping, atol=1e-8 * scale)
    assert np.linalg.eigvalsh(damping).min() >= -1e-9 * scale


@each_size
@settings(max_examples=20, deadline=None)
@given(seed=SEEDS, exponent=st.floats(0, 12))
def test_near_a_singular_posture_the_spring_stays_bounded(n: int, k: int, seed: int, exponent: float) -> None:
    """However far off the end effector is and however singular J: |τ| ≤ √cond(M) K_n (|d| + 1 rad)."""
    rng = np.random.default_rng(seed)
    M, J = matrices(n, k, rng)
    J = np.diag([10**-exponent] + [1.0] * (k - 1)) @ J
    stiffness, d, zero = rng.uniform(1, 100, n), rng.uniform(-1, 1, n), np.zeros(n)
    tau = spring(M, J, zero, stiffness, d, 1e-9, zero, zero, np.full(k, 10.0))
    most = np.sqrt(np.linalg.cond(M)) * stiffness.max() * (np.linalg.norm(d) + FARTHEST)
    assert np.linalg.norm(tau) <= most * (1 + 1e-6)


def test_an_arm_without_a_null_space_has_no_posture_spring() -> None:
    """As many joints as rows: nothing is left to pull at."""
    M, J = matrices(3, 3, np.random.default_rng(0))
    tau = spring(M, J, np.zeros(3), np.full(3, 100.0), np.ones(3), 0.0)
    np.testing.assert_allclose(tau, 0, atol=1e-9)


@settings(max_examples=5, deadline=None)
@given(robots(4, 6, prismatic=False), SEEDS)
def test_the_posture_spring_of_an_arm_moves_its_elbow_alone(robot: FlexibleJointRobot, seed: int) -> None:
    """From rest and without weight, q̈ = M⁻¹ τ: J q̈ = 0, and the distance to the posture shrinks."""
    rng, arm = np.random.default_rng(seed), robot.arm
    phi, posture = rng.uniform(-2, 2, (2, arm.n))
    M, J = (np.array(v) for v in terms(arm)(phi, arm.layout.pack(arm.nominal())))
    J = J[:3]
    assume(np.linalg.cond(J @ np.linalg.inv(M) @ J.T) < 1e4)
    tau = spring(M, J, phi, np.full(arm.n, 50.0), posture, 0.0)
    ddq = np.linalg.solve(M, tau)
    np.testing.assert_allclose(J @ ddq, 0, atol=1e-9 * np.abs(ddq).max())
    assert 50.0 * (posture - phi) @ ddq > 0


@pytest.mark.parametrize("eps", [0.0, 1e-2])
@pytest.mark.parametrize("rows", [3, 6])
@settings(max_examples=20, deadline=None)
@given(seed=SEEDS)
def test_the_tracking_wrench_is_its_formula(rows: int, eps: float, seed: int) -> None:
    """v D_x ẋ_d + a Λ ẍ_d with Λ = (J M⁻¹ Jᵀ + ε I)⁻¹ of an iiwa; 1e-12 of it times cond(Λ) ≤ 1e4."""
    rng, (f, numbers) = np.random.default_rng(seed), iiwa()
    q = np.array([0, 0.6, 0, -1.2, 0, 1.0, 0]) + rng.uniform(-0.3, 0.3, 7)
    M, J = (np.array(v) for v in f(q, numbers))
    J = J[:rows]
    D, (velocity, acceleration), shares = (
        definite(rng, rows, 1, 100),
        rng.normal(size=(2, rows)),
        rng.uniform(0, 1, 2),
    )
    Lambda = np.linalg.inv(J @ np.linalg.inv(M) @ J.T + eps * np.eye(rows))
    expected = shares[0] * (D @ velocity) + shares[1] * (Lambda @ acceleration)
    ours = follow(M, J, D, velocity, acceleration, eps, shares)
    np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-8 * np.abs(expected).max())


@lru_cache
def iiwa() -> tuple[cs.Function, np.ndarray]:
    arm = SerialArm(read_description("iiwa14").chain)
    return terms(arm), arm.layout.pack(arm.nominal())


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_shares_switch_the_two_parts_of_the_wrench(seed: int) -> None:
    rng = np.random.default_rng(seed)
    M, J = matrices(7, 6, rng)
    D, (velocity, acceleration) = definite(rng, 6, 1, 100), rng.normal(size=(2, 6))

    def wrench(*shares: float) -> np.ndarray:
        return follow(M, J, D, velocity, acceleration, 1e-3, np.array(shares))

    assert not wrench(0, 0).any()
    np.testing.assert_allclose(wrench(1, 0), D @ velocity, rtol=0, atol=1e-12 * 100)
    np.testing.assert_allclose(wrench(1, 1), wrench(1, 0) + wrench(0, 1), rtol=0, atol=1e-12 * 100)
    assert not follow(M, J, D, 0 * velocity, 0 * velocity, 1e-3, np.ones(2)).any()


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_with_the_tracking_wrench_the_end_effector_does_not_lag(seed: int) -> None:
    """On the reference, with the law's −Jᵀ D_x J φ̇, M q̈ = Jᵀ (F − D_x ẋ) gives J q̈ = ẍ_d: Λ of the links.

    For ẋ = ẋ_d the damper takes away what is fed forward, and J M⁻¹ Jᵀ Λ ẍ_d = ẍ_d is left.
    """
    rng = np.random.default_rng(seed)
    M, J = matrices(7, 6, rng)
    D, acceleration, dq = definite(rng, 6, 1, 100), rng.normal(size=6), rng.normal(size=7)
    wrench = follow(M, J, D, J @ dq, acceleration, 0.0, np.ones(2))
    ddq = np.linalg.solve(M, J.T @ (wrench - D @ (J @ dq)))
    np.testing.assert_allclose(J @ ddq, acceleration, rtol=0, atol=1e-9)


def test_the_layout_has_a_switch_for_each_action() -> None:
    assert {f.name: f.size for f in action_layout(5)} == {
        "posture_stiffness": 5,
        "posture_damping": 5,
        "posture": 5,
        "follow_velocity": 1,
        "follow_acceleration": 1,
        "coulomb_compensation": 5,
        "viscous_compensation": 5,
        "compensation_width": 1,
    }
