"""The numbers that the figures are summed up in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def overshoot(time: Array, displacement: Array, step: float, begin: float, end: float) -> float:
    """Return how far the response to a step goes beyond it within [begin, end), as a fraction of the step."""
    window = (time >= begin) & (time < end)
    return float((displacement[window] / step).max() - 1) if window.any() else float("nan")


def settling_time(
    time: Array, displacement: Array, step: float, begin: float, end: float, band: float = 0.02
) -> float:
    """Return the time from the step until the response stays within `band` of it [s].

    Infinite if it does not settle before `end`, has no samples there, or ends before: where not even one
    more row would have had its place.
    """
    window = np.flatnonzero((time >= begin) & (time < end))
    whole = time[-1] >= end - 1e-9 or 2 * time[-1] - time[-2:][0] > end + 1e-9
    outside = window[np.abs(displacement[window] / step - 1) > band]
    if not window.size or not whole or (outside.size and outside[-1] == window[-1]):
        return float("inf")
    return float(time[outside[-1] + 1] - begin) if outside.size else 0.0


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else float("nan")


def largest_rise(values: Array) -> float:
    """Return the largest rise of a signal above an earlier value."""
    return float((values - np.minimum.accumulate(values)).max())
