"""What the noise of its sensors credits a measured tank with on average, by the linear loop, without drawing.

The law answers a noise n on τ_a with motion. If n lasts, the motion comes while n still does, on average against it:
E[nᵀ q̇] < 0, and a tank that books τ_aᵀ q̇ is credited with energy that nobody gave, linearly in time. A noise ν on q
multiplies −½ (τ_k+1 − τ_k−1) in Σw, of which only τ_k+1 may already answer it: where the command comes at once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import cycle, islice

import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.problems.problem import SampledProblem
from passiflex.stability.driven_loop import DrivenLoop, driven
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.many_gains import FEW, extremes
from passiflex.stability.storage_jitter import storage_jitter

POSTURES = 1.5
"""Factor on the credit at the start, for other postures on the way: of 40 random ones of the iiwa 14, the median had
1.0 and the largest 1.2 to 1.6 times as much, the more the longer the noise lasts."""
SETTLED = 1e-9
"""Relative change in a period below which an answer has settled."""
REACH = 1.0
"""Displacement [rad, m] up to which a linear loop is believed: a self-motion that nothing holds never stops in it."""


def mean_credit(periods: Sequence[DrivenLoop], joints: int, variance: float, lasting: int) -> float:
    """Return the mean of −Σ ½ (n_k + n_k+1)ᵀ (q_k+1 − q_k) per period [J], for noise n of this variance [(N m)²].

    Each sample of the noise lasts for so many periods L, and is independent of all before it, so that only
    its own answer counts: with R_j the derivative of q_j by a noise held from period 0 on, by parts,
    −½ σ² tr(R_L + R_L−1) / L. The first `joints` states are q. An answer of more than `REACH` ends there.
    Of a cycle, noise begins in the first period and every L periods from there: the mean over where that is in it.
    """
    begins = range(0, len(periods), math.gcd(lasting, len(periods)))
    return float(np.mean([_credit([*periods[k:], *periods[:k]], joints, variance, lasting) for k in begins]))


def _credit(periods: Sequence[DrivenLoop], joints: int, variance: float, lasting: int) -> float:
    answer = before = np.zeros_like(periods[0].G)
    deviation = np.sqrt(variance)
    for period in islice(cycle(periods), lasting):
        answer, before = period.A @ answer + period.G, answer
        moved = np.abs(answer[:joints]).max()
        still = np.abs((answer - before)[:joints]).max() < SETTLED * moved
        if (still and len(periods) == 1) or deviation * moved > REACH:
            break
    return -variance * float(np.trace((answer + before)[:joints])) / (2 * lasting)


def shaken(loop: LinearLoop, gains: Mapping[str, ArrayLike]) -> NDArray[np.float64]:
    """Return the derivative of τ_a after a period by the noise of the reading of q that began it (n, n).

    Of a cycle of periods, their mean.
    """
    n, timing = loop.n, loop.timing()
    runs = [loop.runs(timing, gains, noise=True, due=due) for due in loop.phases]
    flow, ran = loop.flow(timing), np.mean(runs, axis=0)
    after = flow @ ran[:, flow.shape[0] + n : flow.shape[0] + 2 * n]
    plant = loop.parts["plant"].unpack(loop.at.plant)
    K, D = np.diag(plant["joint_stiffness"]), np.diag(plant["joint_damping"])
    return np.asarray(np.hstack([-K, K, -D, D]) @ after[: 4 * n])


def noise_credit(problem: SampledProblem) -> float:
    """Return the mean power [W] that the noise of a sampled problem credits its tank with, ≥ 0, at most."""
    return max(0.0, *noise_powers(problem), 0.0)


def noise_powers(problem: SampledProblem) -> list[float]:
    """Return the mean powers [W] that the noise of a sampled problem credits its tank with, or debits it if negative.

    Those of its gains, of those that it changes to, and of its fallback, at the start. Gains that are not stable have
    none. White noise of τ_a, new in each period, is followed by no motion that it still could meet.
    """
    noise = problem.noise
    if noise is None:
        return []
    lasting, soon = round(noise.hold / problem.period), problem.lateness.link + problem.delay < problem.period
    lasts, shakes = bool(noise.variance) and lasting > 1, bool(noise.link_deviation) and soon
    if not (lasts or shakes):
        return []
    loop = LinearLoop(problem)
    later: list[Mapping[str, ArrayLike]] = [
        {"stiffness": c.stiffness, "damping": c.damping} for c in extremes(problem.told_gains, FEW)
    ]
    powers = []
    for gains in ({}, *later, loop.fallback()):
        if loop.radius(gains=gains) < 1:
            energy = mean_credit(driven(loop, gains=gains), loop.n, noise.variance, lasting) if lasts else 0.0
            energy += noise.link_deviation**2 / 2 * float(np.trace(shaken(loop, gains))) if shakes else 0.0
            powers.append(energy / problem.period)
    return powers


def charged(problem: SampledProblem) -> SampledProblem:
    """Return the sampled problem with what its noise does, `POSTURES` times, declared to its controller."""
    powers, noise = noise_powers(problem), problem.noise
    credit = max(0.0, *powers, 0.0)
    found = {"noise_credit": credit} if credit else {}
    if noise is not None and noise.moves and problem.controller.tank is not None:
        found |= {"noise_debit": max(0.0, *(-power for power in powers), 0.0)}
        found |= {f"jitter_{name}": value for name, value in storage_jitter(problem)._asdict().items()}
    declared = {name: POSTURES * value for name, value in found.items()}
    return problem.with_numbers(declared, "errors") if declared else problem
