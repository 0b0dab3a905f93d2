"""Where τ_e comes from: the observer against its closed form on moving arms, and the simple choices."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from loops import GRAVITY, SEEDS, robots
from passiflex.control import Measurement
from passiflex.robots.arm import SerialArm
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.sampled.external import (
    REGULAR,
    AbstractExternalTorque,
    Known,
    MeasuredWrench,
    MomentumObserver,
    NoTorque,
    TrueTorque,
)

BANDWIDTH, DURATION = 40.0, 0.2
ROUND = 1e-9
"""Δp/Δt is a difference of numbers of about 10 N m s, over 1 ms: 1e-15 · 10 / 1e-3 = 1e-11 N m per sample."""


class Motion(NamedTuple):
    """An arm along q(t) = a + b sin(ω t + c), as it is measured at the given instants; τ_a makes it so."""

    q: np.ndarray
    dq: np.ndarray
    tau_a: np.ndarray
    elapsed: np.ndarray


@lru_cache(maxsize=8)
def inverse_dynamics(arm: SerialArm) -> cs.Function:
    """Return (q, q̇, q̈) → M q̈ + C q̇ + ∇V, M, J."""
    q, dq, ddq = (cs.SX.sym(name, arm.n) for name in ("q", "dq", "ddq"))
    m = arm.layout.view(cs.SX(arm.layout.pack(arm.nominal(GRAVITY))))
    M = arm.mass_matrix(q, m)
    return cs.Function("torque", [q, dq, ddq], [M @ ddq + arm.bias_torque(q, dq, m), M, arm.jacobian(q, m)])


@lru_cache(maxsize=16)
def estimate(external: AbstractExternalTorque, arm: SerialArm) -> cs.Function:
    """Return (state, q, q̇, τ_a, F_e, τ_e, elapsed, ω, m) → state, τ_e, F_e, the rest of the measurement."""
    vector, m = arm.layout.symbols("m")
    state, s = external.state(arm.n).symbols("state")
    q, dq, tau_a, tau_e = (cs.SX.sym(name, arm.n) for name in ("q", "dq", "tau_a", "tau_e"))
    F_e, elapsed, bandwidth = cs.SX.sym("F_e", 6), cs.SX.sym("elapsed"), cs.SX.sym("bandwidth")
    y = Measurement(q, q + 1, dq, dq + 1, tau_a, F_e, tau_e)
    out, after = external.estimate(y, elapsed, Known(arm, m, bandwidth), s)
    rest = cs.vertcat(out.q, out.theta - 1, out.dq, out.dtheta - 1, out.tau_a)
    inputs = [state, q, dq, tau_a, F_e, tau_e, elapsed, bandwidth, vector]
    return cs.Function("estimate", inputs, [after, out.tau_e, out.F_e, rest], {"cse": True})


def moved(arm: SerialArm, seed: int, elapsed: np.ndarray, push: np.ndarray, speed: float = 10.0) -> Motion:
    """Return a motion under the constant joint torque τ_e = `push`."""
    rng, time = np.random.default_rng(seed), np.cumsum(elapsed) - elapsed[0]
    a, b, c = rng.uniform(-2, 2, arm.n), rng.uniform(0.2, 0.5, arm.n), rng.uniform(0, 6, arm.n)
    w = rng.uniform(0.5, 1, arm.n) * speed
    phase = np.outer(time, w) + c
    q, dq, ddq = a + b * np.sin(phase), b * w * np.cos(phase), -b * w**2 * np.sin(phase)
    torque = inverse_dynamics(arm)(q.T, dq.T, ddq.T)[0]
    return Motion(q, dq, np.array(torque).T - push, elapsed)


def observed(arm: SerialArm, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Return τ_e and F_e of the observer along a motion; the sensor's own τ_e and F_e are noise to it."""
    f, m = estimate(MomentumObserver(), arm), arm.layout.pack(arm.nominal(GRAVITY))
    state, length = np.zeros(MomentumObserver().state(arm.n).size), len(motion.q)
    fixed = (np.full((6, length), 99.0), np.full((arm.n, length), 99.0), motion.elapsed[None])
    many = np.tile(m[:, None], length)
    columns = (motion.q.T, motion.dq.T, motion.tau_a.T)
    _, tau_e, F_e, rest = f.mapaccum(length)(state, *columns, *fixed, np.full((1, length), BANDWIDTH), many)
    q, dq, tau_a = columns
    np.testing.assert_allclose(
        rest, np.vstack([q, q, dq, dq, tau_a]), rtol=0, atol=1e-13 * (1 + np.abs(dq).max())
    )
    return np.array(tau_e).T, np.array(F_e).T


@settings(max_examples=12, deadline=None)
@given(robots(1, 3), SEEDS)
def test_a_constant_push_is_found_with_the_time_constant(robot: FlexibleJointRobot, seed: int) -> None:
    """1 − exp(−ω t) of it, to rounding beyond what the motion alone is taken for; with missed periods too."""
    arm, rng = robot.arm, np.random.default_rng(seed)
    push = rng.uniform(-20, 20, arm.n)
    for elapsed in (np.full(200, 1e-3), 1e-3 * rng.integers(1, 4, 100)):
        with_push, without = (observed(arm, moved(arm, seed, elapsed, p))[0] for p in (push, 0 * push))
        time = np.cumsum(elapsed) - elapsed[0]
        expected = -np.expm1(-BANDWIDTH * time)[:, None] * push
        np.testing.assert_allclose(with_push - without, expected, rtol=0, atol=ROUND)
    at_time_constant = round(1000 / BANDWIDTH)
    found = (observed(arm, moved(arm, seed, np.full(200, 1e-3), push, speed=0.1))[0])[at_time_constant]
    np.testing.assert_allclose(found, (1 - np.exp(-1)) * push, rtol=0, atol=1e-4)


@settings(max_examples=12, deadline=None)
@given(robots(1, 3), SEEDS)
def test_motion_alone_is_nothing_but_the_trapeziums_error(robot: FlexibleJointRobot, seed: int) -> None:
    """Without a push the estimate is O(Δt²): four times smaller for half the period."""
    arm, errors = robot.arm, []
    for count in (100, 200, 400):
        elapsed = np.full(count, DURATION / count)
        errors.append(np.abs(observed(arm, moved(arm, seed, elapsed, np.zeros(arm.n)))[0]).max())
    orders = -np.diff(np.log2(errors))
    np.testing.assert_allclose(orders[-1], 2, atol=0.1)


@settings(max_examples=8, deadline=None)
@given(robots(1, 3), SEEDS)
def test_an_arm_at_rest_feels_its_push_from_the_second_sample(robot: FlexibleJointRobot, seed: int) -> None:
    """No spike at the first sample, however the arm moves then; at rest the closed form holds to rounding."""
    arm, push = robot.arm, np.random.default_rng(seed).uniform(-20, 20, robot.n)
    for speed in (0.0, 30.0):
        tau_e, F_e = observed(arm, moved(arm, seed, np.full(50, 1e-3), push, speed))
        assert not tau_e[0].any()
        assert not F_e[0].any()
        if speed == 0:
            rise = -np.expm1(-BANDWIDTH * 1e-3 * np.arange(50))[:, None]
            np.testing.assert_allclose(tau_e, rise * push, rtol=0, atol=1e-11)


@settings(max_examples=12, deadline=None)
@given(robots(1, 4), SEEDS)
def test_the_observed_wrench_is_the_observed_torque(robot: FlexibleJointRobot, seed: int) -> None:
    """F_e = J̄ᵀ τ_e: Jᵀ F_e misses at most ε / (ε + λ) of τ_e, in the norm of M⁻¹, λ the least mobility.

    And where more rows than joints leave F_e open, J̄ᵀ chooses the one that does nothing beside: F_e = A x for the
    mobility A, so F_e is in the range of J.
    """
    arm, push = robot.arm, np.random.default_rng(seed).uniform(-20, 20, robot.n)
    motion = moved(arm, seed, np.full(40, 1e-3), push, 0.1)
    tau_e, F_e = observed(arm, motion)
    _, M, J = (np.array(v) for v in inverse_dynamics(arm)(motion.q[-1], motion.dq[-1], np.zeros(arm.n)))
    half = np.linalg.inv(np.linalg.cholesky(M))  # M⁻¹ = halfᵀ half
    mobility = np.linalg.eigvalsh(half @ J.T @ J @ half.T)
    missing = half @ (J.T @ F_e[-1] - tau_e[-1])
    size = np.linalg.norm(half @ tau_e[-1])
    share = REGULAR / (REGULAR + max(mobility[0], 0))
    round_off = 1e-15 * np.linalg.cond(M) * mobility[-1] / REGULAR
    assert np.linalg.norm(missing) <= (share + round_off) * size
    outside = F_e[-1] - J @ np.linalg.lstsq(J, F_e[-1], rcond=None)[0]
    assert np.linalg.norm(outside) <= round_off * np.linalg.norm(F_e[-1])


@settings(max_examples=8, deadline=None)
@given(robots(1, 3), SEEDS)
def test_choices_without_memory(robot: FlexibleJointRobot, seed: int) -> None:
    """The truth is left alone, the sensor's wrench is Jᵀ F_e, and none is none; the rest passes to the last bit."""
    arm, rng = robot.arm, np.random.default_rng(seed)
    q, dq, tau_a, tau_e = rng.normal(size=(4, arm.n))
    F_e, m = rng.normal(size=6), arm.layout.pack(arm.nominal(GRAVITY))
    J = np.array(inverse_dynamics(arm)(q, dq, dq)[2])
    expected = {TrueTorque(): (tau_e, F_e), NoTorque(): (0 * q, 0 * F_e), MeasuredWrench(): (J.T @ F_e, F_e)}
    for external, (torque, wrench) in expected.items():
        assert external.state(arm.n).size == 0
        out = estimate(external, arm)([], q, dq, tau_a, F_e, tau_e, 1e-3, BANDWIDTH, m)
        state, ours, felt, rest = (np.array(v).ravel() for v in out)
        assert state.size == 0
        if isinstance(external, MeasuredWrench):
            np.testing.assert_allclose(ours, torque, rtol=0, atol=1e-13)
        else:
            np.testing.assert_array_equal(ours, torque)
        np.testing.assert_array_equal(felt, wrench)
        np.testing.assert_allclose(rest, np.concatenate([q, q, dq, dq, tau_a]), rtol=0, atol=1e-15)


@pytest.mark.parametrize("pole", [1.0, 100.0, 1e9])
@given(st.integers(0, 20))
def test_the_bandwidth_is_a_run_time_number(pole: float, seed: int) -> None:
    """At rest under a push that begins at once; without a filter it is known after one period."""
    arm = planar()
    f, m = estimate(MomentumObserver(), arm), arm.layout.pack(arm.nominal(GRAVITY))
    push = np.random.default_rng(seed).uniform(-20, 20, 2)
    motion = moved(arm, seed, np.full(2, 1e-3), push, 0.0)
    state = np.zeros(MomentumObserver().state(2).size)
    for q, tau_a in zip(motion.q, motion.tau_a, strict=True):
        state, tau_e, _, _ = f(state, q, 0, tau_a, 0, 0, 1e-3, pole, m)
    share = 1.0 if pole == 1e9 else -np.expm1(-pole * 1e-3)
    np.testing.assert_allclose(np.array(tau_e).ravel(), share * push, rtol=0, atol=1e-11)


@lru_cache
def planar() -> SerialArm:
    return FlexibleJointRobot.load("planar2r").arm
