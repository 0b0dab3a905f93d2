"""What goes from one call of a sampled loop to the next, and what it records."""

from __future__ import annotations

from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Watch(NamedTuple):
    """Two functions that see a loop and remember what they need.

    Attributes
    ----------
    look: At every sample, after the controller ran: (memory, time, (x, quads), command, c, signals, p) → memory.
    glance: At the end of every step of the plant: (memory, time, (x, quads), p) → memory.
    """

    look: cs.Function
    glance: cs.Function

    @property
    def size(self) -> int:
        """Return the size of the memory."""
        return int(self.look.size1_in(0))

    @property
    def parameters(self) -> int:
        """Return the number of parameters, which both are given."""
        return int(self.look.size1_in(6))


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

    `completed` below the number of rows is the sample at which a number ceased to be finite, or at which who moves the
    plant could go no further, and said `why`; rows that were not reached are NaN.
    """

    x: Array
    quads: Array
    controller: Array
    command: Array
    signals: Array
    completed: int
    state: LoopState
    why: str = ""
