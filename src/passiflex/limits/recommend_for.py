"""Gains with a margin for the law of a scenario: its robot, task, K_x, D_x, sensors and inner loop."""

from __future__ import annotations

import numpy as np
import yaml

from passiflex.control.law import ImpedanceLaw
from passiflex.errors import ValueRangeError
from passiflex.limits.recommend import Report, recommend
from passiflex.limits.recommendation import Recommendation
from passiflex.limits.subject import Subject, sampled_problem
from passiflex.limits.workspace import workspace_postures
from passiflex.sampled.matched_loop import MatchedInnerLoop

TORQUE_NOISE = 0.2
"""Variance [(N m)²] where the scenario has no noise: that of the paper's Fig. 3."""


def recommend_for(
    subject: Subject,
    margin: float = 0.2,
    rate: float | str | None = None,
    delay: float | str | None = None,
    *,
    report: Report = lambda text: None,
) -> Recommendation:
    """Return `recommend` for a scenario, its file or a problem, its start among the postures.

    Raises
    ------
    ValueRangeError
        For the rigid law, which shapes nothing; and as `recommend`.
    """
    problem = sampled_problem(subject, rate, delay)
    s, law = problem.sampling, problem.law
    assert s is not None
    if not isinstance(law, ImpedanceLaw):
        raise ValueRangeError(
            "the rigid law has no K_e and B_e to recommend", got=problem.name, needs="law type: impedance"
        )
    gains = law.layout.unpack(problem.gains)
    size = law.task.size
    return recommend(
        law.robot,
        1 / s.period,
        s.delay,
        margin,
        task="pose" if size == 6 else "position",
        inner_loop="matched" if isinstance(s.controller.inner, MatchedInnerLoop) else "plain",
        stiffness=gains["stiffness"],
        damping=gains["damping"],
        null_space_damping=float(gains["null_space_damping"]),
        torque_noise=problem.noise.variance if problem.noise else TORQUE_NOISE,
        sensors=yaml.safe_load(problem.configuration).get("sensors"),
        postures=np.vstack([problem.q, workspace_postures(law.robot, size)]),
        report=report,
    )
