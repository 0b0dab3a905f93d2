"""What noise on the readings of q and θ makes of the storage S that a law reads, at rest, by its own code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.problems.problem import SampledProblem
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.loop_at_rest import loop_at_rest

Array = NDArray[np.float64]

MOST_PERIODS = 60
"""For so long one reading may act on S, by velocities from differences and their low-pass."""
SETTLED = 1e-6
"""Share of the largest answer below which it is over."""
UNLIKELY = 15.0
"""Logarithm of how rarely a draw is beyond `mean`: as rare as five standard deviations."""


class Jitter(NamedTuple):
    """What is booked for noise n where S is ½ zᵀ H z and C the covariance of n, in J.

    Attributes
    ----------
    mean: Most that ½ nᵀ H n is, ½ (tr + 2 √(x λ tr) + 2 x λ) with x = `UNLIKELY`: a tail of sums of squares.
    share: λ, at least the largest eigenvalue of C H; tr its trace.
    """

    mean: float
    share: float


def storage_jitter(problem: SampledProblem) -> Jitter:
    """Return the jitter of S by the noise of q and θ of a problem, at its start.

    A reading of one joint's link or motor is moved up and down by a standard deviation, once, on a robot that
    stands still; what S is more by then, in this period and the next ones, is its part of ½ tr(C H).
    """
    noise, loop = problem.noise, LinearLoop(problem)
    assert noise is not None
    n, row_layout, memory_layout = loop.n, loop.compiled.loop.row, loop.compiled.loop.memory
    gains = problem.law.layout.unpack(problem.gains)
    memory, row, _ = loop_at_rest(problem, loop.compiled.loop, gains, problem.period, loop.at)
    deviations = np.repeat([noise.link_deviation, noise.motor_deviation], n)
    moved = np.diag(deviations)
    told = row_layout.columns(lambda f: f.name in ("link_noise", "motor_noise"))
    rows = np.tile(row, (4 * n + 1, 1))
    rows[1:, told] = np.vstack([moved, -moved])
    memories, parts, storage = (
        np.tile(memory, (4 * n + 1, 1)),
        np.zeros(2 * n),
        memory_layout.slices["law_storage"],
    )
    most = 0.0
    for _ in range(MOST_PERIODS):
        memories, _, _ = loop.compiled.control.map(
            np.tile(loop.x, (4 * n + 1, 1)), memories, rows, loop.law.numbers
        )
        S = memories[:, storage].ravel()
        more = np.maximum((S[1 : 2 * n + 1] + S[2 * n + 1 :]) / 2 - S[0], 0.0)
        parts += more
        most = max(most, float(more.max()))
        if more.max() < SETTLED * most:
            break
        rows[1:, told] = 0.0
    share = 2 * float((parts[:n] + parts[n:]).max())
    trace = 2 * float(parts.sum())
    mean = (trace + 2 * np.sqrt(UNLIKELY * share * trace) + 2 * UNLIKELY * share) / 2
    return Jitter(float(mean), share)
