"""Overshoot, settling time, rms and rise against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from passiflex.metrics.numbers import largest_rise, overshoot, rms, settling_time

H = 1e-3
TIME = np.arange(20_001) * H


def second_order(zeta: float, omega: float = 3.0, begin: float = 1.0) -> np.ndarray:
    """Return the unit step response of ẍ + 2 ζ ω ẋ + ω² x = ω² from `begin` on."""
    t = np.maximum(TIME - begin, 0)
    damped = omega * math.sqrt(1 - zeta**2)
    phase = np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t)
    return 1 - np.exp(-zeta * omega * t) * phase


def exponential(rate: float, begin: float = 1.0) -> np.ndarray:
    return 1 - np.exp(-rate * np.maximum(TIME - begin, 0))


@pytest.mark.parametrize("zeta", [0.1, 0.3, 0.5, 0.7])
@pytest.mark.parametrize("step", [0.1, -0.1])
def test_overshoot_of_a_second_order_system(zeta: float, step: float) -> None:
    """e^(−πζ/√(1−ζ²)); between two samples the top is missed by (ω h)²/8 = 1e-6 of the amplitude."""
    expected = math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2))
    found = overshoot(TIME, step * second_order(zeta), step, 1.0, 20.0)
    assert found == pytest.approx(expected, abs=2e-6)
    assert found <= expected


def test_what_stays_below_the_step_has_a_negative_overshoot() -> None:
    assert overshoot(TIME, 0.08 * exponential(5), 0.1, 1.0, 20.0) == pytest.approx(-0.2, abs=1e-12)


def test_overshoot_looks_only_between_begin_and_end() -> None:
    motion = np.where(TIME < 1, 5.0, np.where(TIME < 2, 1.1, 7.0))
    assert overshoot(TIME, motion, 1.0, 1.0, 2.0) == pytest.approx(0.1)


@pytest.mark.parametrize("band", [0.02, 0.05])
@pytest.mark.parametrize("rate", [1.0, 4.0])
def test_settling_of_an_exponential(rate: float, band: float) -> None:
    """1 − e^(−rt) is within the band from ln(1/band)/r on, to the next sample."""
    expected = math.log(1 / band) / rate
    found = settling_time(TIME, 0.1 * exponential(rate), 0.1, 1.0, 20.0, band)
    assert expected <= found <= expected + H * 1.01


def test_settling_of_a_second_order_system() -> None:
    """|x − 1| ≤ e^(−ζωt)/√(1−ζ²): it cannot settle later than that envelope, nor earlier than half a swing before."""
    zeta, omega = 0.3, 3.0
    latest = -math.log(0.02 * math.sqrt(1 - zeta**2)) / (zeta * omega)
    half_swing = math.pi / (omega * math.sqrt(1 - zeta**2))
    found = settling_time(TIME, second_order(zeta, omega), 1.0, 1.0, 20.0)
    assert latest - half_swing < found <= latest + H


def test_what_settled_from_the_start_takes_no_time() -> None:
    assert settling_time(TIME, np.full(TIME.size, 0.1), 0.1, 1.0, 20.0) == 0


def test_what_does_not_settle_takes_for_ever() -> None:
    assert settling_time(TIME, 0.1 * exponential(0.1), 0.1, 1.0, 15.0) == math.inf
    assert settling_time(TIME, np.sin(TIME), 1.0, 1.0, 15.0) == math.inf


def test_what_leaves_the_band_at_the_end_has_not_settled() -> None:
    motion = np.where(TIME < 14.9985, exponential(5), 1.03)
    assert settling_time(TIME, motion, 1.0, 1.0, 15.0) == math.inf
    assert settling_time(TIME, motion, 1.0, 1.0, 14.0) == pytest.approx(math.log(50) / 5, abs=2 * H)


def test_a_run_that_ended_early_has_not_settled() -> None:
    """Within the band so far says nothing about what was to come."""
    early = TIME < 10
    assert settling_time(TIME[early], exponential(5)[early], 1.0, 1.0, 15.0) == math.inf


def test_a_window_without_samples() -> None:
    assert math.isnan(overshoot(TIME, TIME, 1.0, 30.0, 40.0))
    assert settling_time(TIME, TIME, 1.0, 30.0, 40.0) == math.inf


def test_rms() -> None:
    """Of a sinusoid over whole periods: amplitude / √2."""
    t = np.arange(1000) / 1000
    assert rms(3 * np.sin(2 * np.pi * 4 * t)) == pytest.approx(3 / math.sqrt(2), rel=1e-12)
    assert rms(np.array([-2.0])) == 2
    assert math.isnan(rms(np.array([])))


@pytest.mark.parametrize(
    ("values", "rise"),
    [
        ([3, 2, 1], 0),
        ([0, 1, 2], 2),
        ([5, 1, 2, 0, 0.5], 1),
        ([5, 1, 3, 0, 2.5], 2.5),
        ([1], 0),
    ],
)
def test_the_largest_rise_is_above_any_earlier_value(values: list[float], rise: float) -> None:
    assert largest_rise(np.array(values, dtype=float)) == rise
