"""The ideal response in closed form: against textbook solutions, and against the integrator's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from loops import definite
from passiflex.control.motion import Motion, Pose, circle, hold, minimum_jerk
from passiflex.metrics import closed_form
from passiflex.metrics.closed_form import ideal_displacement
from passiflex.metrics.msd import ideal_response
from passiflex.problems.problem import Event

HOME = Pose(np.array([0.4, -0.2, 0.7]), Rotation.from_rotvec([0.3, -0.2, 1.0]).as_matrix())
NONE = np.zeros(6)
EXACT = 1e-12
"""Against formulas [m]: motions of 0.1 m, some hundred products of matrices."""
ABS = 1e-8
"""Against the integrator, whose relative tolerance is 1e-9."""


def at(by: list[float]) -> Motion:
    return hold(Pose(HOME.position + np.array(by), HOME.rotation))


START = Event(0.0, at([0, 0, 0]), NONE)


def push(*F: float) -> np.ndarray:
    return np.array([*F, 0, 0, 0], dtype=float)


def step_response(t: np.ndarray, omega: float, zeta: float) -> np.ndarray:
    """Return the unit step response of ẍ + 2 ζ ω ẋ + ω² x = ω², 0 before."""
    t = np.maximum(t, 0.0)
    if zeta == 1:
        return 1 - (1 + omega * t) * np.exp(-omega * t)
    poles = -zeta * omega + omega * np.emath.sqrt(zeta**2 - 1) * np.array([1, -1])
    slow, fast = poles
    return np.real(1 - (fast * np.exp(slow * t) - slow * np.exp(fast * t)) / (fast - slow))


def alike(k: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return full M, K, D: none is diagonal, nor do they share their axes."""
    rng = np.random.default_rng(seed)
    return definite(rng, k, 1, 5), definite(rng, k, 40, 90), definite(rng, k, 8, 25)


@pytest.mark.parametrize("k", [3, 6])
@pytest.mark.parametrize("zeta", [0.05, 0.7, 1.0, 3.0])
@pytest.mark.parametrize("interval", [0.01, 0.0137])
def test_a_step_of_an_oscillator(k: int, zeta: float, interval: float) -> None:
    """Over more instants than one stride, and with a step between two of them."""
    mass, omega, count = 3.4, 4.2, 500
    one, time = np.eye(k), np.arange(count) * interval
    events = (START, Event(0.5, at([0.02, 0, -0.1]), NONE))
    found = ideal_displacement(
        mass * one, mass * omega**2 * one, 2 * zeta * omega * mass * one, events, interval, count
    )
    expected = step_response(time - 0.5, omega, zeta)[:, None] * [0.02, 0, -0.1]
    np.testing.assert_allclose(found, expected, rtol=0, atol=EXACT)


def test_a_push_that_begins_and_ends_between_two_instants() -> None:
    """F/K (s(t − t₀) − s(t − t₁)), by superposition; also where no instant lies in it at all."""
    K, omega, zeta, interval = 60.0, 4.2, 0.7, 0.01
    one, time = np.eye(3), np.arange(300) * interval
    M, D = K / omega**2 * one, 2 * zeta * K / omega * one
    for begin, end in ((0.5041, 1.2077), (0.5041, 0.5049), (0.5, 0.51)):
        events = (START, Event(begin, None, push(0, 4, 0)), Event(end, None, NONE))
        found = ideal_displacement(M, K * one, D, events, interval, time.size)
        pushed = step_response(time - begin, omega, zeta) - step_response(time - end, omega, zeta)
        np.testing.assert_allclose(found, pushed[:, None] * [0, 4 / K, 0], rtol=0, atol=EXACT)


EVENTS: dict[str, tuple[Event, ...]] = {
    "rest": (START,),
    "step": (START, Event(0.3, at([0.05, 0, 0.1]), NONE)),
    "step at once": (START, Event(1e-3, at([0, 0.1, 0]), NONE)),
    "move": (START, Event(0.2013, minimum_jerk(HOME, [0.1, -0.05, 0.2], 0.8), NONE)),
    "pushed move": (
        START,
        Event(0.2, minimum_jerk(HOME, [0.1, -0.05, 0.2], 0.8), NONE),
        Event(0.4519, None, push(3, -2, 1)),
        Event(1.0, None, NONE),  # the end of the move, to the rounding
        Event(1.3, None, push(0, 5, 0)),
    ),
    "move cut short": (
        START,
        Event(0.2, minimum_jerk(HOME, [0.1, -0.05, 0.2], 0.8), NONE),
        Event(0.6, at([0.05, 0, 0.1]), NONE),
    ),
    "circle": (START, Event(0.3, circle(HOME, [0, 1, 0], [0, 0, 1], 0.1, 1.7), NONE)),
    "pushed circle": (
        START,
        Event(0.3, circle(HOME, [1, 0, 0], [0, 0, 1], 0.1, 1.7), NONE),
        Event(0.7777, None, push(-4, 0, 2)),
        Event(1.1111, at([0.02, 0, 0.03]), push(-4, 0, 2)),
    ),
    "first motion moves": (Event(0.0, circle(HOME, [0, 1, 0], [0, 0, 1], 0.1, 1.7), push(1, 0, 0)),),
    "pushed and turned": (START._replace(F_e=np.array([1, 2, 3, 0.4, -0.5, 0.6])), Event(0.5, None, NONE)),
}


@pytest.mark.parametrize("k", [3, 6])
@pytest.mark.parametrize("name", EVENTS)
def test_the_integrator_finds_the_same(name: str, k: int) -> None:
    M, K, D = alike(k)
    interval, count = 0.0093, 200
    expected = ideal_response(M, K, D, EVENTS[name], np.arange(count) * interval).displacement
    found = ideal_displacement(M, K, D, EVENTS[name], interval, count)
    np.testing.assert_allclose(found, expected, rtol=0, atol=ABS)
    assert name == "rest" or np.abs(found).max() > 1e-3


def test_moments_move_the_end_effector_by_the_coupling_alone() -> None:
    """Six coordinates with full matrices are more than three: a moment displaces."""
    M, K, D = alike(6)
    event = START._replace(F_e=np.array([0, 0, 0, 1.0, 0, 0]))
    found = ideal_displacement(M, K, D, (event,), 0.01, 2001)
    np.testing.assert_allclose(found[-1], np.linalg.solve(K, event.F_e)[:3], rtol=1e-9)
    assert np.abs(found[-1]).max() > 1e-4


@pytest.mark.parametrize("name", EVENTS)
def test_the_grid_does_not_matter(name: str) -> None:
    """Every seventh instant of a fine grid, whatever the stride: events fall between others."""
    M, K, D = alike(3)
    fine = ideal_displacement(M, K, D, EVENTS[name], 0.001, 1401)
    coarse = ideal_displacement(M, K, D, EVENTS[name], 0.007, 201)
    np.testing.assert_allclose(coarse, fine[::7], rtol=0, atol=EXACT)


@pytest.mark.parametrize("count", [1, 2, closed_form.STRIDE, closed_form.STRIDE + 1])
def test_any_number_of_instants(count: int) -> None:
    """What is asked for ends before some events: they change nothing."""
    M, K, D = alike(3)
    events = EVENTS["pushed move"]
    whole = ideal_displacement(M, K, D, events, 0.01, 300)
    found = ideal_displacement(M, K, D, events, 0.01, count)
    assert found.shape == (count, 3)
    np.testing.assert_allclose(found, whole[:count], rtol=0, atol=EXACT)
    np.testing.assert_array_equal(found[0], 0)


def test_a_long_run_does_not_drift() -> None:
    """30 s at 1 kHz: back at rest where the reference is, and on the formula all the way."""
    mass, omega, zeta = 3.4, 4.2, 0.7
    one, time = np.eye(3), np.arange(30_001) * 1e-3
    events = (START, Event(10.0, at([0, 0, 0.1]), NONE), Event(20.0, None, push(0, 4, 0)))
    found = ideal_displacement(
        mass * one, mass * omega**2 * one, 2 * zeta * omega * mass * one, events, 1e-3, time.size
    )
    expected = np.zeros_like(found)
    expected[:, 1] = 4 / (mass * omega**2) * step_response(time - 20, omega, zeta)
    expected[:, 2] = 0.1 * step_response(time - 10, omega, zeta)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)


def test_a_stiff_target() -> None:
    """100 rad/s over ten seconds and far apart instants: the exponential of a matrix of norm 1e5."""
    omega, zeta, time = 100.0, 0.2, np.arange(11) * 1.0
    one = np.eye(3)
    events = (START, Event(0.97, at([0, 0, 0.1]), NONE))
    found = ideal_displacement(one, omega**2 * one, 2 * zeta * omega * one, events, 1.0, time.size)
    np.testing.assert_allclose(found[:, 2], 0.1 * step_response(time - 0.97, omega, zeta), rtol=0, atol=1e-9)
