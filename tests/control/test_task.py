"""The Cartesian spring: its gradients on the manifold, its closed form, and its bounds."""

from __future__ import annotations

from functools import lru_cache

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from loops import SEEDS, definite, rotation
from passiflex.control import AbstractTask, PoseTask, PositionTask
from passiflex.robots.arm import EndEffectorPose

TASKS = (PoseTask(), PositionTask(), PoseTask(free=(0, 5)))
STEP = 6e-6
"""ε^⅓: truncation (STEP²) and rounding (ε/STEP) of a central difference are both 4e-11 of the scale."""
DIFFERENCE = 1e-8
"""Allows for third derivatives that are 100 times the potential's scale."""
EXACT = 1e-13


@lru_cache
def spring_function(task: AbstractTask) -> cs.Function:
    p, R, p_d, R_d = cs.SX.sym("p", 3), cs.SX.sym("R", 3, 3), cs.SX.sym("p_d", 3), cs.SX.sym("R_d", 3, 3)
    K = cs.SX.sym("K", task.size, task.size)
    return cs.Function(
        "spring", [p, R, p_d, R_d, K], [*task.spring(EndEffectorPose(p, R), EndEffectorPose(p_d, R_d), K)]
    )


def spring(task: AbstractTask, *arguments: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    U, gradient, reference_gradient = spring_function(task)(*arguments)
    return float(U), np.array(gradient).ravel(), np.array(reference_gradient).ravel()


def moved(p: np.ndarray, R: np.ndarray, twist: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pose displaced by a twist in world axes: R ← exp([δ]) R."""
    return p + twist[:3], Rotation.from_rotvec(twist[3:]).as_matrix() @ R


def poses(rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    return rng.normal(size=3), rotation(rng), rng.normal(size=3), rotation(rng)


def epsilon(R: np.ndarray, R_d: np.ndarray) -> np.ndarray:
    return vee(R_d.T @ R) / 2


def vee(A: np.ndarray) -> np.ndarray:
    """Return the vector of A − Aᵀ."""
    S = A - A.T
    return np.array([S[2, 1], S[0, 2], S[1, 0]])


@pytest.mark.parametrize("task", TASKS, ids=lambda t: type(t).__name__)
@settings(max_examples=30, deadline=None)
@given(seed=SEEDS)
def test_gradients_are_those_of_the_potential(task: AbstractTask, seed: int) -> None:
    """For a full coupled K_x, at any orientation error, with respect to x and to x_d."""
    rng = np.random.default_rng(seed)
    p, R, p_d, R_d = poses(rng)
    K = definite(rng, task.size, 0.1, 50)
    _, gradient, reference_gradient = spring(task, p, R, p_d, R_d, K)
    for i, unit in enumerate(np.eye(6)):
        up, down = moved(p, R, STEP * unit), moved(p, R, -STEP * unit)
        slope = (spring(task, *up, p_d, R_d, K)[0] - spring(task, *down, p_d, R_d, K)[0]) / (2 * STEP)
        np.testing.assert_allclose(gradient[i], slope, rtol=0, atol=DIFFERENCE * 50 * 10)
        up, down = moved(p_d, R_d, STEP * unit), moved(p_d, R_d, -STEP * unit)
        slope = (spring(task, p, R, *up, K)[0] - spring(task, p, R, *down, K)[0]) / (2 * STEP)
        np.testing.assert_allclose(reference_gradient[i], slope, rtol=0, atol=DIFFERENCE * 50 * 10)


@settings(max_examples=30, deadline=None)
@given(SEEDS)
def test_torque_has_its_closed_form(seed: int) -> None:
    """Uncoupled: K_t e, and vee(A − Aᵀ) with A = R G R_dᵀ, G = ½ tr(K_o) I − K_o (theory note 2.2)."""
    rng = np.random.default_rng(seed)
    p, R, p_d, R_d = poses(rng)
    K_t, K_o = definite(rng, 3, 0.1, 50), definite(rng, 3, 0.1, 50)
    U, gradient, _ = spring(PoseTask(), p, R, p_d, R_d, block_diag(K_t, K_o))
    G = np.trace(K_o) / 2 * np.eye(3) - K_o
    e = p - p_d
    np.testing.assert_allclose(
        U, e @ K_t @ e / 2 + np.trace(G @ (np.eye(3) - R_d.T @ R)), rtol=0, atol=EXACT * 1e3
    )
    np.testing.assert_allclose(gradient[:3], K_t @ e, rtol=0, atol=EXACT * 1e3)
    np.testing.assert_allclose(gradient[3:], vee(R @ G @ R_d.T), rtol=0, atol=EXACT * 1e3)


@settings(max_examples=30, deadline=None)
@given(SEEDS, st.floats(1e-5, 1e-2))
def test_a_small_turn_meets_the_rotational_stiffness(seed: int, angle: float) -> None:
    """U = ½ rᵀK_o r for the rotation vector r in the reference frame, up to the fourth order.

    2 vᵀK_o v = ½ rᵀK_o r · (sin(θ/2)/(θ/2))², which differs by at most θ²/12 of itself; rounding of the trace
    of nearly equal numbers adds ε tr(G).
    """
    rng = np.random.default_rng(seed)
    K_o, R_d, p = definite(rng, 3, 1, 50), rotation(rng), rng.normal(size=3)
    r = rng.normal(size=3)
    r *= angle / np.linalg.norm(r)
    K = block_diag(np.eye(3), K_o)
    U, gradient, _ = spring(PoseTask(), p, R_d @ Rotation.from_rotvec(r).as_matrix(), p, R_d, K)
    quadratic = r @ K_o @ r / 2
    assert abs(U - quadratic) <= angle**2 / 12 * quadratic + 1e-13
    np.testing.assert_allclose(gradient[3:], R_d @ K_o @ r, rtol=0, atol=150 * angle**2)


@settings(max_examples=60, deadline=None)
@given(SEEDS, st.floats(0, np.pi))
def test_potential_is_bounded_below(seed: int, angle: float) -> None:
    """0 ≤ ½ [e; ε]ᵀ K_x [e; ε] ≤ U for a coupled K_x, up to half a turn; equal without a turn."""
    rng = np.random.default_rng(seed)
    R_d, e, axis = rotation(rng), rng.normal(size=3), rng.normal(size=3)
    R = R_d @ Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
    K = definite(rng, 6, 1e-3, 100)
    U, *_ = spring(PoseTask(), e, R, np.zeros(3), R_d, K)
    error = np.concatenate([e, epsilon(R, R_d)])
    bound = error @ K @ error / 2
    round_off = 1e-12 * 100 * (1 + e @ e)
    assert bound >= 0
    assert U - bound >= -round_off
    at_rest, *_ = spring(PoseTask(), e, R_d, np.zeros(3), R_d, K)
    assert abs(at_rest - e @ K[:3, :3] @ e / 2) <= round_off


@pytest.mark.parametrize("task", TASKS, ids=lambda t: type(t).__name__)
@settings(max_examples=10, deadline=None)
@given(seed=SEEDS)
def test_no_error_no_energy_and_no_wrench(task: AbstractTask, seed: int) -> None:
    rng = np.random.default_rng(seed)
    p, R = rng.normal(size=3), rotation(rng)
    U, gradient, reference_gradient = spring(task, p, R, p, R, definite(rng, task.size, 0.1, 50))
    np.testing.assert_allclose([U, *gradient, *reference_gradient], 0, atol=EXACT * 100)


@settings(max_examples=10, deadline=None)
@given(SEEDS)
def test_position_task_leaves_the_orientation_free(seed: int) -> None:
    """U = ½ eᵀ K_x e, force K_x e, no torque at all."""
    rng = np.random.default_rng(seed)
    p, R, p_d, R_d = poses(rng)
    K, e = definite(rng, 3, 0.1, 50), p - p_d
    U, gradient, reference_gradient = spring(PositionTask(), p, R, p_d, R_d, K)
    np.testing.assert_allclose(U, e @ K @ e / 2, rtol=1e-13)
    np.testing.assert_allclose(gradient[:3], K @ e, rtol=0, atol=EXACT * 1e3)
    np.testing.assert_allclose(reference_gradient[:3], -K @ e, rtol=0, atol=EXACT * 1e3)
    assert not gradient[3:].any()
    assert not reference_gradient[3:].any()


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_anisotropic_spring_gives_no_energy_around_a_closed_path(seed: int) -> None:
    """∮ gradientᵀ dx = 0 along a closed path of orientations: the fault of error vectors with a plain Jacobian.

    The trapezoidal rule on a smooth periodic integrand converges beyond all orders; 400 points are round-off.
    """
    rng = np.random.default_rng(seed)
    K, p, R_d = block_diag(np.eye(3), np.diag([5.0, 50.0, 200.0])), np.zeros(3), rotation(rng)
    a, b = rng.normal(size=(2, 3)) * 0.8
    angles = np.linspace(0, 2 * np.pi, 401)[:-1]
    work = 0.0
    for t in angles:
        # R = exp([a sin t]) exp([b cos t]): ω = a cos t − exp([a sin t]) b sin t in world axes
        first = Rotation.from_rotvec(a * np.sin(t)).as_matrix()
        R = first @ Rotation.from_rotvec(b * np.cos(t)).as_matrix()
        omega = a * np.cos(t) - first @ b * np.sin(t)
        work += spring(PoseTask(), p, R, p, R_d, K)[1][3:] @ omega * 2 * np.pi / 400
    assert abs(work) < 1e-10 * 200
