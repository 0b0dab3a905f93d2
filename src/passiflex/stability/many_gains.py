"""Of very many gains that a law goes over to, those that matter: found by what all their loops have in common.

Near rest the torque of the law is linear in K_x and D_x, and with the plain inner loop so is the map of one period:
A(K, D) = A₀ + Σ K_ij A_ij + Σ D_ij A'_ij. A few maps then give those of thousands of gains, and their eigenvalues
say which of them are nearest to being unstable. That it is so is checked on those that are found; where it is not, as
with the matched inner loop, each is judged.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from passiflex.problems.problem import GainChange
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.modes import coupled, lingers

Array = NDArray[np.float64]

FEW = 40
"""So many gains are judged each."""
MOST = 20_000
"""So many are looked at."""
MOST_EACH = 1000
"""So many are judged each where the map is not linear in them."""
NEAREST = 12
"""Of many, so many are judged: those whose motions last longest, of those that may be drift as many again."""
AT_ONCE = 200
"""Maps whose eigenvalues are made at a time."""
LINEAR = 1e-5
"""Share of a map's largest entry by which it may differ from what linearity says of it."""


def judged_gains(loop: LinearLoop, delay: float) -> tuple[GainChange, ...]:
    """Return those of the gains told that are to be judged at a delay [s]: all, or the worst of many."""
    told = loop.problem.told_gains
    if len(told) <= FEW:
        return told
    looked = extremes(told, MOST)
    numbers = np.array([_numbers(change) for change in looked])
    varied = np.flatnonzero(np.ptp(numbers, axis=0) > 0)
    centre, coordinates = numbers.mean(axis=0), numbers[:, varied] - numbers[:, varied].mean(axis=0)
    first, slopes = _maps(loop, delay, centre, varied, np.abs(coordinates).max(axis=0))
    chosen = _nearest(first, slopes, coordinates, loop.cycle())
    for i in chosen:
        true = _map(loop, delay, numbers[i])
        if np.abs(first + np.tensordot(coordinates[i], slopes, 1) - true).max() > LINEAR * np.abs(true).max():
            return extremes(told, MOST_EACH)
    return tuple(looked[i] for i in chosen)


def extremes(changes: Sequence[GainChange], most: int) -> tuple[GainChange, ...]:
    """Return all, or of more than `most` those with the least and the largest of each entry, and some in between."""
    if len(changes) <= most:
        return tuple(changes)
    numbers = np.array([_numbers(change) for change in changes])
    ends = {*numbers.argmin(axis=0).tolist(), *numbers.argmax(axis=0).tolist()}
    between = np.linspace(0, len(changes) - 1, max(most - len(ends), 2)).astype(int)
    return tuple(changes[i] for i in sorted({*ends, *between.tolist()}))


def _numbers(change: GainChange) -> Array:
    """Return the entries of K_x and D_x on and above the diagonal."""
    upper = np.triu_indices(len(change.stiffness))
    return np.concatenate([change.stiffness[upper], change.damping[upper]])


def _map(loop: LinearLoop, delay: float, numbers: Array) -> Array:
    """Return the map of a period with the gains of these entries."""
    k = int(np.sqrt(len(numbers)))  # two times k (k + 1) / 2
    upper, gains = np.triu_indices(k), np.zeros((2, k, k))
    for matrix, half in zip(gains, np.split(numbers, 2), strict=True):
        matrix[upper] = matrix.T[upper] = half
    return loop.matrix(delay=delay, gains={"stiffness": gains[0], "damping": gains[1]})


def _maps(
    loop: LinearLoop, delay: float, centre: Array, varied: NDArray[np.intp], reach: Array
) -> tuple[Array, Array]:
    """Return the map at the centre (N, N), and its derivatives by the entries that vary, (m, N, N)."""
    first = _map(loop, delay, centre)
    slopes = []
    for i, step in zip(varied, reach, strict=True):
        there = centre.copy()
        there[i] += step
        slopes.append((_map(loop, delay, there) - first) / step)
    return first, np.array(slopes)


def _nearest(first: Array, slopes: Array, coordinates: Array, period: float) -> list[int]:
    """Return which maps have the motions that last longest; what is slow enough to be drift counts by itself."""
    kept = coupled(np.abs(first) + np.abs(slopes).sum(axis=0)).kept
    tight = np.ix_(kept, kept)
    flat = slopes[:, tight[0], tight[1]].reshape(len(slopes), -1)
    fast, drifting = np.zeros((2, len(coordinates)))
    for begin in range(0, len(coordinates), AT_ONCE):
        part = slice(begin, begin + AT_ONCE)
        maps = first[tight] + (coordinates[part] @ flat).reshape(-1, len(kept), len(kept))
        values = np.linalg.eigvals(maps)
        sizes, still = np.abs(values), lingers(values, period)
        fast[part] = np.where(still, 0, sizes).max(axis=1)
        drifting[part] = still.sum(axis=1) + np.where(still, sizes, 0).max(axis=1)
    worst = [np.argsort(-scores, kind="stable")[:NEAREST] for scores in (fast, drifting)]
    return sorted({*worst[0].tolist(), *worst[1].tolist()})
