"""The numbers of a law on a robot, from those of its problem."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.onboard.robot_law import RobotLaw
from passiflex.onboard.settings import ApproachSettings, WatchSettings
from passiflex.problems.problem import SampledProblem
from passiflex.sampled.sensors import UNFILTERED

Array = NDArray[np.float64]


def robot_numbers(
    law: RobotLaw,
    problem: SampledProblem,
    says: Mapping[str, float],
    watch: WatchSettings,
    approach: ApproachSettings,
    *,
    weight_in_readings: bool | None,
) -> Array:
    """Return the flat numbers of `RobotLaw.parameters`.

    The robot's own sensors have made of the truth what they make of it; the books still know how wrong they may be.
    The motors have limits whatever the scenario says.

    Parameters
    ----------
    says: What the robot says, by the names of `robot_layout`.
    weight_in_readings: None for: if the law does not know the weight.
    """
    robot = problem.law.robot
    values: dict[str, dict[str, Any]] = {
        part: dict(problem.parts.unpack(part, problem.numbers)) for part in law.period.parameters.layouts
    }
    pole = values["sensors"]["velocity_bandwidth"]
    ideal: dict[str, Any] = law.period.sensors.layout.zeros()
    values["sensors"] = ideal | {
        f.name: UNFILTERED for f in law.period.sensors.layout if f.name.endswith("_bandwidth")
    }
    limits = values["limits"]
    values["limits"] = limits | {"torque_limit": np.minimum(limits["torque_limit"], robot.torque_limit)}
    weighed = not problem.law.gravity.in_model if weight_in_readings is None else weight_in_readings
    weight = np.array(robot.arm.chain.gravity) if weighed else np.zeros(3)
    values["robot"] = {**says, "weight": weight, "velocity_pole": pole}
    values["watch"], values["approach"] = watch.numbers, approach.numbers
    return law.parameters.pack(values)
