"""How long a step of Runge-Kutta 4 may be: the fastest pole of a vector field, and the steps that it asks for."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from passiflex.errors import ValueRangeError
from passiflex.native.function import NativeFunction

STABILITY_LIMIT = 2.78
"""Largest h·|λ| at which Runge-Kutta 4 is stable (2.785 on the real, 2.828 on the imaginary axis)."""


def fastest_pole(rhs: NativeFunction, x: ArrayLike, u: ArrayLike, p: ArrayLike) -> float:
    """Return max |λ| [1/s] of the Jacobian ∂(dx)/∂x, by central differences at (x, u, p).

    Raises
    ------
    ValueRangeError
        If the slope is not finite around x.
    """
    x = np.atleast_1d(np.asarray(x, dtype=float))
    if x.size == 0:
        return 0.0
    # The step that balances truncation (h²) against rounding (ε/h).
    h = np.cbrt(np.finfo(float).eps) * np.maximum(np.abs(x), 1.0)
    above, below = x + np.diag(h), x - np.diag(h)
    dx = rhs.map(np.vstack([above, below]), u, p)[0]
    jacobian = ((dx[: x.size] - dx[x.size :]) / (np.diag(above) - np.diag(below))[:, None]).T
    if not np.isfinite(jacobian).all():
        raise ValueRangeError("the slope around this state is not finite", got=f"x = {x}")
    return float(np.abs(np.linalg.eigvals(jacobian)).max())


def stable_step(pole: float, period: float, safety: float = 0.5) -> int:
    """Return the number of Runge-Kutta 4 steps per period with h·|λ| ≤ safety · 2.78.

    Parameters
    ----------
    pole: |λ| of the fastest mode [1/s], see `fastest_pole`.
    period: Length of a period [s].
    safety: Share of the stability limit; 1 is the edge.

    Raises
    ------
    ValueRangeError
        For a number that is negative, zero (period, safety) or not finite.
    """
    for name, value, least in (
        ("pole", pole, 0.0),
        ("period", period, math.ulp(0)),
        ("safety", safety, math.ulp(0)),
    ):
        if not (math.isfinite(value) and value >= least):
            raise ValueRangeError(name, got=value, needs="a positive number")
    return max(1, math.ceil(pole * period / (safety * STABILITY_LIMIT)))
