"""What goes from one call of a sampled loop to the next, and what it records."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class LoopState(NamedTuple):
    """Everything that goes from one call to the next.

    Attributes
    ----------
    x: State of the plant.
    quads: Its quadratures (energies) since the start.
    controller: State of the controller.
    line: Commands on their way, as `held_loop.c` has them.
    signals: What the controller said last.
    watched: What the watch remembers; zeros before it saw anything.
    """

    x: Array
    quads: Array
    controller: Array
    line: Array
    signals: Array
    watched: Array = np.zeros(0)


class Samples(NamedTuple):
    """Recorded samples, each taken after the controller ran.

    `completed` below the number of rows is the sample at which a number ceased to be finite; rows that
    were not reached are NaN.
    """

    x: Array
    quads: Array
    controller: Array
    command: Array
    signals: Array
    completed: int
    state: LoopState
