"""What is kept back: a delay of whole periods shifts, one between two of them is linear, and books pair instants."""

from __future__ import annotations

from types import SimpleNamespace

import casadi as cs
import numpy as np
import pytest

from passiflex.control import Measurement
from passiflex.sampled.readings import EXACT, ON_TIME, Lateness, Readings, delayed

N, LENGTH = 2, 30
RNG = np.random.default_rng(3)
Q, TAU = RNG.normal(size=(2, LENGTH, N))


def late(values: np.ndarray, periods: float) -> np.ndarray:
    """Return a sequence (length, k) so many periods late; before its begin it was what it began with."""
    whole, part = int(periods), periods - int(periods)
    rows = np.arange(len(values))
    newer, older = (values[np.maximum(rows - whole - k, 0)] for k in (0, 1))
    return (1 - part) * newer + part * older if part else newer


def ran(values: np.ndarray, periods: float) -> np.ndarray:
    m, k = int(np.ceil(periods)), values.shape[1]
    past, now, first = cs.SX.sym("past", m, k), cs.SX.sym("now", k), cs.SX.sym("first")
    found = delayed(past, now, cs.SX(periods), first)
    step = cs.Function("late", [cs.vec(past), now, first], [cs.vec(found.past), found.value]).mapaccum(
        len(values)
    )
    return np.array(step(np.zeros(m * k), values.T, (np.arange(len(values)) == 0)[None])[1]).T


@pytest.mark.parametrize("periods", [1.0, 2.0, 5.0])
def test_whole_periods_shift_to_the_last_bit(periods: float) -> None:
    np.testing.assert_array_equal(ran(Q, periods), late(Q, periods))


@pytest.mark.parametrize("periods", [0.3, 1.75, 3.5])
def test_between_two_periods_it_is_linear(periods: float) -> None:
    np.testing.assert_allclose(ran(Q, periods), late(Q, periods), rtol=0, atol=1e-15)
    t = np.arange(LENGTH)[:, None] * np.ones(N)
    np.testing.assert_allclose(ran(t, periods)[8:], t[8:] - periods, rtol=0, atol=1e-13)


def test_code_is_made_for_what_is_late_alone() -> None:
    assert Readings.of(ON_TIME, noisy=False) == EXACT
    assert EXACT.sensor_state(N).size == EXACT.book_state(N).size == 0
    found = Readings.of(Lateness(0.0013, 0.0, 0.003, 0.002).in_periods(1e-3), noisy=True)
    assert found == Readings(noisy=True, link=2, motor=0, torque=3, wrench=2, paired=2)
    assert Readings.of(Lateness(link=0.3 * 3), noisy=False).paired == -1
    assert Readings.of(Lateness(0.3e-2, 0, 0.1e-2 * 3).in_periods(1e-3), noisy=False).paired == 0
    assert found.late == 3
    assert [f.name for f in found.sensor_state(N)] == ["late_q", "late_dq", "late_tau_a", "late_wrench"]
    assert all(f.acts for f in found.sensor_state(N))
    assert not any(f.acts for f in found.book_state(N))


@pytest.mark.parametrize(("link", "torque"), [(0, 2), (3, 1), (0.4, 1.9), (2, 2), (1.5, 0)])
def test_books_get_both_readings_of_one_instant(link: float, torque: float) -> None:
    """Whatever comes first waits: q and τ_a are those of max(link, torque) periods ago, and so is the time between."""
    periods = Lateness(link=link, torque=torque)
    readings, last = Readings.of(periods, noisy=False), max(link, torque)
    layout = readings.book_state(N)
    q, tau, dt, first = cs.SX.sym("q", N), cs.SX.sym("tau", N), cs.SX.sym("dt"), cs.SX.sym("first")
    state, s = layout.symbols("state")
    unread = [cs.SX.zeros(N)] * 3
    y = Measurement(q, *unread, tau, cs.SX.zeros(6), cs.SX.zeros(N))
    e = SimpleNamespace(late=last, pairing=abs(torque - link))
    found = readings.pair(y, dt, first, s, e)
    outputs = [layout.stack(found.state), found.q, found.tau_a, found.elapsed]
    step = cs.Function("pair", [state, q, tau, dt, first], outputs).mapaccum(LENGTH)
    elapsed = RNG.choice([1e-3, 3e-3], LENGTH)
    read = late(Q, link).T, late(TAU, torque).T
    begins = (np.arange(LENGTH) == 0)[None]
    _, *got = (np.array(v).T for v in step(np.zeros(layout.size), *read, elapsed[None], begins))
    after = (
        int(np.ceil(last)) + 2
    )  # where nothing of the begin is left: one delay after another is not their sum there
    if link == int(link) and torque == int(torque):
        for value, true in zip(got, (Q, TAU, elapsed[:, None]), strict=True):
            np.testing.assert_allclose(value[after:], late(true, last)[after:], rtol=0, atol=1e-15)
    ramp = np.arange(LENGTH)[:, None] * np.ones(N)
    read = late(ramp, link).T, late(2 * ramp, torque).T
    _, q_of, tau_of, _ = (np.array(v).T for v in step(np.zeros(layout.size), *read, elapsed[None], begins))
    np.testing.assert_allclose(q_of[after:], ramp[after:] - last, rtol=0, atol=1e-13)
    np.testing.assert_allclose(tau_of[after:], 2 * (ramp[after:] - last), rtol=0, atol=1e-13)
