"""Which parameters a metric hangs on: rank correlations, differences between words, first-order indices."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import kruskal, rankdata
from scipy.stats import t as student

Array = NDArray[np.float64]

LEAST = 4
"""Fewest samples of a rank correlation: below, its p-value means nothing."""
LEAST_INDEX = 32
"""Fewest samples of a first-order index: bins of five at least."""
MOST_BINS = 64
RESAMPLES, GROUPS = 400, 512
"""Of the bootstrap: how often, and of how many groups of samples."""


class Index(NamedTuple):
    """First-order index: the share of the variance that goes with one parameter alone, and its interval."""

    value: float
    low: float
    high: float


class Column(NamedTuple):
    """What was drawn for one parameter, or for one joint of it.

    Attributes
    ----------
    name: As in the rows.
    parameter: Path in the scenario.
    joint: From 1; None for a parameter that is not per joint.
    words: Of a parameter that draws words or flags; empty if it draws numbers.
    values: (n,); of words their indices.
    """

    name: str
    parameter: str
    joint: int | None
    words: tuple[str, ...]
    values: Array


class Association(NamedTuple):
    """How much a metric hangs on a parameter.

    Attributes
    ----------
    metric, parameter, joint: What hangs on what.
    column: Name of the parameter's column in the rows.
    test: `spearman` for numbers, `kruskal` (Kruskal–Wallis) for words and flags.
    strength: Spearman's ρ; for words √(H/(n − 1)), which for two words is |ρ|. NaN if either is constant.
    p: Of no association.
    adjusted: p after Holm's correction for the number of columns, which holds however they depend on each other.
    samples: How many it is of.
    first_order: Var(E(metric | parameter)) as a share of the variance; None where it cannot be had.
    """

    metric: str
    parameter: str
    joint: int | None
    column: str
    test: str
    strength: float
    p: float
    adjusted: float
    samples: int
    first_order: Index | None

    @property
    def weight(self) -> float:
        """Return how much it matters, 0 to 1: by ranks, or by the least first-order share, which sees bends too."""
        by_rank = abs(self.strength) if math.isfinite(self.strength) else 0.0
        return max(by_rank, math.sqrt(max(self.first_order.low, 0.0)) if self.first_order else 0.0)


def associations(
    metric: str, values: Array, columns: list[Column], level: float, seed: int
) -> list[Association]:
    """Return how much a metric hangs on each column, in the order of the columns.

    Samples without a number are left out. A value of ±inf (not settled) has a rank, beyond all others; the
    first-order index is of the finite ones.

    Parameters
    ----------
    values: Of the metric, (n,).
    level: Of the intervals of the indices.
    seed: Of the bootstrap.
    """
    known, finite = ~np.isnan(values), np.isfinite(values)
    found = []
    for c in columns:
        x, y = c.values[known], values[known]
        strength, p = rank_kruskal(x, y) if c.words else rank_correlation(x, y)
        index = first_order(c.values[finite], values[finite], level, seed)
        test = "kruskal" if c.words else "spearman"
        found.append(
            Association(
                metric, c.parameter, c.joint, c.name, test, strength, p, math.nan, int(known.sum()), index
            )
        )
    corrected = holm(np.array([a.p for a in found]))
    return [a._replace(adjusted=float(p)) for a, p in zip(found, corrected, strict=True)]


def rank_correlation(x: Array, y: Array) -> tuple[float, float]:
    """Return Spearman's ρ and its p-value by Student's t; NaN if one of the two is constant or n < 4."""
    n = x.size
    if n < LEAST or _constant(x) or _constant(y):
        return math.nan, math.nan
    rho = float(np.clip(np.corrcoef(rankdata(x), rankdata(y))[0, 1], -1, 1))
    if abs(rho) == 1:
        return rho, 0.0
    return rho, float(2 * student.sf(abs(rho) * math.sqrt((n - 2) / (1 - rho**2)), n - 2))


def rank_kruskal(x: Array, y: Array) -> tuple[float, float]:
    """Return √(H/(n − 1)) of Kruskal and Wallis, between 0 and 1, and its p-value; NaN as in `rank_correlation`."""
    if x.size < LEAST or _constant(x) or _constant(y):
        return math.nan, math.nan
    found = kruskal(*(rankdata(y)[x == word] for word in np.unique(x)))  # SciPy has no ranks for ±inf
    return math.sqrt(float(np.clip(found.statistic / (x.size - 1), 0, 1))), float(found.pvalue)


def holm(p: Array) -> Array:
    """Return p-values corrected for their number after Holm (1979); NaN is none and does not count."""
    out = np.full(p.shape, math.nan)
    tested = np.flatnonzero(~np.isnan(p))
    order = tested[np.argsort(p[tested], kind="stable")]
    factors = np.arange(order.size, 0, -1)
    out[order] = np.minimum(np.maximum.accumulate(p[order] * factors), 1.0)
    return out


def first_order(x: Array, y: Array, level: float, seed: int) -> Index | None:
    """Return the first-order index of given data: the variance of the means of y over bins of x.

    The bins have equal counts, √n of them, but values of x that are equal share one. Noise alone makes the
    means differ; what it adds is taken off (ε², Kelley 1935), so that the expected index of a parameter without
    effect is zero and its estimate may be negative. The interval is by bootstrap over samples, or over groups of
    samples where there are many: basic, around the uncorrected index, whose truth is known among the resamples.
    Samples count as independent; of Sobol's and Latin hypercubes', which are more even, it is rather too wide.

    None below 32 samples, or if either is constant.
    """
    n = x.size
    if n < LEAST_INDEX or _constant(x) or _constant(y):
        return None
    bins = min(MOST_BINS, math.isqrt(n))
    place = ((rankdata(x, "min") - 1) * bins // n).astype(np.int64)
    _, place = np.unique(place, return_inverse=True)
    bins = int(place.max()) + 1
    if bins < 2:
        return None
    z = (y - y.mean()) / y.std()
    group = np.arange(n) * min(n, GROUPS) // n
    groups = int(group[-1]) + 1
    sums = np.array(
        [np.bincount(group * bins + place, power, groups * bins) for power in (np.ones(n), z, z**2)]
    ).reshape(3, groups, bins)
    raw, value = _ratios(sums.sum(axis=1, keepdims=True))
    times = (
        np.random.default_rng(seed).multinomial(groups, np.full(groups, 1 / groups), RESAMPLES).astype(float)
    )
    _, again = _ratios(times @ sums)
    low, high = np.quantile(again - raw, [(1 - level) / 2, (1 + level) / 2])
    return Index(float(value[0]), float(value[0] - high), float(value[0] - low))


def _ratios(sums: Array) -> tuple[Array, Array]:
    """Return the share of the variance between bins, uncorrected and corrected, of counts, Σy, Σy² by bin."""
    count, first, second = sums
    n, filled = count.sum(axis=1), (count > 0).sum(axis=1)
    mean = first.sum(axis=1) / n
    total = second.sum(axis=1) - n * mean**2
    between = (np.divide(first**2, count, out=np.zeros_like(first), where=count > 0)).sum(
        axis=1
    ) - n * mean**2
    raw = between / total
    return raw, 1 - (1 - raw) * (n - 1) / (n - filled)


def _constant(values: Array) -> bool:
    return bool((values == values[0]).all()) if values.size else True
