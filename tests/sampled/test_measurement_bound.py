"""The bound beside the level: each declared error against its closed form or the truth that it hides, one by one."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from loops import SEEDS
from passiflex.layout import Field, Layout
from passiflex.sampled.declared_errors import error_layout
from passiflex.sampled.measurement_bound import (
    BEND,
    SIGMAS,
    booked_bound,
    bound_state,
    sure,
    sure_state,
)
from passiflex.sampled.readings import EXACT, Paired, Readings
from passiflex.sampled.sensors import UNFILTERED

N, T = 2, 1e-3
NONE = {f.name: np.zeros(f.shape) for f in error_layout(N)} | {"torque_bandwidth": UNFILTERED, "period": T}
LAST = Layout((Field("last_q", (N,), "rad"), Field("last_tau_a", (N,), "N m"), Field("running", (), "1")))


def state_of(readings: Readings) -> Layout:
    return LAST + bound_state(N, replace(readings, link=0, torque=0, paired=0)) + sure_state(N, readings)


@lru_cache
def booking(length: int, readings: Readings) -> cs.Function:
    """Return (state, q, τ_a, elapsed, whether the level is sure, errors) → (state, E, lowered), in a row.

    What is late is paired already.
    """
    state, s = state_of(readings).symbols("state")
    vector, e = error_layout(N).symbols("e")
    q, tau, elapsed, is_sure = cs.SX.sym("q", N), cs.SX.sym("tau", N), cs.SX.sym("dt"), cs.SX.sym("sure")
    y = Paired(q, tau, elapsed, {"storage_jitter": cs.SX(0)} if readings.noisy else {})
    bound = booked_bound(y, elapsed, s.running < 1, s, e, readings)
    after = {"last_q": q, "last_tau_a": tau, "running": 1} | bound.state
    after |= sure(is_sure, q, s, bound.state | {"measurement_bound": bound.lasting})
    outputs = [state_of(readings).stack(after), bound.total, bound.lowered]
    return cs.Function("book", [state, q, tau, elapsed, is_sure, vector], outputs).mapaccum(length)


def booked(
    q: np.ndarray,
    tau: np.ndarray,
    elapsed: np.ndarray | float = T,
    is_sure: np.ndarray | float = 1.0,
    readings: Readings = EXACT,
    **errors: Any,
) -> SimpleNamespace:
    """Return the fields of the state after each reading (length, N), with E and `lowered`."""
    n = len(q)
    values = NONE | {name: np.broadcast_to(v, np.shape(NONE[name])) for name, v in errors.items()}
    numbers = np.tile(error_layout(N).pack(values)[:, None], n)
    rows = [np.broadcast_to(x, n)[None] for x in (elapsed, is_sure)]
    layout = state_of(readings)
    states, total, lowered = booking(n, readings)(np.zeros(layout.size), q.T, tau.T, *rows, numbers)
    fields = layout.unpack(np.array(states).T)
    return SimpleNamespace(**fields, total=np.array(total).ravel(), lowered=np.array(lowered).ravel())


def works(q: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Return Σw of each joint by each reading (length, N)."""
    w = (tau[1:] + tau[:-1]) / 2 * np.diff(q, axis=0)
    return np.vstack([np.zeros(N), np.cumsum(w, axis=0)])


def walked(seed: int, length: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Return a random q and τ_a (length, N), each joint a sum of four sines of 0.3 to 8 Hz."""
    rng, t = np.random.default_rng(seed), np.arange(length) * T

    def waves() -> np.ndarray:
        size, frequency, phase = (
            rng.normal(size=(4, N, 1)),
            rng.uniform(0.3, 8, (4, N, 1)),
            rng.uniform(0, 6, (4, N, 1)),
        )
        return (size * np.sin(2 * np.pi * frequency * t + phase)).sum(axis=0).T

    return 0.3 * waves(), 8 * waves()


def test_nothing_is_booked_for_what_is_read_exactly() -> None:
    """Where τ_a and q move on straight lines the trapezoid is exact from the third reading on, and E stands still."""
    t = np.arange(100)[:, None] * T
    out = booked(0.4 * t + [0.1, -2], [3, -5] + 2 * t, bend=BEND)
    assert out.total[0] == 0
    np.testing.assert_allclose(out.total[1:], out.total[1], rtol=1e-9)
    assert out.total[1] <= SIGMAS * BEND * 2 * (2 * T * 0.4 * T) * N
    assert not booked(0.4 * t + [0.1, -2], [3, -5] + 2 * t).total.any()


@settings(deadline=None, max_examples=20)
@given(SEEDS)
def test_a_constant_offset_is_booked_by_the_net_displacement_alone(seed: int) -> None:
    """E = Σ oᵢ |qᵢ − qᵢ,0|, to round-off the error that the worst signs make; back at the start it is 0 again."""
    q, tau = walked(seed)
    o = np.random.default_rng(seed).uniform(0, 2, N)
    q = np.vstack([q, q[::-1]])
    tau = np.vstack([tau, tau])
    out = booked(q, tau, torque_offset=o)
    np.testing.assert_allclose(out.total, np.abs(q - q[0]) @ o, rtol=0, atol=1e-13)
    assert out.total[-1] == 0
    signs = -np.sign(q - q[0])  # of each row for itself
    error = (works(q, tau) - np.array([works(q, tau + o * s)[k] for k, s in enumerate(signs)])).sum(axis=1)
    np.testing.assert_allclose(out.total, error, rtol=0, atol=1e-9)


@pytest.mark.parametrize("signs", [(1, 1), (-1, 1), (-1, -1)])
def test_a_scale_error_is_booked_by_the_net_work_of_each_joint(signs: tuple[int, int]) -> None:
    """∫ τ dq − Σw = −s/(1+s) Σw, joint by joint; what is booked is that of −s, and no more."""
    s, (q, tau) = np.array([0.03, 0.05]), walked(3)
    read = tau * (1 + s * signs)
    error = works(q, tau) - works(q, read)
    out = booked(q, read, torque_scale=s)
    assert (error.sum(axis=1) <= out.total + 1e-12).all()
    most = np.abs(works(q, read)) @ s / (1 - s.max())
    np.testing.assert_allclose(out.total, most, rtol=1e-12, atol=1e-15)


@settings(deadline=None, max_examples=20)
@given(SEEDS, st.floats(20, 4000))
def test_what_a_low_pass_withholds_is_known_exactly(seed: int, pole: float) -> None:
    """The readings of a first-order low-pass are undone, so that E is Σw of the torque itself less Σw, if positive."""
    q, tau = walked(seed)
    read = [tau[0]]
    for now in tau[1:]:
        read.append(read[-1] + -np.expm1(-pole * T) * (now - read[-1]))
    read = np.array(read)
    short = works(q, tau).sum(axis=1) - works(q, read).sum(axis=1)
    out = booked(q, read, torque_bandwidth=pole)
    np.testing.assert_allclose(out.withheld_energy, short, rtol=0, atol=1e-9)
    np.testing.assert_allclose(out.total, np.maximum(short, 0), rtol=0, atol=1e-9)
    np.testing.assert_allclose(out.joint_work, works(q, tau), rtol=0, atol=1e-9)


@pytest.mark.parametrize("lasting", [1, 4, 20])
def test_noise_is_booked_by_its_variance(lasting: int) -> None:
    """Noise that lasts L periods makes L times the variance of white noise, at a constant speed: σ Δt |q̇| √(K L).

    What is booked is that, or up to a fifth more where L is small; 400 draws have it within the 99.8 % of χ².
    """
    length, sigma, speed = 400, 0.4, np.array([0.5, -0.2])
    q, rng = speed * (np.arange(length)[:, None] * T), np.random.default_rng(5)
    out = booked(q, np.zeros((length, N)), noise_deviation=sigma, noise_hold=lasting * T)
    expected = sigma * T * np.linalg.norm(speed) * np.sqrt(length * lasting)
    assert 0.99 * expected < out.total[-1] / SIGMAS < 1.2 * expected
    noise = np.repeat(rng.normal(0, sigma, (400, length // lasting, N)), lasting, axis=1)
    errors = np.array([works(q, n)[-1].sum() for n in noise])
    low, high = stats.chi2.ppf([1e-3, 1 - 1e-3], 400) / 400
    assert low < np.mean((errors / expected) ** 2) < high


@settings(deadline=None, max_examples=30)
@given(SEEDS, st.sampled_from([1e-5, 1e-4, 1e-3]))
def test_the_steps_of_an_encoder_are_booked(seed: int, step: float) -> None:
    """The error of quantised readings stays below the bound at every reading, from rest or not."""
    q, tau = walked(seed)
    read = step * np.round(q / step)
    error = works(q, tau).sum(axis=1) - works(read, tau).sum(axis=1)
    assert (error <= booked(read, tau, link_resolution=step).total + 1e-12).all()


@pytest.mark.parametrize("per_cycle", [3, 4, 6, 12])
@pytest.mark.parametrize("phase", [-2.5, -0.7, 0.7, 2.5])
def test_what_bends_between_two_readings_is_booked(per_cycle: int, phase: float) -> None:
    """A vibration of x rad per period gives x / sin x times what trapezoids see; the bound knows it at any reading."""
    x = 2 * np.pi / per_cycle
    k = np.arange(300)[:, None]
    q, tau = np.sin(x * k + [0, 1.0]), 5 * np.cos(x * k + [phase, 1.0 + phase])
    seen = works(q, tau).sum(axis=1)
    # ∫ τ dq over x(k) exactly: 5 ∫ cos(u + p) cos u du, for both joints, u from their own starts.
    u = np.array([x * k + start for start in (0.0, 1.0)])[..., 0]
    integral = 2.5 * (u * np.cos(phase) + np.sin(2 * u + phase) / 2)
    true = (integral - integral[:, :1]).sum(axis=0)
    out = booked(q, tau, bend=BEND)
    assert (true - seen <= out.total + 1e-12).all()
    assert out.total[-1] < 3 * np.abs(true - seen).max() + 200  # of some 1000 J that went to and fro


def test_a_gap_counts_its_bend_in_full() -> None:
    """After missed periods the bend is not taken for random: BEND (|δΔτ||Δq| + |Δτ||δΔq|) adds up, gap by gap."""
    q = np.zeros((9, N))
    q[:, 0] = [0, 0, 1, 1, 1, 3, 3, 3, 3]
    tau = np.zeros((9, N))
    tau[5:, 0] = 2.0
    elapsed = np.array([1, 1, 1, 1, 1, 4, 1, 1, 1]) * T
    out = booked(q, tau, elapsed, bend=BEND)
    assert out.unread_energy[-1] == pytest.approx(
        BEND * (2 * 2 + 2 * 2)
    )  # it moved by 2 under a torque new by 2
    assert out.unread_energy[4] == 0
    assert out.read_time[-1] == pytest.approx(elapsed[1:].sum())


def test_what_lowers_a_level_counts_from_when_it_last_was_sure() -> None:
    """The sensors' part of the bound begins anew at each sure period, and E of that period is remembered."""
    q, tau = walked(8)
    flags = np.where(np.arange(len(q)) < 200, 1.0, 0.0)
    errors = {"torque_offset": 0.3, "noise_deviation": 0.4, "noise_hold": T, "bend": BEND}
    out = booked(q, tau, is_sure=flags, **errors)
    assert (out.sure_measurement_bound[200:] == out.total[199]).all()
    walk = np.sqrt(out.walk[200:] - out.walk[199])
    expected = SIGMAS * walk + 0.3 * np.abs(q[200:] - q[199]).sum(axis=1)
    np.testing.assert_allclose(out.lowered[200:], expected, rtol=1e-9, atol=1e-12)
    assert out.lowered[201] < 0.1 * out.total[201]


@settings(deadline=None, max_examples=20)
@given(SEEDS)
def test_noise_that_outlasts_the_run_is_an_offset(seed: int) -> None:
    """From its first moment on: a draw of σ on each joint errs by nᵀ (q − q₀), within 5 σ of what is booked."""
    q, _ = walked(seed)
    n = np.random.default_rng(seed).normal(0, 0.4, N)
    error = -(q - q[0]) @ n
    out = booked(q, np.tile(n, (len(q), 1)), noise_deviation=0.4, noise_hold=100.0)
    assert (error <= out.total + 1e-12).all()
    five = SIGMAS * 0.4 * np.linalg.norm((q - q[0])[:100], axis=1)
    assert (out.total[:100] >= 0.99 * five).all()
    # At most what the text of the module adds to it: ½ (q_k+1 − q_k−1) per reading, or its share of the way if more.
    dq = np.diff(q[:100], axis=0, prepend=q[:1])
    before = np.vstack([np.zeros((1, N)), dq[:-1]])
    way = np.maximum.accumulate(five) ** 2
    walk = np.maximum((SIGMAS * 0.4) ** 2 * (((dq + before) / 2) ** 2).sum(axis=1), 2 * T / 100 * way)
    assert (out.total[:100] <= 1.001 * np.sqrt(way + np.cumsum(walk)) + 1e-12).all()


def test_noise_on_q_is_booked_by_how_far_the_torque_went() -> None:
    """By parts the noise of a reading multiplies ½ (τ_k+1 − τ_k−1), and the torque itself at both ends.

    Under a torque that turns with time the 400 draws' variance is within the 99.8 % of χ² of that, and E five
    deviations of it, or up to a fifth more; under none nothing is booked but a bend that noise does not explain.
    """
    length, sigma, noisy = 300, 1e-4, Readings(noisy=True)
    t, rng = np.arange(length)[:, None] * T, np.random.default_rng(5)
    tau = 20 * np.sin(40 * t + [0, 1.0]) - 20 * np.sin([0, 1.0])  # it begins at 0
    noise = rng.normal(0, sigma, (400, length, N))
    errors = np.array([works(n, tau)[-1].sum() for n in noise])
    a = (tau[1:] + tau[:-1]) / 2
    expected = sigma * np.sqrt((a[0] ** 2).sum() + (np.diff(a, axis=0) ** 2).sum() + (a[-1] ** 2).sum())
    low, high = stats.chi2.ppf([1e-3, 1 - 1e-3], 400) / 400
    assert low < np.mean((errors / expected) ** 2) < high
    out = booked(noise[0], tau, readings=noisy, link_deviation=sigma)
    assert (
        0.97 < out.total[-1] / (SIGMAS * expected) < 1.2
    )  # the last torque in place of the mean of the last two
    for n in noise[:20]:
        assert (
            -works(n, tau).sum(axis=1) <= booked(n, tau, readings=noisy, link_deviation=sigma).total
        ).all()
    still = booked(noise[0], np.zeros((length, N)), readings=noisy, link_deviation=sigma, bend=BEND)
    assert not still.total.any()
    tired = booked(noise[0], tau, readings=noisy, noise_debit=0.3, is_sure=np.arange(length) < 100)
    assert tired.lowered[-1] == pytest.approx(0.3 * 200 * T)


def test_what_passes_while_a_sensor_is_late_is_booked_for_a_steady_motion() -> None:
    """At constant torque and speed `late` periods of the power, and no more; nothing at rest, whatever the torque."""
    late, speed, torque = 4.0, np.array([0.3, -0.2]), np.array([5.0, 7.0])
    q, tau = speed * (np.arange(50)[:, None] * T), np.tile(torque, (50, 1))
    readings = Readings(torque=4, link=4)
    out = booked(q, tau, readings=readings, late=late)
    assert out.total[-1] == pytest.approx(late * T * np.abs(speed) @ torque, rel=1e-9)
    assert not booked(0 * q, tau, readings=readings, late=late).total.any()
    assert not out.sure_measurement_bound.any()  # a guess that comes and goes: the fallback does not go by it
    assert not booked(q, tau, late=late).total.any()


def test_a_gap_that_comes_late_is_still_a_gap() -> None:
    """Between two readings a gap may be shared out: whatever is longer than a period has its bends in full."""
    q, tau = walked(2, 40)
    elapsed = np.full(40, T)
    elapsed[20:22] = 1.4 * T
    readings = Readings(torque=1, link=1)
    shared = booked(q, tau, elapsed, readings=readings, bend=BEND, late=1.0)
    assert shared.unread_energy[19] == 0
    assert shared.unread_energy[21] > shared.unread_energy[20] > 0
    assert booked(q, tau, elapsed, bend=BEND).unread_energy[-1] == 0
