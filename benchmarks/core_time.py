"""Times of several works by turns, on the wall and as work of the cores."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def walls_and_cores(repeats: int, *works: Callable[[], object]) -> Array:
    """Return the time on the wall and of this process's cores [s], (repeats, works, 2), by turns."""
    for work in works:
        work()
    times = np.empty((repeats, len(works), 2))
    for row in times:
        for pair, work in zip(row, works, strict=True):
            start, cores = time.perf_counter(), time.process_time()
            work()
            pair[:] = time.perf_counter() - start, time.process_time() - cores
    return times


def best_times(repeats: int, *works: Callable[[], object]) -> list[float]:
    """Return the best time of each [s], by wall or cores, whichever is less.

    Others on the machine stretch the one, threads of libraries that wait by spinning the other.
    """
    return [float(t) for t in walls_and_cores(repeats, *works).min(axis=(0, 2))]
