"""Gains with a margin for the law of a scenario: its robot, task, K_x, D_x, sensors, jitter and missed periods."""

from __future__ import annotations

import numpy as np

from passiflex.errors import ValueRangeError
from passiflex.limits.recommend import Report, recommend_gains
from passiflex.limits.recommendation import Recommendation
from passiflex.limits.subject import Subject, sampled_problem
from passiflex.limits.workspace import workspace_postures
from passiflex.problems.altered import rewritten

TORQUE_NOISE = 0.2
"""Variance [(N m)²] where the scenario has no noise: that of the paper's Fig. 3."""


def recommend_for(
    subject: Subject,
    margin: float = 0.2,
    rate: float | str | None = None,
    delay: float | str | None = None,
    *,
    task: str | None = None,
    inner_loop: str | None = None,
    report: Report = lambda text: None,
) -> Recommendation:
    """Return `recommend` for a scenario, its file or a problem, its start among the postures.

    What it returns is a piece of that scenario: pasted into it, `simulate` and `limits` accept it.

    Parameters
    ----------
    margin: 0 to below 1, as 0.2 for 20 %.
    rate, delay, task: Its own unless given.
    inner_loop: plain or matched; the better of the two if left out.

    Raises
    ------
    ValueRangeError
        For the rigid law, which shapes nothing; and as `recommend`.
    """
    problem = sampled_problem(subject, rate, delay, task=task)
    law = problem.law
    if not law.shapes:
        raise ValueRangeError(
            "the rigid law has no K_e and B_e to recommend", got=problem.name, needs="law type: impedance"
        )
    gains = law.layout.unpack(problem.gains)
    written = {name: {"matrix": gains[name].tolist()} for name in ("stiffness", "damping")}
    text = rewritten(problem.text, {"law": written})
    return recommend_gains(
        text,
        law.robot,
        np.vstack([problem.q, workspace_postures(law.robot, law.task)]),
        margin,
        problem.noise.variance if problem.noise else TORQUE_NOISE,
        inner_loop=inner_loop,
        report=report,
    )
