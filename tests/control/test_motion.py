"""Motions of the reference: their angular velocity is that of their rotations, and turns are geodesics."""

from __future__ import annotations

from typing import Any

import casadi as cs
import numpy as np
import pytest
from scipy.spatial.transform import Rotation, RotationSpline

from passiflex.control.motion import (
    DEGREE,
    LINEAR,
    MOTION,
    Pose,
    along,
    circle,
    hold,
    minimum_jerk,
    pose_at,
    reference_at,
    shifted,
)
from passiflex.control.rotation_vector import angular_velocity, rates_for, turned

HOME = Pose(np.array([0.4, -0.1, 0.6]), Rotation.from_rotvec([0.3, -1.0, 0.5]).as_matrix())


def _functions() -> tuple[cs.Function, cs.Function]:
    clock, rate = cs.SX.sym("clock"), cs.SX.sym("rate")
    motion, c = MOTION.symbols("motion")
    reference = reference_at(clock, rate, c)
    value = cs.Function("reference", [clock, rate, motion], [*reference.pose, reference.velocity])
    slope = cs.Function("slope", [clock, rate, motion], [cs.jacobian(reference.velocity, clock)])
    return value, slope


VALUE, SLOPE = _functions()


def at(motion: Any, clock: float, rate: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    position, rotation, velocity = VALUE(clock, rate, MOTION.pack(motion))
    return np.array(position)[:, 0], np.array(rotation), np.array(velocity)[:, 0]


def vee(A: np.ndarray) -> np.ndarray:
    return np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]]) / 2


def random_turn(seed: int, size: float) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    turn = rng.normal(size=(3, DEGREE + 1))
    return hold(HOME) | {"turn": size * turn, "polynomial": rng.normal(size=(3, DEGREE + 1))}


@pytest.mark.parametrize("size", [1e-9, 1e-4, 0.1, 1.0, 5.0])
@pytest.mark.parametrize("seed", range(4))
def test_the_velocity_is_the_slope_of_the_pose_on_the_manifold(seed: int, size: float) -> None:
    """Central differences at h err by h² of the third derivative and round-off / h."""
    motion, clock, h = random_turn(seed, size), 0.37, 1e-5
    (p0, R0, _), (p1, R1, _) = at(motion, clock - h), at(motion, clock + h)
    _, R, v = at(motion, clock)
    np.testing.assert_allclose(v[:3], (p1 - p0) / (2 * h), rtol=0, atol=1e-8)
    np.testing.assert_allclose(v[3:], vee((R1 - R0) @ R.T) / (2 * h), rtol=0, atol=1e-10 + 1e-6 * size**3)
    np.testing.assert_allclose(R @ R.T, np.eye(3), rtol=0, atol=1e-14)
    np.testing.assert_allclose(at(motion, clock, 0.3)[2], 0.3 * v, rtol=1e-14, atol=0)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-3, 0.999, 1.001, 3.0, 6.0, 20.0])
def test_the_coefficients_are_smooth_and_have_finite_slopes(size: float) -> None:
    """At no turn, at the change from series to closed form, and far beyond: as SciPy has it, and no 0/0."""
    axis = np.array([2.0, -1.0, 2.0]) / 3
    motion = hold(HOME)
    motion["turn"][:, 0], motion["turn"][:, 1] = size * axis, [0.3, 0.2, -0.5]
    _, R, velocity = at(motion, 0.0)
    np.testing.assert_allclose(
        R, Rotation.from_rotvec(size * axis).as_matrix() @ HOME.rotation, rtol=0, atol=4e-15
    )
    assert np.isfinite(np.array(SLOPE(0.0, 1.0, MOTION.pack(motion)))).all()
    h = 1e-5
    slope = (at(motion, h)[2] - at(motion, -h)[2]) / (2 * h)
    found = np.array(SLOPE(0.0, 1.0, MOTION.pack(motion)))[:, 0]
    np.testing.assert_allclose(found, slope, rtol=0, atol=1e-9)
    assert np.isfinite(velocity).all()


def test_numbers_and_symbols_are_the_same_motion() -> None:
    for seed in range(5):
        motion = random_turn(seed, 1.0) | {"horizon": np.asarray(0.8), "frequency": np.asarray(2.0)}
        for clock in (0.0, 0.3, 0.8, 2.0):
            position, rotation, velocity = at(motion, clock)
            pose = pose_at(motion, clock)
            np.testing.assert_allclose(position, pose.position, rtol=0, atol=1e-14)
            np.testing.assert_allclose(rotation, pose.rotation, rtol=0, atol=1e-14)
            assert clock < 0.8 or not velocity.any()


def test_a_minimum_jerk_turn_is_a_geodesic_half_way_at_half_time() -> None:
    turn = np.array([0.5, -1.2, 0.9])
    motion = minimum_jerk(HOME, [0.1, 0, -0.2], 2.0, turn)
    middle, end = pose_at(motion, 1.0), pose_at(motion, 5.0)
    np.testing.assert_allclose(
        middle.rotation, Rotation.from_rotvec(turn / 2).as_matrix() @ HOME.rotation, atol=1e-15
    )
    np.testing.assert_allclose(
        end.rotation, Rotation.from_rotvec(turn).as_matrix() @ HOME.rotation, atol=1e-15
    )
    for clock in np.linspace(0.1, 1.9, 7):
        omega = at(motion, clock)[2][3:]
        np.testing.assert_allclose(np.cross(omega, turn), 0, atol=1e-14)
        share = clock / 2
        speed = 15 * (share * (1 - share)) ** 2  # 30 τ² (1 − τ)² by τ, τ over 2 s
        np.testing.assert_allclose(omega, speed * turn, rtol=1e-12)
    for clock in (0.0, 2.0):
        assert not at(motion, clock)[2].any()
    np.testing.assert_allclose(np.array(SLOPE(1e-9, 1.0, MOTION.pack(motion))), 0, atol=1e-7)


def test_a_steady_turn_is_what_axis_and_rate_were() -> None:
    axis, rate = np.array([1.0, 2.0, -2.0]) / 3, 1.7
    motion = along(HOME, np.zeros(3), rate * axis, 1.0, LINEAR) | {"horizon": np.asarray(1e9)}
    K = np.cross(np.eye(3), axis)
    for clock in (0.0, 0.2, 1.0, 7.0):
        angle = rate * clock
        old = (np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)) @ HOME.rotation
        _, rotation, velocity = at(motion, clock)
        np.testing.assert_allclose(rotation, old, rtol=0, atol=1e-14)
        np.testing.assert_allclose(velocity[3:], rate * axis, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    "motion", [hold(HOME), circle(HOME, [1, 0, 0], [0, 1, 0], 0.1, 2.0), minimum_jerk(HOME, [0.1, 0, 0], 1.0)]
)
def test_what_does_not_turn_keeps_its_axes_to_the_last_bit(motion: Any) -> None:
    for clock in (0.0, 0.3, 4.0):
        _, rotation, velocity = at(motion, clock)
        np.testing.assert_array_equal(rotation, HOME.rotation)
        np.testing.assert_array_equal(pose_at(motion, clock).rotation, HOME.rotation)
        assert not velocity[3:].any()


def test_pieces_of_scipys_spline_of_rotations_are_motions() -> None:
    """R_i exp([v]) = exp([R_i v]) R_i, with v a cubic of the time."""
    times = np.array([0.0, 0.7, 1.5, 2.0])
    spline = RotationSpline(times, Rotation.from_rotvec(np.random.default_rng(0).normal(size=(4, 3))))
    for i, begin in enumerate(times[:-1]):
        start = spline(begin).as_matrix()
        motion = hold(Pose(np.zeros(3), start))
        motion["turn"][:, :4] = start @ spline.interpolator.c[::-1, i].T
        for clock in np.linspace(0, times[i + 1] - begin, 5)[:-1]:
            _, rotation, velocity = at(motion, clock)
            np.testing.assert_allclose(rotation, spline(begin + clock).as_matrix(), atol=1e-14)
            omega = rotation @ spline(begin + clock, 1)
            np.testing.assert_allclose(velocity[3:], omega, atol=1e-12)


def test_a_shifted_motion_begins_where_it_is_told_and_turns_about_the_same_axes() -> None:
    motion = random_turn(3, 1.0)
    start = Pose(np.array([1.0, 2.0, 3.0]), Rotation.from_rotvec([1.0, 0, 0.2]).as_matrix())
    there = shifted(motion, start)
    np.testing.assert_allclose(pose_at(there, 0.0).position, start.position, atol=1e-14)
    np.testing.assert_allclose(pose_at(there, 0.0).rotation, start.rotation, atol=1e-14)
    for clock in (0.2, 0.9):
        np.testing.assert_allclose(at(there, clock)[2], at(motion, clock)[2], atol=1e-13)


def test_rates_for_gives_the_velocity_and_acceleration_that_were_asked() -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        u, omega, alpha = rng.normal(size=(3, 3))
        du, ddu = rates_for(u, omega, alpha)
        motion = hold(HOME)
        motion["turn"][:, :3] = np.column_stack([u, du, ddu / 2])
        np.testing.assert_allclose(at(motion, 0.0)[2][3:], omega, atol=1e-13)
        slope = np.array(SLOPE(0.0, 1.0, MOTION.pack(motion)))[3:, 0]
        np.testing.assert_allclose(slope, alpha, atol=1e-12)


def test_no_turn_has_no_velocity_and_is_the_identity() -> None:
    u = cs.SX.sym("u", 3)
    f = cs.Function(
        "f", [u], [turned(u), angular_velocity(u, cs.SX.zeros(3)), cs.jacobian(cs.vec(turned(u)), u)]
    )
    R, omega, slope = (np.array(a) for a in f(np.zeros(3)))
    np.testing.assert_array_equal(R, np.eye(3))
    assert not omega.any()
    assert np.isfinite(slope).all()
