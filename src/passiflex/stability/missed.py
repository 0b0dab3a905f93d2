"""Periods in which the law does not run, at random: does the mean square of the motion die out?

Between two runs of the law lie g periods, g = 1, 2, … with probability (1 − p) pᵍ⁻¹ if each period is missed with
probability p. From run to run, just after the law has commanded, the loop is w⁺ = A_g w with A_g = R(g T) (F N)ᵍ⁻¹ F:
the plant's period F, N at a sample that is missed, R(g T) where the law runs g periods after it last did. The gaps
are independent, so that P = E[w wᵀ] goes to L(P) = Σ_g (1 − p) pᵍ⁻¹ A_g P A_gᵀ (theory note 5.5). The mean square
dies out if and only if there is a P > 0 with P − L(P) > 0; one is looked for, and checked.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, gmres

from passiflex.stability.law_slope import Gains
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.modes import HELD, Modes, coupled
from passiflex.stability.timing import Timing

Array = NDArray[np.float64]

LEFT_OUT = 1e-9
"""Probability of the gaps that are longer than any that is looked at."""
DOUBLINGS = 40
RESTART, ROUNDS = 60, 2
"""Of the iteration that looks for P: a few dozen steps suffice unless the border is near."""


class Gaps(NamedTuple):
    """The maps A_g (G, N, N) of gaps of g = 1 … G periods, what drifts taken out, and their chances (G,)."""

    maps: Array
    chances: Array


def dies_out(loop: LinearLoop, missed: float, delay: float | None = None, gains: Gains | None = None) -> bool:
    """Return whether the mean square of the motion dies out, each period being missed with this probability."""
    maps, chances = gaps(loop, missed, delay, gains)
    mean = np.tensordot(chances, maps, 1)
    if not np.abs(np.linalg.eigvals(mean)).max(initial=0.0) < 1:
        return False  # E[w] does not die out, and its square is no larger than the mean of the square
    scale = 1 / np.sqrt(np.diag(stationary(mean, np.eye(len(mean)))))
    maps = scale[:, None] * maps / scale
    return _certified(maps, chances)


def gaps(loop: LinearLoop, missed: float, delay: float | None = None, gains: Gains | None = None) -> Gaps:
    """Return the maps from run to run, and how likely they are."""
    T = loop.problem.period
    timing = Timing.of(T, loop.problem.delay if delay is None else delay, least=1)
    count = max(1, math.ceil(math.log(LEFT_OUT) / math.log(missed))) if missed > 0 else 1
    flow, skip = loop.flow(timing), loop.misses(timing)
    maps, still = [], flow
    for g in range(1, count + 1):
        maps.append(loop.runs(timing, gains, g * T) @ still)
        still = flow @ skip @ still
    kept = coupled(np.sum(np.abs(maps), axis=0)).kept
    tight = [A[np.ix_(kept, kept)] for A in maps]
    Q = _without_drift(tight[0], T, loop.task_jacobian)
    chances = (1 - missed) * missed ** np.arange(count)
    return Gaps(np.array([Q.T @ A @ Q for A in tight]), chances / chances.sum())


def stationary(A: Array, Q: Array) -> Array:
    """Return P = Q + A P Aᵀ for a stable A, by doubling."""
    P, power = Q, A
    for _ in range(DOUBLINGS):
        P = P + power @ P @ power.T
        power = power @ power
        if np.abs(power).max() < 1e-12:
            break
    return P


def _certified(maps: Array, chances: Array) -> bool:
    """Return whether a P > 0 with P − L(P) > 0 was found: that of P − L(P) = I, from what the mean map makes of it."""
    n = maps.shape[1]
    weighted, turned = chances[:, None, None] * maps, maps.transpose(0, 2, 1).copy()
    mean = weighted.sum(axis=0)

    def left(flat: Array) -> Array:
        P = flat.reshape(n, n)
        return np.asarray(P - (weighted @ P @ turned).sum(axis=0)).ravel()

    size, eye = (n * n, n * n), np.eye(n).ravel()
    nearly = LinearOperator(size, matvec=lambda v: stationary(mean, v.reshape(n, n)).ravel())
    found, _ = gmres(
        LinearOperator(size, matvec=left), eye, M=nearly, rtol=1e-6, restart=RESTART, maxiter=ROUNDS
    )
    P = found.reshape(n, n) + found.reshape(n, n).T
    rest = left(P.ravel()).reshape(n, n)
    if not (np.isfinite(P).all() and np.isfinite(rest).all()):
        return False
    return bool(np.linalg.eigvalsh(P)[0] > 0 and np.linalg.eigvalsh(rest + rest.T)[0] > 0)


def _without_drift(first: Array, period: float, task_jacobian: Array) -> Array:
    """Return an orthonormal basis Q (N, M) of what does not drift: that is the same after every gap."""
    modes = Modes.of(first, period, task_jacobian)
    drift = modes.vectors[:, modes.drifting & (np.abs(modes.values) > 1 - HELD)]
    if not drift.size:
        return np.eye(len(first))
    U, sizes, _ = np.linalg.svd(np.hstack([drift.real, drift.imag]))
    return np.asarray(U[:, int((sizes > 1e-6 * sizes[0]).sum()) :])
