"""Shares and quantiles of independent samples, with intervals that hold whatever the distribution."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom, binomtest

from passiflex.errors import ValueRangeError

Array = NDArray[np.float64]


class Share(NamedTuple):
    """How often something occurred: `count` of `of`, the share of them and its interval.

    Of no samples the share is NaN, and the interval is all from 0 to 1.
    """

    name: str
    count: int  # type: ignore[assignment]  # for once not how often a value is in the tuple
    of: int
    share: float
    low: float
    high: float


class Quantile(NamedTuple):
    """The value below which a share of `probability` lies, and its interval; an end may be infinite."""

    probability: float
    value: float
    low: float
    high: float


def share_of(name: str, count: int, of: int, level: float) -> Share:
    """Return a share with the interval of Clopper and Pearson, which covers the truth with `level` at least."""
    if of == 0:
        return Share(name, 0, 0, math.nan, 0.0, 1.0)
    found = binomtest(count, of).proportion_ci(level, method="exact")
    return Share(name, count, of, count / of, float(found.low), float(found.high))


def quantile_of(values: Array, probability: float, level: float) -> Quantile:
    """Return a quantile between two order statistics, which enclose the true one with `level` at least.

    Of n independent values B ~ binomial(n, p) are at or below the quantile of p, so that the interval
    x_(l) … x_(u) misses it with P(B < l) + P(B ≥ u), each at most half of 1 − level. Where n is too small for
    an end, that end is infinite.

    Parameters
    ----------
    values: (n,), finite, sorted.
    """
    n, miss = values.size, (1 - level) / 2
    if n == 0:
        return Quantile(probability, math.nan, -math.inf, math.inf)
    lower, upper = int(binom.ppf(miss, n, probability)), int(binom.ppf(1 - miss, n, probability)) + 1
    return Quantile(
        probability,
        float(np.quantile(values, probability, method="median_unbiased")),
        float(values[lower - 1]) if lower >= 1 else -math.inf,
        float(values[upper - 1]) if upper <= n else math.inf,
    )


def require_level(level: float) -> None:
    """Raise ValueRangeError unless a level is a share between 0 and 1."""
    if not 0 < level < 1:
        raise ValueRangeError("level", got=f"{level:g}", needs="a share above 0 and below 1, as 0.95")
