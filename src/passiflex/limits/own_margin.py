"""How far a robot may be off before the gains of its own scenario no longer hold."""

from __future__ import annotations

from typing import NamedTuple

from passiflex.limits.margin_box import NEAR, MarginBox, Worst
from passiflex.problems.free_space import in_free_space
from passiflex.problems.problem import SampledProblem

MOST = 0.3
"""Largest margin that is looked for."""
HALVINGS, STEP = 4, 0.02


class OwnMargin(NamedTuple):
    """What the gains of a problem bear at its start and near it.

    Attributes
    ----------
    share: B, K, D and the links' inertia of each joint may be off by this share, the delay by this share of a period;
        at most `MOST`.
    corner: The member of a slightly larger box that does not hold, in words; empty if `share` is `MOST`.
    """

    share: float
    corner: str

    @property
    def words(self) -> str:
        """Return it in words."""
        off = (
            f"at the start and within {NEAR:g} rad of it B, K, D, links' inertia of each joint and the delay"
        )
        if not self.corner:
            return f"margin: {off} may be off by {100 * self.share:g} % and more"
        robot = f"a robot with {self.corner} does not hold"
        if not self.share:
            return f"margin: none; with {100 * MOST / 2**HALVINGS:.2g} % off, {robot}"
        return f"margin: {off} may be off by {100 * self.share:.2g} %; beyond, {robot}"


def own_margin(problem: SampledProblem) -> OwnMargin:
    """Return the margin of a problem's own gains; 0 if the robot itself does not hold.

    By halving with quick searches of the box, then downward in steps until a thorough one finds nothing.
    """
    low, high, share, corner = 0.0, MOST, MOST, ""
    for _ in range(HALVINGS + 1):
        worst, words = _worst(problem, share, thorough=False)
        if worst.stable:
            low = share
        else:
            high, corner = share, words
        if low == MOST:
            break
        share = (low + high) / 2
    while low > 0:
        worst, words = _worst(problem, low, thorough=True)
        if worst.stable:
            break
        low, corner = max(low - STEP, 0.0), words
    return OwnMargin(low, corner if low < MOST else "")


def _worst(problem: SampledProblem, share: float, *, thorough: bool) -> tuple[Worst, str]:
    box = MarginBox((in_free_space(problem),), share)
    worst = box.search({}, 0, thorough=thorough)
    return worst, box.words(worst.member)
