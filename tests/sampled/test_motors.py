"""Motors: limits that hold whatever is asked, and friction that only takes."""

from __future__ import annotations

from functools import lru_cache

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from loops import SEEDS
from passiflex.elements.friction import MotorFriction, friction
from passiflex.sampled.motors import UNLIMITED_TORQUE, limit_layout, limited

N = 3
EPSILON = np.finfo(float).eps
TORQUES = st.floats(-1e5, 1e5)
SPEEDS = st.floats(-1e3, 1e3)


@lru_cache
def limits() -> cs.Function:
    command, last, limit, rate = (cs.SX.sym(name, N) for name in ("command", "last", "limit", "rate"))
    elapsed = cs.SX.sym("elapsed")
    applied_torque = limited(command, last, limit, rate, elapsed)
    return cs.Function("limited", [command, last, limit, rate, elapsed], [applied_torque])


def limit(
    command: np.ndarray, last: np.ndarray, torque: np.ndarray | float, rate: np.ndarray | float, dt: float
) -> np.ndarray:
    return np.array(limits()(command, last, np.broadcast_to(torque, N), np.broadcast_to(rate, N), dt)).ravel()


@lru_cache
def rubbing() -> cs.Function:
    dtheta, coulomb, viscous, width = (
        cs.SX.sym(name, size) for name, size in {"v": N, "c": N, "d": N, "w": 1}.items()
    )
    return cs.Function(
        "friction", [dtheta, coulomb, viscous, width], [friction(dtheta, coulomb, viscous, width)]
    )


def rub(speed: np.ndarray, coulomb: np.ndarray, viscous: np.ndarray, width: float) -> np.ndarray:
    return np.array(rubbing()(speed, coulomb, viscous, width)).ravel()


@settings(max_examples=200, deadline=None)
@given(SEEDS, st.sampled_from([1e-9, 1e-3, 1.0]))
def test_the_torque_is_the_nearest_that_limit_and_rate_allow(seed: int, dt: float) -> None:
    """Joint by joint the projection of the command onto both intervals, from a torque within its limit."""
    rng = np.random.default_rng(seed)
    most, rate = rng.uniform(1, 300, N), 10 ** rng.uniform(0, 6, N)
    last, command = rng.uniform(-1, 1, N) * most, rng.normal(size=N) * 10 ** rng.uniform(-3, 6)
    ours = limit(command, last, most, rate, dt)
    low, high = np.maximum(-most, last - rate * dt), np.minimum(most, last + rate * dt)
    np.testing.assert_array_equal(ours, np.clip(command, low, high))
    assert (np.abs(ours) <= most).all()
    # Rounding of last ± step, and of the difference formed here.
    assert (np.abs(ours - last) <= rate * dt + 2 * EPSILON * (np.abs(last) + rate * dt)).all()


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_repeated_commands_never_pass_a_limit(seed: int) -> None:
    """A hundred random commands in a row, and missed periods in between."""
    rng = np.random.default_rng(seed)
    most, rate, last = rng.uniform(10, 100, N), rng.uniform(1e2, 1e5, N), np.zeros(N)
    commands = rng.normal(size=(100, N)) * 10 ** rng.uniform(0, 4, (100, 1))
    for command, periods in zip(commands, rng.integers(1, 4, 100), strict=True):
        now = limit(command, last, most, rate, periods * 1e-3)
        assert (np.abs(now) <= most).all()
        assert (np.abs(now - last) <= rate * periods * 1e-3 * (1 + 1e-12) + 1e-12).all()
        last = now


@pytest.mark.parametrize("periods", [1, 2, 7])
def test_a_step_is_a_ramp_of_the_time_that_passed(periods: int) -> None:
    """2000 N m/s: 2 N m per ms, and as many times that as periods passed; then it stays."""
    torques, last = [], np.zeros(N)
    for _ in range(10):
        last = limit(np.full(N, 50.0), last, 100.0, 2000.0, periods * 1e-3)
        torques.append(last)
    expected = np.minimum(2.0 * periods * np.arange(1, 11), 50.0)
    np.testing.assert_allclose(torques, np.tile(expected[:, None], N), rtol=0, atol=1e-13)


@given(st.lists(TORQUES, min_size=N, max_size=N), st.lists(TORQUES, min_size=N, max_size=N))
def test_without_limits_the_command_passes_to_the_last_bit(command: list[float], last: list[float]) -> None:
    asked = np.array(command)
    off = limit(asked, np.array(last), UNLIMITED_TORQUE, UNLIMITED_TORQUE, 1e-3)
    np.testing.assert_array_equal(off, asked)
    wide = limit(asked, np.array(last), 1e5, 1e9, 1e-3)
    np.testing.assert_array_equal(wide, asked)


def test_each_limit_works_without_the_other() -> None:
    last, command = np.array([0.0, 20.0, -20.0]), np.array([500.0, -500.0, 3.0])
    np.testing.assert_array_equal(limit(command, last, 100.0, UNLIMITED_TORQUE, 1e-3), [100, -100, 3])
    np.testing.assert_array_equal(limit(command, last, UNLIMITED_TORQUE, 1000.0, 1e-3), [1, 19, -19])
    np.testing.assert_array_equal(limit(command, last, [5.0, 30.0, 30.0], [1e4, 1e4, 1e12], 1e-3), [5, 10, 3])


def test_a_torque_beyond_its_limit_comes_back_at_once() -> None:
    """What holds the arm at the start may be more than the limit, which then goes before the rate."""
    np.testing.assert_array_equal(
        limit(np.full(N, 90.0), np.full(N, 90.0), 50.0, 1.0, 1e-3), np.full(N, 50.0)
    )


@given(
    st.lists(SPEEDS, min_size=N, max_size=N),
    SEEDS,
    st.sampled_from([1e-9, 1e-4, 1e-2, 10.0]),
)
def test_friction_never_gives_power_and_is_odd(speed: list[float], seed: int, width: float) -> None:
    """Each entry has the sign of its speed, at any speed and width, and is 0 at rest."""
    rng, v = np.random.default_rng(seed), np.array(speed)
    coulomb, viscous = rng.choice([0.0, rng.uniform(0, 50)], N), rng.choice([0.0, rng.uniform(0, 50)], N)
    torque = rub(v, coulomb, viscous, width)
    assert (torque * v >= 0).all()
    np.testing.assert_array_equal(rub(-v, coulomb, viscous, width), -torque)
    assert not rub(np.zeros(N), coulomb, viscous, width).any()
    assert (np.abs(torque) <= (coulomb + viscous * np.abs(v)) * (1 + 4 * EPSILON)).all()
    if not (coulomb.any() or viscous.any()):
        assert not torque.any()


def test_coulomb_friction_saturates() -> None:
    """f_c tanh(v/w): f_c / w at rest, f_c (1 − 2 e^(−20)) at ten widths, whatever the speed."""
    coulomb, width = np.array([3.0, 11.6, 0.5]), 0.01
    for v in (0.1, 1.0, 1e3):
        torque = rub(np.full(N, v), coulomb, np.zeros(N), width)
        np.testing.assert_allclose(torque, coulomb, rtol=5e-9, atol=0)
    slow = 1e-6 * width
    np.testing.assert_allclose(
        rub(np.full(N, slow), coulomb, np.zeros(N), width) / slow, coulomb / width, rtol=1e-9
    )
    at_width = rub(np.full(N, width), coulomb, np.zeros(N), width)
    np.testing.assert_allclose(at_width, np.tanh(1) * coulomb, rtol=1e-14)


def test_viscous_friction_is_linear() -> None:
    viscous, v = np.array([14.4, 0.3, 2.0]), np.array([-0.5, 7.0, 1e-9])
    np.testing.assert_array_equal(rub(v, np.zeros(N), viscous, 0.01), viscous * v)


def test_layouts_name_what_the_functions_take() -> None:
    assert [f.size for f in limit_layout(N)] == [N, N]
    assert [(f.name, f.size) for f in MotorFriction().parameters(N)] == [
        ("coulomb_friction", N),
        ("viscous_friction", N),
        ("friction_width", 1),
    ]
