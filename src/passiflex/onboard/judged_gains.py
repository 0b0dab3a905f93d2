"""Whether gains hold that somebody sends, and how much of them, in a process that does not disturb a loop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.problems.altered import altered
from passiflex.problems.problem import SampledProblem, require_sampled
from passiflex.problems.resolution import resolve
from passiflex.scenarios.scenario_file import parse_scenario
from passiflex.stability.judgement import Judgement, judge

Array = NDArray[np.float64]

HALVINGS = 6
"""Of the way from gains that hold to those that are asked for."""
ROOM = 0.9
"""Share of the way to the border that is taken."""
_problem: list[SampledProblem] = []


class Gains(NamedTuple):
    """K_x and D_x (k, k)."""

    stiffness: Array
    damping: Array

    def same(self, other: Gains) -> bool:
        """Return whether others are the same."""
        return all(np.array_equal(mine, its) for mine, its in zip(self, other, strict=True))


class Judged(NamedTuple):
    """Gains that hold, what was asked for, and why it is not that; empty if it is."""

    gains: Gains
    asked: Gains
    why: str


def prepare(text: str) -> None:
    """Make ready to judge gains of a scenario, as a process begins."""
    _problem[:] = [require_sampled(resolve(parse_scenario(text, "guarded")))]
    judge(_problem[0])


def judged(asked: Gains, before: Gains) -> Judged:
    """Return the gains that are asked for if they hold, else as far on the way to them, from those before, as holds."""
    found = _found(asked)
    if found.stable:
        return Judged(asked, asked, "")
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if _found(_between(before, asked, middle)).stable else (low, middle)
    share = ROOM * low
    while share and not _found(_between(before, asked, share)).stable:
        share = share / 2 if share > 1e-2 else 0.0
    mode = found.spectrum
    why = (
        f"gains taken {share:.0%} of the way: with all of it joint {mode.joint} would tremble at "
        f"{mode.frequency:.2g} Hz, growing by {-mode.decay:.2g} 1/s"
    )
    return Judged(_between(before, asked, share), asked, why)


def _between(before: Gains, asked: Gains, share: float) -> Gains:
    return Gains(*(a + share * (b - a) for a, b in zip(before, asked, strict=True))) if share else before


def _found(gains: Gains) -> Judgement:
    return judge(altered(_problem[0], gains=gains._asdict()))
