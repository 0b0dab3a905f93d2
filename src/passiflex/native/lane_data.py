"""What goes into native lanes and what comes out of them: arrays whose last axis is the lane."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.errors import SizeError

Array = NDArray[np.float64]

REGISTER = 64
"""Bytes of the widest registers; numbers that go into them start at a multiple of it."""


class Change(NamedTuple):
    """From this period on, a lane is scheduled these numbers."""

    period: int
    lane: int
    scheduled: Array


class LaneState(NamedTuple):
    """Everything that goes from one call to the next; the last axis of all but `line` is the lane.

    Attributes
    ----------
    y: States of the plants and their quadratures.
    controller, signals: As of `LoopState`.
    line: Commands on their way, a row for each lane.
    scheduled: What was scheduled last.
    watched: What the watch remembers.
    """

    y: Array
    controller: Array
    signals: Array
    line: Array
    scheduled: Array
    watched: Array


class LaneSamples(NamedTuple):
    """The samples of a stretch.

    Attributes
    ----------
    values: What was kept (rows, kept, lanes).
    completed: For each lane the sample at which its state ceased to be finite, or the number of samples.
    whole: For each lane the rows before the first of which any number, kept or not, is not finite.
    state: After the stretch.
    """

    values: Array
    completed: NDArray[np.int64]
    whole: NDArray[np.int64]
    state: LaneState


class LaneInputs(NamedTuple):
    """What drives the lanes through one stretch of N periods; the last axis is the lane.

    Attributes
    ----------
    first: Number of its first period.
    changes: What is scheduled anew in it, by period.
    drawn: Numbers of chance (N, n_drawn, lanes).
    timing: Delay of each command [s] ≥ 0, and whether the controller runs (N, 2, lanes).
    """

    first: int
    changes: Sequence[Change]
    drawn: Array
    timing: Array


def aligned(name: str, value: Array | None, shape: tuple[int, ...]) -> Array:
    """Return a copy whose numbers start where wide registers want them; NaN for no value."""
    if value is not None and np.shape(value) != shape:
        raise SizeError(name, got=np.shape(value), needs=f"shape {shape}")
    size = int(np.prod(shape))
    room = np.empty(size + REGISTER // 8)
    start = -room.ctypes.data % REGISTER // 8
    copy = room[start : start + size].reshape(shape)
    copy[...] = np.nan if value is None else value
    return copy
