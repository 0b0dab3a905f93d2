"""The verdict on a run: did the robot ever give more energy than it had?"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from passiflex.control.rigid import SHAPED
from passiflex.errors import ArgumentError
from passiflex.loops.witness import TERMS
from passiflex.passivity.extremes import Extremes, available_energy, extremes
from passiflex.passivity.ledger import (
    Balance,
    Signals,
    claimed_balance,
    environment_balance,
    link_balance,
    motor_side_storage,
    robot_balance,
)
from passiflex.problems.unbooked import listed

Verdict = Literal["passive", "violated", "inconclusive"]


@dataclass(frozen=True, eq=False)
class Audit:
    """The energy audit of one run.

    The links are passive by physics. So the robot is passive at its end effector if law and motors never
    give more to the links, W̃(t), than they had at the start: S̃₀ + T₀, what they stored and what the tank
    was filled with. A law without a tank is also allowed what the moving reference gave it. All this is an
    extremum over time: the loop notes it at every step, whatever rows it records. Of a file of before there
    are the rows alone.

    Attributes
    ----------
    verdict: `passive`, `violated`, or `inconclusive` when the margin is below the integration error or
        the run ended early.
    time: When it was decided [s]: the first overdraft, or the least margin.
    term: What took most of the energy by then.
    margin: Least of S̃₀ + T₀ − W̃ over the run [J]; negative by the largest overdraft.
    margin_time: When the margin was least [s].
    integration_error: Largest residual of the links' balance, which holds whatever the law [J].
    books_error: How wrong the law's own books are [J]: the largest residual of (28)–(29), round-off if its
        model is right; of a sampled law, the most that its tank claims beyond what is there.
    ledger_residual: Largest residual of the real robot's balance (4), and of what touches its end effector, at the
        rows [J]: an element that gives what it did not have shows here.
    unbooked: What the law's books do not know in this run, in words.
    every_step: Whether it was judged at every step; otherwise at its rows, and nobody saw what was between.
    remedy: What to do about it.
    """

    verdict: Verdict
    time: float
    term: str
    margin: float
    margin_time: float
    integration_error: float
    books_error: float
    ledger_residual: float
    unbooked: str
    every_step: bool
    remedy: str
    balances: tuple[Balance, ...] = field(repr=False)

    @property
    def overdraft(self) -> float:
        """Return the largest energy given beyond what was there [J], ≥ 0."""
        return max(0.0, -self.margin)


def audit(run: Signals) -> Audit:
    """Return the audit of a run.

    Raises
    ------
    ArgumentError
        If it is no run, as the path of one.
    """
    if not hasattr(run, "unbooked"):
        raise ArgumentError(run, "a run, as simulate returns", "Run.load for a file")
    balances: tuple[Balance, ...] = robot_balance(run), link_balance(run), claimed_balance(run)
    if any(e.outside for e in run.elements):
        balances = (*balances, environment_balance(run))
    found = extremes(run)
    verdict, time, term, remedy = _judged(run, found, readable=_readable(run, balances[1]))
    return Audit(
        verdict=verdict,
        time=time,
        term=run.unbooked if term == TERMS[-1] else term,
        margin=found.margin,
        margin_time=found.time,
        integration_error=found.integration_error,
        books_error=found.books_error,
        ledger_residual=max(balance.worst for balance in (balances[0], *balances[3:])),
        unbooked=run.unbooked,
        every_step=found.every_step,
        remedy=remedy,
        balances=balances,
    )


def _readable(run: Signals, links: Balance) -> bool:
    """Return whether all numbers that a verdict could be read from are finite."""
    parts = available_energy(run), motor_side_storage(run), links.residual
    return all(np.isfinite(part).all() for part in parts)


def _judged(run: Signals, found: Extremes, *, readable: bool) -> tuple[Verdict, float, str, str]:
    """Return the verdict, when it was decided, what had taken most by then, and the remedy."""
    least = found.time, found.term
    if found.possible < 0:
        return "violated", found.overdraft_time, found.overdraft_term, _remedy(run)
    if run.failure:
        return "inconclusive", *least, f"the run ended early: {run.failure}"
    if not found.sure >= 0:  # so that a NaN can never be passive
        why = "the margin is below the integration error: lower the tolerance"
        return "inconclusive", found.doubt_time, found.doubt_term, why
    if not readable:
        return "inconclusive", *least, "numbers that the books are read from are not finite"
    return "passive", *least, "none needed"


def _remedy(run: Signals) -> str:
    """Return what helps against an overdraft: of what there is to be changed."""
    if run.sampled and run.has_tank:
        return "see `passiflex limits` for the gains that hold at this rate"
    shapes = run.unbooked.startswith(SHAPED)
    ways = ["take a larger target_inertia"] if shapes else []
    ways += ["lower the gains"]
    ways += ["give the tank more to start with"] if run.has_tank else []
    ways += ["correct the law's model"] if "model error" in run.unbooked else []
    ways += ["take the impedance law"] if shapes else []
    return listed(ways, "or")


def audit_if_possible(run: Signals) -> Audit | None:
    """Return the audit of a run; None where signals that it needs are missing, or are not finite."""
    try:
        result = audit(run)
    except KeyError:  # how a run says that it has no signal of this name
        return None
    return result if np.isfinite([result.margin, *available_energy(run)]).all() else None
