"""Fewer points of long series without losing a peak: least and greatest of each bin, every row where it matters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_POINTS = 6001
"""Longest series that is shown as it is: 30 s at 200 Hz."""
CLOSE = 250
"""So many rows to each side of a moment that matters are all shown: 0.25 s at 1 kHz."""
MOST_FRAMES = 2001
"""Most poses of the arm: 30 s at 67 per second."""


@dataclass(frozen=True)
class Bins:
    """Rows in stretches; each stretch in bins of its own width, two points for each bin.

    All series of the same rows share the instants of their points.
    """

    rows: int
    stretches: tuple[Stretch, ...]

    @classmethod
    def of(cls, rows: int, close: Sequence[int] = (), most: int = MOST_POINTS) -> Bins:
        """Return the narrowest bins that leave at most so many points, and every row near some of them.

        Parameters
        ----------
        close: Rows whose neighbours, `CLOSE` to each side, are all shown where other rows are not.
        """
        if rows <= most:
            return cls(rows, (Stretch(0, rows, 1),))
        width, at = -(-rows // (most // 2)), 0
        found: list[Stretch] = []
        for row in sorted(close):
            start, stop = max(row - CLOSE, at), min(row + CLOSE + 1, rows)
            if start < stop:
                found += [Stretch(at, start, width), Stretch(start, stop, 1)]
                at = stop
        found.append(Stretch(at, rows, width))
        return cls(rows, tuple(s for s in found if s.start < s.stop))

    @property
    def width(self) -> int:
        """Return the width of the widest bins; 1 leaves out nothing."""
        return max(s.width for s in self.stretches)

    def times(self, time: Array) -> Array:
        """Return the instants (N,) of the points, from the first row to the last one."""
        return np.concatenate([s.times(time[s.start : s.stop]) for s in self.stretches])

    def values(self, values: Array) -> Array:
        """Return least and greatest value of each bin in the order in which they occur; NaN if all of it is."""
        return np.concatenate([s.values(values[s.start : s.stop]) for s in self.stretches])


class Stretch(NamedTuple):
    """Rows from `start` to before `stop` in bins of `width` rows, the last bin perhaps of less."""

    start: int
    stop: int
    width: int

    def times(self, time: Array) -> Array:
        """Return the instants of the points: where each bin begins, its middle, and at last the end."""
        if self.width == 1:
            return time
        first = np.arange(0, time.size, self.width)
        second = first + self.width // 2
        second[-1] = time.size - 1
        return time[self._two_each(first, second)]

    def values(self, values: Array) -> Array:
        """Return least and greatest value of each bin in the order in which they occur; NaN if all of it is."""
        if self.width == 1:
            return values
        bins = -(-values.size // self.width)
        padded = np.full(bins * self.width, np.nan)
        padded[: values.size] = values
        table = padded.reshape(bins, self.width)
        gap = np.isnan(table)
        least = np.argmin(np.where(gap, np.inf, table), axis=1)
        greatest = np.argmax(np.where(gap, -np.inf, table), axis=1)
        start = np.arange(bins) * self.width
        first, second = np.minimum(least, greatest), np.maximum(least, greatest)
        return padded[self._two_each(start + first, start + second)]

    def _two_each(self, first: NDArray[np.int_], second: NDArray[np.int_]) -> NDArray[np.int_]:
        """Return both rows of each bin, one of a bin that is a single row."""
        both = np.column_stack([first, second]).ravel()
        return both[:-1] if (self.stop - self.start) % self.width == 1 else both


def frame_rows(rows: int, most: int = MOST_FRAMES) -> NDArray[np.int_]:
    """Return evenly spaced rows, at most so many, and always the last one."""
    stride = -(-(rows - 1) // (most - 1)) or 1
    chosen = np.arange(0, rows, stride)
    return chosen if chosen[-1] == rows - 1 else np.append(chosen, rows - 1)
