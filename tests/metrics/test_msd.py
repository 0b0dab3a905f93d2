"""The ideal mass-spring-damper against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from passiflex.control.gain_design import target_inertia
from passiflex.control.motion import Motion, Pose, circle, hold, minimum_jerk
from passiflex.metrics.msd import IdealResponse, ideal_response
from passiflex.problems.problem import Event

M, D, K = 3.4, 20.0, 60.0
OMEGA = np.sqrt(K / M)
ZETA = D / (2 * np.sqrt(K * M))
HOME = Pose(np.array([0.5, -0.1, 0.7]), np.eye(3))
TIME = np.arange(801) * 0.01
ABS = 1e-8
"""The integrator's 1e-9 relative, of motions of 0.1 m, with a hundred steps to add up."""


def at(by: list[float]) -> Motion:
    return hold(Pose(HOME.position + np.array(by), HOME.rotation))


def push(*F: float) -> np.ndarray:
    return np.array([*F, 0, 0, 0], dtype=float)


NONE = push(0, 0, 0)


def ideal(*events: Event, size: int = 3, time: np.ndarray = TIME) -> IdealResponse:
    one = np.eye(size)
    return ideal_response(M * one, K * one, D * one, events, time)


def step_response(t: np.ndarray) -> np.ndarray:
    """Return 1 − e^(−ζωt) (cos ω_d t + ζω/ω_d sin ω_d t) for t > 0."""
    t = np.maximum(t, 0)
    damped = OMEGA * np.sqrt(1 - ZETA**2)
    return 1 - np.exp(-ZETA * OMEGA * t) * (np.cos(damped * t) + ZETA * OMEGA / damped * np.sin(damped * t))


def close(response: IdealResponse, expected: np.ndarray) -> None:
    np.testing.assert_allclose(response.displacement, expected, rtol=0, atol=ABS)
    assert response.ledger_residual < 1e-7
    assert response.largest_rise <= 2 * response.ledger_residual


@pytest.mark.parametrize("size", [3, 6])
def test_a_step_of_the_reference(size: int) -> None:
    response = ideal(Event(0, at([0, 0, 0]), NONE), Event(1, at([0.02, 0, 0.1]), NONE), size=size)
    close(response, step_response(TIME - 1)[:, None] * [0.02, 0, 0.1])


def test_a_push() -> None:
    """4 N for 1 s: F/K (s(t − 2) − s(t − 3)), by superposition."""
    response = ideal(Event(0, at([0, 0, 0]), NONE), Event(2, None, push(0, 4, 0)), Event(3, None, NONE))
    close(response, (step_response(TIME - 2) - step_response(TIME - 3))[:, None] * [0, 4 / K, 0])


def test_a_push_during_a_step() -> None:
    """The wrench leaves the reference alone, and they add up; events need not fall on the asked instants."""
    response = ideal(
        Event(0, at([0, 0, 0]), NONE),
        Event(1.0037, at([0, 0, 0.1]), NONE),
        Event(1.2, None, push(0, 4, 0)),
        Event(1.5011, None, NONE),
    )
    pushed = step_response(TIME - 1.2) - step_response(TIME - 1.5011)
    close(response, np.stack([0 * TIME, 4 / K * pushed, 0.1 * step_response(TIME - 1.0037)], axis=1))


def driven(A: np.ndarray, x: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return the solution of ẋ = A x at equal intervals from t[0] = 0, exactly."""
    step = scipy.linalg.expm(A * (t[1] - t[0]))
    rows = [x]
    for _ in t[1:]:
        rows.append(step @ rows[-1])
    return np.array(rows)


def test_a_circle() -> None:
    """Against the exact solution: mass, oscillator and constant are one linear system.

    M ẍ = −D ẋ − K (x − x_d) with x_d = R (sin ωt, 1 − cos ωt): no term with D ẋ_d, as the damper is to the ground.
    """
    radius, period = 0.1, 4.0
    w = 2 * np.pi / period
    response = ideal(
        Event(0, at([0, 0, 0]), NONE),
        Event(1, circle(HOME, [0, 1, 0], [0, 0, 1], radius, period), NONE),
    )
    # State: y, ẏ, z, ż, sin, cos, 1
    A = np.zeros((7, 7))
    A[0, 1] = A[2, 3] = 1
    A[1, :2] = A[3, 2:4] = [-K / M, -D / M]
    A[1, 4] = K / M * radius
    A[3, 5], A[3, 6] = -K / M * radius, K / M * radius
    A[4, 5], A[5, 4] = w, -w
    exact = driven(A, np.array([0, 0, 0, 0, 0, 1, 1.0]), TIME[TIME < 7.005])
    expected = np.zeros((TIME.size, 3))
    expected[100:, 1], expected[100:, 2] = exact[:, 0], exact[:, 2]
    close(response, expected)


def test_a_circle_settles_to_the_transfer_function() -> None:
    """After ten seconds (e^(−2.9 · 10) = 1e-13): amplitude R |K / (K − M ω² + i D ω)|."""
    time = np.arange(2001) * 0.01
    motion = circle(HOME, [0, 1, 0], [0, 0, 1], 0.1, 4.0)
    response = ideal(Event(0, at([0, 0, 0]), NONE), Event(1, motion, NONE), time=time)
    w = 2 * np.pi / 4
    gain = K / (K - M * w**2 + 1j * D * w)
    late = time > 11
    expected = 0.1 * np.imag(gain * np.exp(1j * w * (time[late] - 1)))
    np.testing.assert_allclose(response.displacement[late, 1], expected, rtol=0, atol=ABS)


def test_a_move_is_followed() -> None:
    """Slow enough, the mass is where it should be, behind by D/K of the speed."""
    response = ideal(Event(0, at([0, 0, 0]), NONE), Event(0.5, minimum_jerk(HOME, [0, 0, 0.1], 5.0), NONE))
    assert response.ledger_residual < 1e-7
    middle = np.searchsorted(TIME, 3.0)
    speed = 15 / 8 * 0.1 / 5
    # The next term is (D²/K² − M/K) · x⃛/…: zero acceleration in the middle, and a jerk of 60/8 · 0.1 / 5³ · …
    assert response.displacement[middle, 2] == pytest.approx(0.05 - D / K * speed, abs=5e-4)


def test_at_rest_without_events() -> None:
    close(ideal(Event(0, at([0, 0, 0]), NONE)), np.zeros((TIME.size, 3)))


def test_coupled_directions() -> None:
    """Full matrices: the same as the matrix exponential of the linear system."""
    rng = np.random.default_rng(1)

    def definite(scale: float) -> np.ndarray:
        A = rng.normal(size=(6, 6))
        return scale * (A @ A.T / 6 + np.eye(6))

    inertia, stiffness, damping = definite(2), definite(60), definite(20)
    x_d = np.array([0.02, -0.03, 0.1, 0, 0, 0])
    events = (Event(0, at([0, 0, 0]), NONE), Event(0, at([0, 0, 0]), NONE))
    response = ideal_response(
        inertia, stiffness, damping, (events[0], Event(1, at(x_d[:3].tolist()), NONE)), TIME
    )
    zero, one = np.zeros((6, 6)), np.eye(6)
    inverse = np.linalg.inv(inertia)
    A = np.block([[zero, one], [-inverse @ stiffness, -inverse @ damping]])
    exact = driven(A, np.concatenate([-x_d, np.zeros(6)]), TIME[:701])
    expected = np.zeros((TIME.size, 3))
    expected[100:] = x_d[:3] + exact[:, :3]
    close(response, expected)


def test_the_ledger_charges_the_jump() -> None:
    """A step stores ½ K 0.1² = 0.3 J at once; without that the balance would be wrong by as much."""
    response = ideal(Event(0, at([0, 0, 0]), NONE), Event(1, at([0, 0, 0.1]), NONE))
    assert response.ledger_residual < 1e-7


def test_the_end_of_a_run_that_ended_early() -> None:
    """The ideal is asked for only so long: the events after that do not matter."""
    events = (Event(0, at([0, 0, 0]), NONE), Event(1, at([0, 0, 0.1]), NONE), Event(5, None, push(0, 4, 0)))
    early = TIME[TIME < 2]
    response = ideal(*events, time=early)
    np.testing.assert_allclose(response.displacement[:, 2], 0.1 * step_response(early - 1), rtol=0, atol=ABS)


def test_the_papers_target_is_3_40_kg() -> None:
    """(D / 2ζ)² / K with 20 N s/m, 60 N/m and ζ = 0.7 (theory note 2.8)."""
    inertia = target_inertia(60 * np.eye(6), 20 * np.eye(6), 0.7)
    np.testing.assert_allclose(inertia, (20 / 1.4) ** 2 / 60 * np.eye(6), rtol=1e-14, atol=1e-15)
    assert inertia[0, 0] == pytest.approx(3.40, abs=5e-3)


def test_the_target_gives_every_mode_its_ratio() -> None:
    """Also where K and D are no multiples of each other, but share their axes."""
    Q, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))
    stiffness, damping = Q @ np.diag([60, 600, 20.0]) @ Q.T, Q @ np.diag([20, 50, 5.0]) @ Q.T
    inertia = target_inertia(stiffness, damping, 0.7)
    np.testing.assert_array_equal(inertia, inertia.T)
    zero, one, inverse = np.zeros((3, 3)), np.eye(3), np.linalg.inv(inertia)
    poles = np.linalg.eigvals(np.block([[zero, one], [-inverse @ stiffness, -inverse @ damping]]))
    np.testing.assert_allclose(-poles.real / np.abs(poles), 0.7, rtol=1e-9)
