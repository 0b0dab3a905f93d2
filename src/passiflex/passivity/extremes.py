"""The extremes of a run that decide its verdict: noted at every step in the loop, or else read from the rows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.loops.witness import ROUND_OFF, TERMS
from passiflex.passivity.ledger import (
    Signals,
    claimed_balance,
    initial_tank,
    lent,
    link_balance,
    motor_side_storage,
    overclaimed,
    port_energy,
)

ROUNDING = 1e-9
"""Share of a margin (or of 1 J) by which rows and steps may differ: both are sums of the same numbers."""


class Extremes(NamedTuple):
    """What a verdict rests on; times in s, energies in J.

    Attributes
    ----------
    margin, time, term: Least of S̃₀ + T₀ − W̃, when it was, and what had taken most by then, one of `TERMS`.
    sure, possible: The least of the margin less and plus the integration error and round-off.
    overdraft_time, overdraft_term: When more was given than was there for the first time (∞: never), and what
        had taken most by then.
    doubt_time, doubt_term: When the margin was within the error for the first time, as far as it is known.
    integration_error: Largest residual of the links' balance.
    books_error: By how much the law's own books were wrong at most.
    every_step: Whether it was noted at every step of the plant, and not read from the rows.
    """

    margin: float
    time: float
    term: str
    sure: float
    possible: float
    overdraft_time: float
    overdraft_term: str
    doubt_time: float
    doubt_term: str
    integration_error: float
    books_error: float
    every_step: bool


def extremes(run: Signals) -> Extremes:
    """Return the extremes of a run: what its loop noted, or those of its rows if it is older than that.

    The rows are among the steps. Where they tell of less than was noted, something is wrong with the file, and
    the worse of the two counts.
    """
    rows = extremes_of_rows(run)
    try:
        noted = _noted(run)
    except KeyError:  # how a run says that it has no signal of this name
        return rows
    rounding = noted.integration_error + ROUNDING * max(1.0, abs(noted.margin))
    return rows if rows.margin < noted.margin - rounding else noted


def _noted(run: Signals) -> Extremes:
    def number(name: str) -> float:
        return float(run[name])

    def term(name: str) -> str:
        which = number(name)
        return TERMS[int(which)] if 0 <= which < len(TERMS) else TERMS[0]

    least = number("least_margin"), number("least_margin_time"), term("least_margin_term")
    return Extremes(
        *least,
        number("least_margin_sure"),
        number("least_margin_possible"),
        number("overdraft_time"),
        term("overdraft_term"),
        *least[1:],
        number("largest_integration_error"),
        number("largest_books_error"),
        every_step=True,
    )


def extremes_of_rows(run: Signals) -> Extremes:
    """Return the extremes of the rows of a run: what happened between them is not seen."""
    links, law, margin = link_balance(run), claimed_balance(run), available_energy(run)
    error = np.maximum.accumulate(np.abs(links.residual))
    round_off = ROUND_OFF * np.maximum(1.0, np.maximum.accumulate(np.abs(links.total)))
    over, doubt = margin + error + round_off < 0, ~(margin - error + round_off >= 0)
    least, first, unsure = int(np.argmin(margin)), int(np.argmax(over)), int(np.argmax(doubt))

    def term(row: int) -> str:
        draws = {
            TERMS[1]: run["link_kinetic_energy"][row],
            TERMS[2]: run["reference_energy"][row] * run.has_tank,
            TERMS[3]: -run["external_energy"][row],
            TERMS[4]: law.residual[row],
        }
        most = max(draws, key=lambda name: draws[name])
        return most if draws[most] > ROUND_OFF else TERMS[0]

    return Extremes(
        margin=float(margin[least]),
        time=float(run.time[least]),
        term=term(least),
        sure=float((margin - error + round_off).min()),
        possible=float((margin + error + round_off).min()),
        overdraft_time=float(run.time[first]) if over.any() else np.inf,
        overdraft_term=term(first),
        doubt_time=float(run.time[unsure]),
        doubt_term=term(unsure),
        integration_error=links.worst,
        books_error=float(np.maximum(overclaimed(run), 0.0).max()) if run.sampled else law.worst,
        every_step=False,
    )


def available_energy(run: Signals) -> NDArray[np.float64]:
    """Return S̃₀ + T₀ − W̃(t) at the rows [J], what law and motors may still give to the links.

    A storage counts from its lowest value: where S̃ became negative (a gravity compensation that is not
    exact is off by the weight's deflection of the springs), from there.
    """
    storage = motor_side_storage(run)
    try:
        lowest = float(run["lowest_storage"])
    except KeyError:
        lowest = float(storage.min())
    budget = initial_tank(run) + float(storage[0]) - min(lowest, 0.0)
    return budget + lent(run) - port_energy(run)
