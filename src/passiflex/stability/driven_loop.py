"""The linear loop with the noise of its torque sensors: what goes in, and the command that comes out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.stability.law_slope import Gains
from passiflex.stability.linear_loop import LinearLoop

Array = NDArray[np.float64]


class DrivenLoop(NamedTuple):
    """z⁺ = A z + G w, τ = C z + D w: a loop with the noise w of the torque sensors, and its command τ.

    Attributes
    ----------
    A: (N, N), a map of `LinearLoop.maps`.
    G, C, D: (N, n), (n, N), (n, n).
    """

    A: Array
    G: Array
    C: Array
    D: Array

    def then(self, later: DrivenLoop) -> DrivenLoop:
        """Return both, one after the other: their w and τ stand one below the other."""
        none = np.zeros((len(self.D), later.D.shape[1]))
        return DrivenLoop(
            later.A @ self.A,
            np.hstack([later.A @ self.G, later.G]),
            np.vstack([self.C, later.C @ self.A]),
            np.block([[self.D, none], [later.C @ self.G, later.D]]),
        )


def driven(loop: LinearLoop, delay: float | None = None, gains: Gains | None = None) -> list[DrivenLoop]:
    """Return the periods of a cycle, in their order."""
    timing, n, told = loop.timing(delay=delay), loop.n, loop.x.size + loop.remembered.size
    flow, of = loop.flow(timing), dict[bool, DrivenLoop]()
    for due in dict.fromkeys(loop.phases):
        ran = loop.runs(timing, gains, noise=True, due=due)
        now, heard = ran[:, : len(flow)], ran[:, len(flow) : len(flow) + n]
        sent = slice(told, told + n)
        of[due] = DrivenLoop(flow @ now, flow @ heard, now[sent], heard[sent])
    return [of[due] for due in loop.phases]


def whole_cycle(periods: Sequence[DrivenLoop]) -> DrivenLoop:
    """Return the periods of a cycle as one."""
    found = periods[0]
    for later in periods[1:]:
        found = found.then(later)
    return found
