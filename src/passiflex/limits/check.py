"""Whether gains hold at a rate and a delay, and which would."""

from __future__ import annotations

from passiflex.limits.subject import Subject, sampled_problem
from passiflex.stability.admissible import Admissible
from passiflex.stability.admissible import check as check_problem


def check(
    subject: Subject,
    rate: float | str | None = None,
    delay: float | str | None = None,
    *,
    task: str | None = None,
    inner_loop: str | None = None,
) -> Admissible:
    """Return whether the gains of a scenario, its file or a problem are stable, and the nearest that are.

    Parameters
    ----------
    rate, delay: [Hz], [s], its own unless given; text may name a unit, as "1 kHz". A scenario in continuous
        time needs a rate.
    task, inner_loop: pose or position, plain or matched; its own unless given.

    Raises
    ------
    PassiflexError
        If there is no rate, rate or delay make no sense, or the scenario does not fit its robot.
    """
    return check_problem(sampled_problem(subject, rate, delay, task=task, inner_loop=inner_loop))
