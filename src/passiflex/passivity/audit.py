"""The verdict on a run: did the robot ever give more energy than it had?"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from passiflex.passivity.ledger import (
    Balance,
    Signals,
    claimed_balance,
    initial_tank,
    link_balance,
    motor_side_storage,
    overclaimed,
    port_energy,
    robot_balance,
)

ROUND_OFF = 1e-13
"""An overdraft below this share of the energy at hand (or of 1 J) is round-off."""

Verdict = Literal["passive", "violated", "inconclusive"]


@dataclass(frozen=True, eq=False)
class Audit:
    """The energy audit of one run.

    The links are passive by physics. So the robot is passive at its end effector if law and motors never
    give more to the links, W̃(t), than they had at the start: S̃₀ + T₀, what they stored and what the tank
    was filled with. A law without a tank is also allowed what the moving reference gave it.

    Attributes
    ----------
    verdict: `passive`, `violated`, or `inconclusive` when the margin is below the integration error or
        the run ended early.
    time: When it was decided [s]: the first overdraft, or the least margin.
    term: What took most of the energy by then.
    margin: Least of S̃₀ + T₀ − W̃ over the run [J]; negative by the largest overdraft.
    integration_error: Largest residual of the links' balance, which holds whatever the law [J].
    books_error: How wrong the law's own books are [J]: the largest residual of (28)–(29), round-off if its
        model is right; of a sampled law, the most that its tank claims beyond what is there.
    ledger_residual: Largest residual of the real robot's balance (4) [J].
    remedy: What to do about it.
    """

    verdict: Verdict
    time: float
    term: str
    margin: float
    integration_error: float
    books_error: float
    ledger_residual: float
    remedy: str
    balances: tuple[Balance, ...]

    @property
    def overdraft(self) -> float:
        """Return the largest energy given beyond what was there [J], ≥ 0."""
        return max(0.0, -self.margin)


def audit(run: Signals) -> Audit:
    """Return the audit of a run."""
    robot, links, law = robot_balance(run), link_balance(run), claimed_balance(run)
    error = np.maximum.accumulate(np.abs(links.residual))
    round_off = ROUND_OFF * np.maximum(1.0, np.maximum.accumulate(np.abs(links.total)))
    margin = available_energy(run)
    verdict: Verdict
    if (margin < -error - round_off).any():
        verdict, decided = "violated", int(np.argmax(margin < -error - round_off))
        remedy = (
            "see `passiflex limits` for the gains that hold at this rate"
            if run.sampled
            else "lower the gains, give the tank more to start with, or correct the law's model"
        )
    elif run.failure:
        verdict, decided = "inconclusive", int(np.argmin(margin))
        remedy = f"the run ended early: {run.failure}"
    elif not (margin >= error - round_off).all():  # so that a NaN can never be passive
        verdict, decided = "inconclusive", int(np.argmin(margin >= error - round_off))
        remedy = "the margin is below the integration error: lower the tolerance"
    else:
        verdict, decided, remedy = "passive", int(np.argmin(margin)), "none needed"
    return Audit(
        verdict=verdict,
        time=float(run.time[decided]),
        term=_deciding_term(run, law, decided),
        margin=float(margin.min()),
        integration_error=links.worst,
        books_error=float(np.maximum(overclaimed(run), 0.0).max()) if run.sampled else law.worst,
        ledger_residual=robot.worst,
        remedy=remedy,
        balances=(robot, links, law),
    )


def audit_if_possible(run: Signals) -> Audit | None:
    """Return the audit of a run; None where signals that it needs are missing, or are not finite."""
    try:
        result = audit(run)
    except KeyError:  # how a run says that it has no signal of this name
        return None
    return result if math.isfinite(result.margin) else None


def available_energy(run: Signals) -> NDArray[np.float64]:
    """Return S̃₀ + T₀ − W̃(t) [J], what law and motors may still give to the links.

    A storage counts from its lowest value: where S̃ became negative (a gravity compensation that is not
    exact is off by the weight's deflection of the springs), from there.
    """
    storage = motor_side_storage(run)
    budget = initial_tank(run) + float(storage[0] - min(storage.min(), 0.0))
    lent = 0.0 if run.has_tank else run["reference_energy"]
    return budget + lent - port_energy(run)


def _deciding_term(run: Signals, law: Balance, index: int) -> str:
    draws = {
        "motion of the links": run["link_kinetic_energy"][index],
        "moving reference": run["reference_energy"][index],
        "work on the environment": -run["external_energy"][index],
        "model error and noise": law.residual[index],
    }
    return max(draws, key=lambda name: draws[name])
