"""Fewer points of long series without losing a peak: of each bin of rows the least and the greatest value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_POINTS = 6001
"""Longest series that is shown as it is: 30 s at 200 Hz."""
MOST_FRAMES = 2001
"""Most poses of the arm: 30 s at 67 per second."""


@dataclass(frozen=True)
class Bins:
    """Bins of `width` rows each, the last one perhaps of less: two points for each; width 1 leaves out nothing.

    All series of the same rows share the instants of their points.
    """

    rows: int
    width: int

    @classmethod
    def of(cls, rows: int, most: int = MOST_POINTS) -> Bins:
        """Return the narrowest bins that leave at most so many points."""
        return cls(rows, 1 if rows <= most else -(-rows // (most // 2)))

    @property
    def _last_is_alone(self) -> bool:
        return self.rows % self.width == 1

    def times(self, time: Array) -> Array:
        """Return the instants (N,) of the points: where each bin begins, its middle, and at last the end."""
        if self.width == 1:
            return time
        first = np.arange(0, self.rows, self.width)
        second = first + self.width // 2
        second[-1] = self.rows - 1
        return time[self._two_each(first, second)]

    def values(self, values: Array) -> Array:
        """Return least and greatest value of each bin in the order in which they occur; NaN if all of it is."""
        if self.width == 1:
            return values
        bins = -(-self.rows // self.width)
        padded = np.full(bins * self.width, np.nan)
        padded[: self.rows] = values
        table = padded.reshape(bins, self.width)
        gap = np.isnan(table)
        least = np.argmin(np.where(gap, np.inf, table), axis=1)
        greatest = np.argmax(np.where(gap, -np.inf, table), axis=1)
        start = np.arange(bins) * self.width
        first, second = np.minimum(least, greatest), np.maximum(least, greatest)
        return padded[self._two_each(start + first, start + second)]

    def _two_each(self, first: NDArray[np.int_], second: NDArray[np.int_]) -> NDArray[np.int_]:
        both = np.column_stack([first, second]).ravel()
        return both[:-1] if self._last_is_alone else both


def frame_rows(rows: int, most: int = MOST_FRAMES) -> NDArray[np.int_]:
    """Return evenly spaced rows, at most so many, and always the last one."""
    stride = -(-(rows - 1) // (most - 1)) or 1
    chosen = np.arange(0, rows, stride)
    return chosen if chosen[-1] == rows - 1 else np.append(chosen, rows - 1)
