"""Masses in the plane and a law that moves them, for loops under held commands."""

from typing import NamedTuple

import casadi as cs
import numpy as np

PERIOD, MASS = 0.1, 2.0
START, FIRST_COMMAND = np.array([0.3, -0.2, 0.1, 0.4]), np.array([0.7, -0.5])
GAINS = np.array([3.0, 0.8, 0.1])


def plane(name, pull):
    """Return a mass in the plane under command and push, with ∫ commandᵀv, ∫ pushᵀv and ∫ 1."""
    x, u, p = cs.SX.sym("x", 4), cs.SX.sym("u", 4), cs.SX.sym("p")
    q, v, given, push = x[:2], x[2:], u[:2], u[2:]
    powers = cs.vertcat(cs.dot(given, v), cs.dot(push, v), 1)
    return cs.Function(name, [x, u, p], [cs.vertcat(v, (given + push) / p + pull(q)), powers])


def cart():
    """Return a free mass: Runge-Kutta is exact up to rounding, every hold is visible."""
    return plane("cart", lambda q: cs.SX.zeros(2))


def pendulum():
    return plane("pendulum", lambda q: -9 * cs.sin(q))


def runaway():
    """Return dx₀/dt = x₀² + push, which reaches infinity at t = 1/x₀ without one; it has no quadratures."""
    x, u, p = cs.SX.sym("x", 4), cs.SX.sym("u", 4), cs.SX.sym("p")
    dx = cs.vertcat(x[0] ** 2 + u[2], u[0], 0, 0)
    return cs.Function("runaway", [x, u, p], [dx, cs.SX(0, 1)])


def regulator():
    """Return a law that counts how often it ran, and commands by that too: row = (push, target)."""
    x, c, row, p = cs.SX.sym("x", 4), cs.SX.sym("c", 3), cs.SX.sym("row", 4), cs.SX.sym("p", 3)
    command = p[0] * (row[2:] - x[:2]) - p[1] * x[2:] + p[2] * c[0]
    after = cs.vertcat(c[0] + 1, x[:2])
    return cs.Function("regulator", [x, c, row, p], [after, command, cs.vertcat(c[1:], command)])


class Scheduled(NamedTuple):
    rows: np.ndarray
    timing: np.ndarray


def told(count, delay, missed=0.0, seed=5):
    """Return random rows; `delay` in periods is one number, or the most of a uniform distribution from 0."""
    rng = np.random.default_rng(seed)
    delays = delay * PERIOD * (rng.random(count) if isinstance(delay, np.ndarray) else np.ones(count))
    runs = (rng.random(count) >= missed).astype(float)
    return Scheduled(rng.uniform(-1, 1, (count, 4)), np.column_stack([delays, runs]))


def run(loop, t, longest=PERIOD, state=None, gains=GAINS, **how):
    state = state or loop.start(START, np.zeros(3), FIRST_COMMAND)
    return loop.advance(state, *t, [MASS], gains, PERIOD, longest, **how)
