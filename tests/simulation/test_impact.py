"""A mass that meets a surface, sticks to it and slides along it: closed forms, at the steps that a run takes."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import casadi as cs
import numpy as np
import pytest
from scipy.optimize import brentq

from passiflex.elements import AbstractNormal, HuntCrossley, Linear, Mobility, Surface, Touch
from passiflex.layout import View
from passiflex.simulation.simulate_sampled import TOUCHING

MASS = 3.0
Slopes = Callable[[np.ndarray], np.ndarray]


def ball(surface: Surface) -> Slopes:
    """Return ẋ for a point mass at the tip of nothing: position, velocity, then what the surface remembers."""
    n, own_layout = 1, surface.state(1)
    x = cs.SX.sym("x", 6 + own_layout.size)
    numbers = surface.parameters(n).pack(dict(surface.numbers(n)))
    m = surface.parameters(n).view(cs.SX(numbers))
    eye, joint = cs.SX.eye(3), SimpleNamespace(q=cs.SX(1, 1), dq=cs.SX(1, 1))
    own = own_layout.view(x[6:])
    at = Touch(joint, x[3:6], cs.SX.zeros(3), x[:3], eye, eye, own)
    effect = surface.act(at, View(), m)
    f = cs.Function("f", [x], [cs.densify(cs.vertcat(x[3:6], effect.force / MASS, effect.rate))])
    return lambda now: np.array(f(now)).ravel()


def followed(f: Slopes, x: np.ndarray, step: float, time: float) -> np.ndarray:
    """Return the states of Runge-Kutta 4 at every step, as the native loop takes them."""
    states = [x]
    for _ in range(round(time / step)):
        k1 = f(x)
        k2 = f(x + step / 2 * k1)
        k3 = f(x + step / 2 * k2)
        k4 = f(x + step * k3)
        x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        states.append(x)
    return np.array(states)


def wall(normal: AbstractNormal, **values: Any) -> Surface:
    return Surface(normal=normal, rubs="friction" in values, values={"points": np.zeros((1, 3)), **values})


def speed_after(normal: AbstractNormal, step: float, stiffness: float, damping: float, speed: float) -> float:
    """Return how fast the mass leaves."""
    start = np.array([0, 0, 0.3 * speed * step, 0, 0, -speed])  # a touch that falls between two steps
    f = ball(wall(normal, stiffness=stiffness, damping=damping))
    states = followed(f, start, step, 4 * math.pi / math.sqrt(stiffness / MASS))
    assert states[-1, 2] > 0
    return float(states[-1, 5])


def hunt_crossley(damping: float, speed: float) -> float:
    """Return how fast it leaves: c (v + u) = ln((1 + c v)/(1 − c u)), whatever mass and stiffness."""
    if damping == 0:
        return speed

    def left(u: float) -> float:
        return damping * (speed + u) - math.log((1 + damping * speed) / (1 - damping * u))

    return brentq(left, 1e-9 * speed, min(speed, (1 - 1e-12) / damping))


def linear(stiffness: float, damping: float, speed: float) -> float:
    """Return how fast it leaves the surface when that no more presses: the damped oscillator at k δ + d δ̇ = 0."""
    w = math.sqrt(stiffness / MASS)
    zeta = damping / (2 * MASS * w)
    wd = w * math.sqrt(1 - zeta**2)
    t = math.atan2(2 * zeta * math.sqrt(1 - zeta**2), 2 * zeta**2 - 1) / wd  # where the acceleration is 0
    t = t if t > 0 else t + math.pi / wd
    return float(-speed * math.exp(-zeta * w * t) * (math.cos(wd * t) - zeta * w / wd * math.sin(wd * t)))


@pytest.mark.parametrize("speed", [0.01, 0.3, 2.0])
@pytest.mark.parametrize("stiffness", [1e2, 1e4, 1e6])
@pytest.mark.parametrize("c", [0.0, 0.3, 3.0])
def test_a_mass_bounces_off_as_the_closed_form_says(c: float, stiffness: float, speed: float) -> None:
    """Its energy to 1 %, at the step that a run takes; half the step is nearer."""
    w = math.sqrt(stiffness / MASS)
    free = Mobility(np.diag([1 / MASS] * 3 + [0.0] * 3), np.eye(3), np.zeros(1), np.zeros(1))
    for normal, damping, right in (
        (HuntCrossley(), c, hunt_crossley(c, speed)),
        (
            Linear(),
            2 * min(0.2 * c, 0.7) * w * MASS,
            linear(stiffness, 2 * min(0.2 * c, 0.7) * w * MASS, speed),
        ),
    ):
        surface = wall(normal, stiffness=stiffness, damping=damping)
        errors = []
        for finer in (1, 4):
            step = TOUCHING / surface.rate(free) / finer
            energy = speed_after(normal, step, stiffness, damping, speed) ** 2 / right**2
            errors.append(abs(energy - 1))
        assert errors[0] < 0.01
        assert errors[1] < max(errors[0] / 3, 1e-6)


def test_a_bristle_holds_for_good_and_then_gives_exactly_its_limit() -> None:
    """Pushed with 40 % of μ f it does not creep; with more than μ f it slides, and the force is μ f."""
    weight, mu = 20.0, 0.5
    surface = wall(
        HuntCrossley(), stiffness=1e4, damping=1.0, friction=mu, bristle_stiffness=1e4, viscous=0.0
    )
    f = ball(surface)

    def pushed(by: float) -> np.ndarray:
        push = np.zeros(9)
        push[3], push[5] = by / MASS, -weight / MASS
        damper = np.zeros(9)

        def slopes(x: np.ndarray) -> np.ndarray:
            damper[3:6] = -x[3:6] * 400 / MASS if by < mu * weight else 0  # it comes to rest
            return f(x) + push + damper

        start = np.array([0, 0, -weight / 1e4, 0, 0, 0, 0, 0, 0], dtype=float)
        return followed(slopes, start, 1e-4, 1.0)

    held = pushed(0.4 * mu * weight)
    assert abs(held[-1, 0] - 0.4 * mu * weight / 1e4) < 1e-9
    assert abs(held[-1, 0] - held[5000, 0]) < 1e-10
    slid = pushed(1.6 * mu * weight)
    acceleration = np.gradient(slid[:, 3], 1e-4)[2000:]
    np.testing.assert_allclose(acceleration, 0.6 * mu * weight / MASS, rtol=2e-3)
