"""The law of a scenario laid out for a robot: what of the scenario counts there, and whether it holds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from passiflex.errors import ValueRangeError
from passiflex.problems.problem import SampledProblem, require_sampled
from passiflex.problems.resolution import resolve
from passiflex.sampled.external import TrueTorque
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.sensor_settings import SensorSettings
from passiflex.stability.admissible import require_stable
from passiflex.stability.noise_credit import charged

Array = NDArray[np.float64]

SAME_PLACE = 1e-4
"""By how much a robot may start beside the posture of its scenario [rad, m]; elsewhere the law is laid out anew."""
_AROUND = ("environment", "forces", "reference", "gain_changes", "feedforward", "deviations")
"""What a scenario says of the world, or asks for over time: on a robot both come from outside."""


def alone(scenario: Scenario) -> Scenario:
    """Return what of a scenario is of the robot and its law."""
    return scenario.changed(dict.fromkeys(_AROUND))


def for_robot(scenario: Scenario, problem: SampledProblem, q: Array, says: Sequence[str]) -> Scenario:
    """Return the scenario for a robot that stands at q and says this of its joints; itself where it is the same."""
    changed: dict[str, object] = {}
    if np.abs(q - problem.q).max() > SAME_PLACE:
        changed["posture"] = q.tolist()
    if (scenario.sensors or SensorSettings()).says != tuple(says):
        changed["sensors.says"] = list(says)
    return scenario.changed(changed) if changed else scenario


def laid_out(scenario: Scenario) -> SampledProblem:
    """Return the problem of a scenario that may run on a robot.

    Raises
    ------
    UnstableLoopError
        If the loop is unstable at its rate and delay, and the scenario does not allow_unstable.
    ValueRangeError
        For a scenario in continuous time, or one whose law is told the true external torque.
    """
    problem = require_sampled(resolve(scenario))
    if isinstance(problem.controller.external, TrueTorque):
        raise ValueRangeError(
            "the law is told the true external torque, which nobody knows on a robot",
            got="control.external_torque: true",
            needs="measured, observer or none",
        )
    require_stable(problem)
    return charged(problem)
