"""How much motor torque the noise of the joint torque sensors makes, by the covariance of the linear loop."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.stability.driven_loop import DrivenLoop, driven, whole_cycle
from passiflex.stability.law_slope import Gains
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.missed import stationary
from passiflex.stability.modes import coupled, drift_of, projector

Array = NDArray[np.float64]
Values = NDArray[Any]

NONE: Values = np.zeros(0, dtype=complex)
SLOW = 1.0
"""Frequency [Hz] below which a torque is no noise."""


def torque_by_noise(
    loop: LinearLoop, variance: float, delay: float | None = None, gains: Gains | None = None
) -> Array:
    """Return the rms motor torque (n,) [N m] by white noise of this variance [(N m)²] on each sensor.

    Of the torque what is faster than `SLOW`: the weight that a slow self-motion shifts between the joints is no
    noise of a motor. inf if the loop is not stable.
    """
    periods = driven(loop, delay, gains)
    kept = coupled(np.sum([np.abs(p.A) for p in periods], axis=0)).kept
    tight = [DrivenLoop(p.A[np.ix_(kept, kept)], p.G[kept], p.C[:, kept], p.D) for p in periods]
    whole = whole_cycle(tight).A
    values = np.linalg.eigvals(whole)
    drift = drift_of(whole, values, loop.cycle(), loop.task_jacobian)
    if np.abs(values[~drift]).max(initial=0.0) >= 1:
        return np.full(loop.n, np.inf)
    fast = whole_cycle([quick(p, loop.problem.period) for p in tight])
    rms = rms_torque(fast, variance, values[drift]).reshape(len(periods), loop.n)
    return np.asarray(np.sqrt(np.mean(rms**2, axis=0)))


def quick(loop: DrivenLoop, period: float) -> DrivenLoop:
    """Return the loop with the command less its own low-pass of pole `SLOW` in place of the command."""
    A, G, C, D = loop
    share, n = 1 - math.exp(-2 * math.pi * SLOW * period), len(C)
    return DrivenLoop(
        np.block([[A, np.zeros((len(A), n))], [share * C, (1 - share) * np.eye(n)]]),
        np.vstack([G, share * D]),
        np.hstack([C, -np.eye(n)]),
        D,
    )


def rms_torque(loop: DrivenLoop, variance: float, drift: Values = NONE) -> Array:
    """Return the rms of τ by white noise w, where all eigenvalues but those of a drift are stable.

    z⁺ = A z + G w with τ = C z + D w has the covariance P = A P Aᵀ + σ² G Gᵀ, and τ the variances
    diag(C P Cᵀ + σ² D Dᵀ). What drifts is taken out first.
    """
    A, G, C, D = loop
    if drift.size:
        rest = np.eye(len(A)) - projector(A, drift)
        A, G = A @ rest, rest @ G
    P = stationary(A, G @ G.T)
    return np.sqrt(variance * np.maximum(np.diag(C @ P @ C.T + D @ D.T), 0.0))
