"""Rotations by a rotation vector u in world axes, R = exp([u]), with the angular velocity of a moving one.

    exp([u]) = I + a [u] + b [u]²,   ω = (I + b [u] + c [u]²) u̇,
    a = sin ϑ / ϑ,   b = (1 − cos ϑ) / ϑ²,   c = (ϑ − sin ϑ) / ϑ³,   ϑ = |u|

The second is the left Jacobian of SO(3). Near ϑ = 0 the three are their power series in ϑ², so that neither they nor
their derivatives divide by it.
"""

from __future__ import annotations

import math
from functools import cache

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

TERMS = 9
"""Of the power series: at ϑ = 1, where the closed forms take over, the next one is 1e-19."""


def turned(u: cs.SX) -> cs.SX:
    """Return exp([u]) (3, 3)."""
    a, b, _ = _coefficients(cs.dot(u, u))
    axis = cs.skew(u)
    return cs.SX.eye(3) + a * axis + b * (axis @ axis)


def angular_velocity(u: cs.SX, du: cs.SX) -> cs.SX:
    """Return ω (3,) of exp([u]) in world axes, for the rate u̇."""
    _, b, c = _coefficients(cs.dot(u, u))
    once = cs.cross(u, du)
    return du + b * once + c * cs.cross(u, once)


def rates_for(u: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> tuple[Array, Array]:
    """Return u̇ and ü (3,) with which exp([u]) has this ω and ω̇ at u, less than a whole turn."""
    jacobian, rest = _slopes()
    J = np.array(jacobian(u))
    du = np.linalg.solve(J, np.asarray(velocity, dtype=float))
    return du, np.linalg.solve(J, np.asarray(acceleration, dtype=float) - np.array(rest(u, du))[:, 0])


@cache
def _slopes() -> tuple[cs.Function, cs.Function]:
    """Return u → ∂ω/∂u̇ and (u, u̇) → ω̇ at ü = 0."""
    u, du = cs.SX.sym("u", 3), cs.SX.sym("du", 3)
    omega = angular_velocity(u, du)
    return (
        cs.Function("jacobian", [u], [cs.jacobian(omega, du)]),
        cs.Function("rest", [u, du], [cs.jtimes(omega, u, du)]),
    )


def _coefficients(square: cs.SX) -> tuple[cs.SX, cs.SX, cs.SX]:
    """Return a, b and c for ϑ²."""
    angle = cs.sqrt(cs.fmax(square, 1))
    half = cs.sin(angle / 2) / angle
    far = (cs.sin(angle) / angle, 2 * half**2, (angle - cs.sin(angle)) / angle**3)
    near = (_series(cs.fmin(square, 1), first) for first in (1, 2, 3))
    a, b, c = (cs.if_else(square < 1, n, f) for n, f in zip(near, far, strict=True))
    return a, b, c


def _series(square: cs.SX, first: int) -> cs.SX:
    """Return Σ (−ϑ²)^k / (2k + first)!."""
    total = cs.SX(0)
    for k in reversed(range(TERMS)):
        total = 1 / math.factorial(2 * k + first) - square * total
    return total
