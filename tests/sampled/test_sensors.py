"""Sensors: each effect against its closed form, their order, and nothing at all where they are off."""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from loops import SEEDS
from passiflex.control import Measurement
from passiflex.sampled.readings import Readings
from passiflex.sampled.sensors import UNFILTERED, Noise, Sensors, difference, low_pass, quantised

N, PERIOD = 2, 1e-3
SENSORS = Sensors(N)
SIZES = (N, N, N, N, N, 6, N)
OFF = {
    "torque_scale": np.zeros(N),
    "torque_offset": np.zeros(N),
    "link_offset": np.zeros(N),
    "motor_offset": np.zeros(N),
    "link_resolution": 0.0,
    "motor_resolution": 0.0,
    "velocity_differences": 0.0,
    "velocity_bandwidth": UNFILTERED,
    "torque_bandwidth": UNFILTERED,
    "wrench_bandwidth": UNFILTERED,
    **dict.fromkeys(["link_late", "motor_late", "torque_late", "wrench_late"], 0.0),
}
EPSILON = np.finfo(float).eps


@lru_cache
def scalar(name: str) -> cs.Function:
    """Return one of the three effects as a function of numbers."""
    effect = {"quantised": quantised, "low_pass": low_pass, "difference": difference}[name]
    symbols = [cs.SX.sym(f"x{i}") for i in range({"quantised": 2, "low_pass": 4, "difference": 3}[name])]
    return cs.Function(name, symbols, [effect(*symbols)])


def each(name: str, *arguments: np.ndarray | float) -> np.ndarray:
    """Return an effect at every entry of the arguments."""
    rows = np.broadcast_arrays(*arguments)
    return np.array(scalar(name)(*(np.atleast_2d(row) for row in rows))).reshape(rows[0].shape)


def filtered(values: np.ndarray, bandwidth: float, elapsed: np.ndarray | float) -> np.ndarray:
    """Return the low-pass of a sequence, from 0."""
    steps = np.broadcast_to(elapsed, values.shape)
    run = scalar("low_pass").mapaccum(values.size)
    return np.array(run(0.0, values[None], bandwidth, steps[None])).ravel()


@lru_cache
def sensors(length: int) -> cs.Function:
    """Return (state, truth, noise, elapsed, parameters) → (state, reading), in a row."""
    truth = cs.SX.sym("truth", sum(SIZES))
    noise, elapsed = cs.SX.sym("noise", N), cs.SX.sym("elapsed")
    state, s = SENSORS.state.symbols("state")
    vector, g = SENSORS.layout.symbols("g")
    parts = Measurement(*cs.vertsplit(truth, np.cumsum([0, *SIZES]).tolist()))
    reading = SENSORS.read(parts, Noise(noise), elapsed, s, g)
    outputs = [reading.state, cs.densify(cs.vertcat(*reading.measured))]
    return cs.Function("read", [state, truth, noise, elapsed, vector], outputs).mapaccum(length)


def read(
    truth: np.ndarray,
    noise: np.ndarray | float = 0.0,
    elapsed: np.ndarray | float = PERIOD,
    **effects: float | np.ndarray,
) -> Measurement:
    """Return the readings of a sequence of measurements (length, 18), each (length, size)."""
    length = len(truth)
    noise, elapsed = np.broadcast_to(noise, (length, N)), np.broadcast_to(elapsed, length)
    numbers = SENSORS.layout.pack(OFF | effects)
    _, out = sensors(length)(np.zeros(SENSORS.state.size), truth.T, noise.T, elapsed[None], numbers)
    return Measurement(*np.split(np.array(out).T, np.cumsum(SIZES)[:-1], axis=1))


def split(truth: np.ndarray) -> Measurement:
    return Measurement(*np.split(truth, np.cumsum(SIZES)[:-1], axis=1))


def moving(rng: np.random.Generator, time: np.ndarray, degree: int = 1) -> np.ndarray:
    """Return measurements along which q and θ move on a polynomial, and the rest is random but constant."""
    truth = np.tile(rng.normal(size=sum(SIZES)), (time.size, 1))
    powers = time[:, None, None] ** np.arange(degree + 1)
    slopes = np.arange(1, degree + 1) * powers[..., :-1]
    c = rng.uniform(-1, 1, (2 * N, degree + 1))
    truth[:, : 2 * N] = (powers * c).sum(axis=2)
    truth[:, 2 * N : 4 * N] = (slopes * c[:, 1:]).sum(axis=2)
    return truth


@given(st.floats(-1e3, 1e3), st.floats(1e-6, 10))
def test_a_resolution_makes_the_nearest_multiple(value: float, step: float) -> None:
    """|error| ≤ step/2, a whole multiple, and the same once more to the last bit."""
    (once,) = each("quantised", np.array([value]), step)
    assert abs(once - value) <= step / 2 * (1 + 4 * EPSILON) + 4 * EPSILON * abs(value)
    assert once == step * round(once / step)
    assert each("quantised", np.array([once]), step)[0] == once


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_no_resolution_leaves_the_value(value: float) -> None:
    np.testing.assert_array_equal(each("quantised", np.array([value]), 0.0), [value])


@settings(deadline=None)
@given(SEEDS, st.floats(1, 1e4))
def test_a_step_through_the_low_pass_is_its_closed_form_for_any_periods(seed: int, pole: float) -> None:
    """1 − exp(−ω t), exact for held values, whatever the lengths of the periods. Rounding: ε per sample."""
    elapsed = np.random.default_rng(seed).uniform(0, 3e-3, 50)
    ours = filtered(np.ones(50), pole, elapsed)
    np.testing.assert_allclose(ours, -np.expm1(-pole * np.cumsum(elapsed)), rtol=0, atol=50 * EPSILON)


@pytest.mark.parametrize("frequency", [1.0, 50.0, 400.0])
def test_the_bandwidth_is_where_3_db_are_lost(frequency: float) -> None:
    """Gain 1/√2 and −45° at the pole, measured with a sine at 2000 samples per cycle.

    Held samples change the gain by (ω Δt)² = 1e-5 and are half a sample late. After 30 / ω the
    start has decayed to 1e-13.
    """
    per_cycle, cycles = 2000, 8
    k = np.arange(per_cycle * cycles)
    turns = 2 * np.pi * k / per_cycle
    response = filtered(np.sin(turns), 2 * np.pi * frequency, 1 / (frequency * per_cycle))
    last = slice(-per_cycle, None)
    phasor = 2j * np.mean(response[last] * np.exp(-1j * turns[last]))
    x = 2 * np.pi / per_cycle
    assert abs(phasor) == pytest.approx(np.sqrt(0.5), abs=x**2)
    assert np.angle(phasor) == pytest.approx(-np.pi / 4 + x / 2, abs=x**2)
    pole = np.exp(-x)
    np.testing.assert_allclose(phasor, (1 - pole) / (1 - pole * np.exp(-1j * x)), rtol=0, atol=1e-11)


@given(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9), st.sampled_from([UNFILTERED, 10 * UNFILTERED]))
def test_unfiltered_is_the_value_itself(last: float, value: float, bandwidth: float) -> None:
    np.testing.assert_array_equal(each("low_pass", np.array([last]), value, bandwidth, PERIOD), [value])


@given(st.floats(-3, 3), st.floats(-5, 5), st.integers(1, 20))
def test_a_difference_is_the_velocity_of_linear_motion(start: float, speed: float, periods: int) -> None:
    """Rounding: ε of the two positions, over the time between them."""
    elapsed = periods * PERIOD
    (ours,) = each("difference", np.array([start]), start + speed * elapsed, elapsed)
    assert ours == pytest.approx(speed, rel=0, abs=4 * EPSILON * (3 + 5 * elapsed) / elapsed)


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_with_every_effect_off_sensors_tell_the_truth(seed: int) -> None:
    """To the last bit, from the first sample on, for any numbers and periods."""
    rng = np.random.default_rng(seed)
    truth = rng.normal(size=(20, sum(SIZES))) * 10 ** rng.uniform(-6, 6, (20, sum(SIZES)))
    measured = read(truth, elapsed=rng.uniform(0, 1, 20))
    for ours, true in zip(measured, split(truth), strict=True):
        np.testing.assert_array_equal(ours, true)


def test_differences_are_exact_for_linear_motion_also_after_missed_periods() -> None:
    elapsed = PERIOD * np.array([1, 1, 2, 1, 5, 1, 1])
    truth = moving(np.random.default_rng(0), np.cumsum(elapsed))
    measured, true = read(truth, elapsed=elapsed, velocity_differences=1.0), split(truth)
    for ours, exact in ((measured.dq, true.dq), (measured.dtheta, true.dtheta)):
        np.testing.assert_allclose(ours[1:], exact[1:], rtol=0, atol=4 * EPSILON / PERIOD)
    for name in ("q", "theta", "tau_a", "F_e", "tau_e"):
        np.testing.assert_array_equal(getattr(measured, name), getattr(true, name))


def test_differences_are_half_a_period_late() -> None:
    """On a parabola (q_k − q_k−1)/Δt is the velocity at the middle of the period."""
    time = PERIOD * np.arange(10)
    truth = moving(np.random.default_rng(1), time, degree=2)
    measured, true = read(truth, velocity_differences=1.0), split(truth)
    middle = (true.dq[1:] + true.dq[:-1]) / 2
    np.testing.assert_allclose(measured.dq[1:], middle, rtol=0, atol=4 * EPSILON / PERIOD)


def test_the_first_sample_has_no_spike() -> None:
    """Velocities start at 0 and not at q/Δt; filters start at their first reading and not at 0."""
    truth = np.tile(np.random.default_rng(2).uniform(1, 3, sum(SIZES)), (5, 1))
    slow = dict.fromkeys(("velocity_bandwidth", "torque_bandwidth", "wrench_bandwidth"), 10.0)
    for bandwidths in ({}, slow):
        measured = read(truth, velocity_differences=1.0, **bandwidths)
        assert not measured.dq.any()
        assert not measured.dtheta.any()
        np.testing.assert_array_equal(measured.tau_a, split(truth).tau_a)
        np.testing.assert_array_equal(measured.F_e, split(truth).F_e)


def test_noise_comes_before_the_bandwidth() -> None:
    """What noise adds to the reading is filtered noise, from its first sample on."""
    rng, pole = np.random.default_rng(3), 300.0
    truth, noise = moving(rng, PERIOD * np.arange(200)), rng.normal(size=(200, N))
    noisy, clean = (read(truth, e, torque_bandwidth=pole).tau_a for e in (noise, 0.0))
    a = np.exp(-pole * PERIOD)
    expected, _ = lfilter([1 - a], [1, -a], noise, axis=0, zi=a * noise[:1])
    np.testing.assert_allclose(noisy - clean, expected, rtol=0, atol=1e-13)
    assert np.std(noisy - clean) < np.std(noise) / 2
    raw = read(truth, noise)
    np.testing.assert_array_equal(raw.tau_a, split(truth).tau_a + noise)
    np.testing.assert_array_equal(raw.F_e, split(truth).F_e)


def test_each_bandwidth_has_its_own_sensor() -> None:
    """A step of everything at the second sample: what is filtered starts to follow, the rest is there at once."""
    truth = np.zeros((30, sum(SIZES)))
    truth[1:] = 1.0
    names = {"torque_bandwidth": "tau_a", "wrench_bandwidth": "F_e"}
    for (pole, slow), fast in product(names.items(), names.values()):
        measured = getattr(read(truth, **{pole: 80.0}), fast)
        rise = -np.expm1(-80 * PERIOD * np.arange(30)) if fast == slow else truth[:, 0]
        np.testing.assert_allclose(measured, np.tile(rise[:, None], measured.shape[1]), atol=1e-14)


def test_velocities_are_low_passed_differences_of_readings() -> None:
    """A ramp that starts at the second sample: 1 − exp(−ω t) of its speed. The true velocity is not looked at."""
    speed, pole = np.array([0.3, -1.2]), 120.0
    truth = np.full((40, sum(SIZES)), np.pi)
    for start, rate in ((0, speed), (N, 2 * speed)):
        truth[:, start : start + N] = PERIOD * np.arange(40)[:, None] * rate
    measured = read(truth, velocity_differences=1.0, velocity_bandwidth=pole)
    rise = -np.expm1(-pole * PERIOD * np.arange(40))[:, None]
    np.testing.assert_allclose(measured.dq, rise * speed, rtol=0, atol=40 * EPSILON / PERIOD)
    np.testing.assert_allclose(measured.dtheta, 2 * rise * speed, rtol=0, atol=40 * EPSILON / PERIOD)


def test_velocities_feel_the_resolution() -> None:
    """Links and motors have one each; differences are whole multiples of resolution / Δt."""
    rng, link, motor = np.random.default_rng(4), 1e-3, 1e-4
    truth = moving(rng, PERIOD * np.arange(100), degree=2)
    effects = {"link_resolution": link, "motor_resolution": motor, "velocity_differences": 1.0}
    measured, true = read(truth, **effects), split(truth)
    for name, step in (("q", link), ("theta", motor)):
        ours, rate = getattr(measured, name), getattr(measured, f"d{name}")
        assert np.abs(ours - getattr(true, name)).max() <= step / 2 * (1 + 1e-9)
        np.testing.assert_allclose(rate[1:], np.diff(ours, axis=0) / PERIOD, rtol=0, atol=1e-12)
        counts = rate * PERIOD / step
        np.testing.assert_allclose(counts, np.round(counts), rtol=0, atol=1e-9)
        # Each reading is off by half a step at most.
        lag = np.abs(rate[1:] - np.diff(getattr(true, name), axis=0) / PERIOD)
        assert lag.max() <= step / PERIOD * (1 + 1e-9)


def test_scale_and_offset_come_before_noise_bandwidth_and_resolution() -> None:
    """(1 + s) τ_a + o + n joint by joint, from the first sample on; an offset of an angle comes before its steps."""
    rng = np.random.default_rng(6)
    truth = moving(rng, PERIOD * np.arange(60), degree=2)
    scale, offset, noise = rng.uniform(-0.1, 0.1, N), rng.normal(size=N), rng.normal(size=(60, N))
    true = split(truth)
    measured = read(truth, noise, torque_scale=scale, torque_offset=offset)
    np.testing.assert_allclose(
        measured.tau_a, (1 + scale) * true.tau_a + offset + noise, rtol=1e-14, atol=1e-14
    )
    slow = read(truth, noise, torque_scale=scale, torque_offset=offset, torque_bandwidth=80.0)
    moved = (1 + scale) * true.tau_a + offset
    np.testing.assert_array_equal(
        slow.tau_a, read(_with_torque(truth, moved), noise, torque_bandwidth=80.0).tau_a
    )
    link, motor, step = np.array([0.3, -0.2]), np.array([-0.1, 0.05]), 1e-3
    coarse = read(truth, link_offset=link, motor_offset=motor, link_resolution=step)
    np.testing.assert_array_equal(coarse.theta, true.theta + motor)
    np.testing.assert_allclose(coarse.q, step * np.round((true.q + link) / step), rtol=0, atol=1e-12)


def test_constant_offsets_of_angles_leave_velocities() -> None:
    truth = moving(np.random.default_rng(7), PERIOD * np.arange(40), degree=2)
    plain, moved = (
        read(truth, velocity_differences=1.0, link_offset=o * np.ones(N), motor_offset=-o * np.ones(N))
        for o in (0.0, 0.25)
    )
    for name in ("dq", "dtheta"):
        np.testing.assert_allclose(getattr(moved, name), getattr(plain, name), rtol=0, atol=1e-11)


def _with_torque(truth: np.ndarray, tau_a: np.ndarray) -> np.ndarray:
    out = truth.copy()
    out[:, 4 * N : 5 * N] = tau_a
    return out


@lru_cache
def late_sensors(length: int, readings: Readings) -> cs.Function:
    """Return (state, truth, noise of τ_a, q, θ, elapsed, parameters) → (state, reading), in a row."""
    late = Sensors(N, readings=readings)
    truth, elapsed = cs.SX.sym("truth", sum(SIZES)), cs.SX.sym("elapsed")
    noise = [cs.SX.sym(name, N) for name in Noise._fields]
    state, s = late.state.symbols("state")
    vector, g = late.layout.symbols("g")
    parts = Measurement(*cs.vertsplit(truth, np.cumsum([0, *SIZES]).tolist()))
    reading = late.read(parts, Noise(*noise), elapsed, s, g)
    outputs = [reading.state, cs.densify(cs.vertcat(*reading.measured))]
    return cs.Function("late", [state, truth, *noise, elapsed, vector], outputs).mapaccum(length)


def test_a_sensor_that_is_late_says_what_it_would_have_said_before() -> None:
    """All that the readings go through is as without, each so many readings ago; velocities as late as positions."""
    length, ago = 60, {"link": 2, "motor": 1, "torque": 3, "wrench": 4}
    rng = np.random.default_rng(6)
    truth, noise = rng.normal(size=(length, sum(SIZES))), rng.normal(size=(3, length, N))
    effects = OFF | {"velocity_differences": 1.0, "velocity_bandwidth": 300.0, "torque_bandwidth": 200.0}
    effects |= {"link_resolution": 0.1, "link_offset": [0.1, -0.2]}
    lates = {f"{name}_late": float(k) for name, k in ago.items()}
    found = []
    for readings, numbers in (
        (Readings(noisy=True), effects),
        (Readings(noisy=True, **ago), effects | lates),
    ):
        vector = np.tile(SENSORS.layout.pack(numbers)[:, None], length)
        size = Sensors(N, readings=readings).state.size
        columns = [truth.T, *(part.T for part in noise), np.full((1, length), PERIOD), vector]
        rows = np.array(late_sensors(length, readings)(np.zeros(size), *columns)[1]).T
        found.append(Measurement(*np.split(rows, np.cumsum(SIZES)[:-1], axis=1)))
    on_time, late = found
    for name, of in zip(
        Measurement._fields, ("link", "motor", "link", "motor", "torque", "wrench", ""), strict=True
    ):
        k = ago.get(of, 0)
        one, other = getattr(on_time, name), getattr(late, name)
        np.testing.assert_array_equal(other[k:], one[: length - k])
        np.testing.assert_array_equal(other[:k], np.tile(one[0], (k, 1)))


def test_noise_of_positions_is_added_before_the_encoder_rounds_and_velocities_have_it() -> None:
    rng, length = np.random.default_rng(7), 20
    truth, noise = np.zeros((length, sum(SIZES))), rng.normal(size=(3, length, N))
    vector = np.tile(
        SENSORS.layout.pack(OFF | {"velocity_differences": 1.0, "motor_resolution": 0.5})[:, None], length
    )
    columns = [truth.T, *(part.T for part in noise), np.full((1, length), PERIOD), vector]
    exact = Readings(noisy=True)
    rows = np.array(late_sensors(length, exact)(np.zeros(SENSORS.state.size), *columns)[1]).T
    read = Measurement(*np.split(rows, np.cumsum(SIZES)[:-1], axis=1))
    np.testing.assert_array_equal(read.q, noise[1])
    np.testing.assert_array_equal(read.theta, 0.5 * np.floor(noise[2] / 0.5 + 0.5))
    np.testing.assert_allclose(read.dq[1:], np.diff(noise[1], axis=0) / PERIOD, rtol=1e-12)
    assert not read.dq[0].any()
