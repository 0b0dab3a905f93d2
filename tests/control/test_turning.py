"""What the rotational spring holds: closed forms, and a hand that slides down its potential under a load."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from loops import definite
from passiflex.control.turning import held_angle, largest_moment, turning_moment


def potential(stiffness: np.ndarray, R: np.ndarray) -> float:
    G = np.trace(stiffness) / 2 * np.eye(3) - stiffness
    return float(np.trace(G @ (np.eye(3) - R)))


def test_the_moment_is_the_slope_of_the_potential() -> None:
    rng, h = np.random.default_rng(0), 1e-6
    for _ in range(20):
        K, R = definite(rng, 3, 1, 50), Rotation.random(random_state=rng).as_matrix()
        slope = [
            (
                potential(K, Rotation.from_rotvec(h * e).as_matrix() @ R)
                - potential(K, Rotation.from_rotvec(-h * e).as_matrix() @ R)
            )
            / (2 * h)
            for e in np.eye(3)
        ]
        np.testing.assert_allclose(turning_moment(K, R), slope, rtol=0, atol=1e-7)


def test_the_moment_is_never_more_than_the_largest_stiffness() -> None:
    """And its size is 2 √(|K v|² − (vᵀ K v)²), with v the vector part of the quaternion."""
    rng = np.random.default_rng(1)
    for _ in range(2000):
        K, turn = definite(rng, 3, 0.1, 50), Rotation.random(random_state=rng)
        v = turn.as_quat()[:3]
        size = np.linalg.norm(turning_moment(K, turn.as_matrix()))
        assert size <= np.linalg.eigvalsh(K).max() * (1 + 1e-12)
        assert size == pytest.approx(
            2 * math.sqrt(max((K @ v) @ (K @ v) - (v @ K @ v) ** 2, 0)), rel=1e-6, abs=1e-6
        )


@pytest.mark.parametrize("degrees", [30, 90, 150, 180])
def test_about_a_principal_axis_it_is_the_sine(degrees: float) -> None:
    K, angle = np.diag([60.0, 60, 10]), math.radians(degrees)
    got = turning_moment(K, Rotation.from_rotvec([0, 0, angle]).as_matrix())
    np.testing.assert_allclose(got, [0, 0, 10 * math.sin(angle)], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("stiffness", "axis", "largest"),
    [
        ([10, 10, 10], [1, 2, -3], 10),
        ([60, 60, 10], [0, 0, 1], 10),
        ([60, 60, 10], [-1, 0, 0], 60),
        (
            [10, 20, 60],
            [0, 0, 1],
            60 * math.sqrt(1 - 0.5**2),
        ),  # k more than both others: cos = (60 − 10 − 20)/60
        ([30, 30, 0], [1, 1, 0], 30),
        ([30, 30, 0], [0, 0, 1], 0),
        ([30, 30, 0], [1, 0, 1], 0),
    ],
)
def test_the_largest_moment_in_closed_form(stiffness: list[float], axis: list[float], largest: float) -> None:
    got = largest_moment(np.diag(np.array(stiffness, float)), np.array(axis, float))
    assert got == pytest.approx(largest, abs=2e-4 * max(stiffness))


@pytest.mark.parametrize("seed", range(6))
def test_a_hand_comes_to_rest_below_the_largest_moment_and_never_above(seed: int) -> None:
    """ω = moment − spring, the load raised slowly to 97 % of it, or to 105 %: it then still turns, or does not."""
    rng = np.random.default_rng(seed)
    K, n = definite(rng, 3, 5, 50), rng.normal(size=3)
    n /= np.linalg.norm(n)
    largest = largest_moment(K, n)

    def speed(share: float) -> float:
        def rate(t: float, x: np.ndarray) -> np.ndarray:
            R = x.reshape(3, 3)
            load = share * largest * min(t / 20, 1) * n
            return np.ravel(np.cross(load - turning_moment(K, R), R, axisb=0, axisc=0))

        end = solve_ivp(rate, (0, 40), np.eye(3).ravel(), rtol=1e-8, atol=1e-8).y[:, -1].reshape(3, 3)
        return float(np.linalg.norm(share * largest * n - turning_moment(K, end)))

    assert speed(0.97) < 1e-3
    assert speed(1.05) > 0.01


def test_the_angle_leaves_out_what_is_about_a_free_axis() -> None:
    """For a tool that may turn about z it is the tilt of z, however far the hand has turned about it."""
    rng = np.random.default_rng(2)
    for _ in range(50):
        turn = Rotation.random(random_state=rng)
        R = turn.as_matrix()
        assert held_angle(np.diag([3.0, 5, 0]), R) == pytest.approx(math.acos(R[2, 2]), abs=1e-7)
        assert held_angle(np.eye(3), R) == pytest.approx(turn.magnitude(), abs=1e-7)
