"""The inertia that an end effector has by itself, at the start of a problem."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from passiflex.control.posture import SINGULAR, held_jacobian, posture
from passiflex.errors import ValueRangeError
from passiflex.problems.problem import Problem

Array = NDArray[np.float64]


def natural_inertia(problem: Problem) -> Array:
    """Return Λ of (31) at the start, with the numbers of the plant, in the directions that the task holds.

    Raises
    ------
    ValueRangeError
        If the posture is singular, where Λ is infinite.
    """
    robot = problem.law.robot
    start = posture(robot, problem.q, robot.layout.unpack(problem.plant))
    J = held_jacobian(problem.law.task, start)
    mobility = J @ np.linalg.solve(start.mass_matrix, J.T)
    if not np.linalg.cond(mobility) < 1 / SINGULAR**2:
        raise ValueRangeError(
            "posture is singular, where Λ is infinite", got=problem.q, try_="another posture"
        )
    inertia = np.linalg.inv(mobility)
    return (inertia + inertia.T) / 2
