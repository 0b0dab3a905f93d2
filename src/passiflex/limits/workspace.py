"""Postures that stand for the workspace of a robot: spread evenly over its joints' ranges, away from singularities."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from passiflex.control.posture import held_jacobian, posture
from passiflex.control.task import AbstractTask
from passiflex.errors import ValueRangeError
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.robots.once_over import bounded

Array = NDArray[np.float64]

COUNT = 6
USED = 0.6
"""Share of a joint's range that the postures use, around its middle."""
REGULAR = 0.05
"""Least ratio of the singular values of the task's Jacobian, its lengths in units of the arm's reach."""
TRIED = 512


def workspace_postures(robot: FlexibleJointRobot, task: AbstractTask, count: int = COUNT) -> Array:
    """Return regular postures (count, n) for the directions that a task holds: always the same ones for a robot.

    They are the first of a Halton sequence over the joints' ranges that are regular.

    Raises
    ------
    ValueRangeError
        If the robot has too few of them.
    """
    from scipy.stats import qmc  # takes a second

    numbers = robot.nominal()
    limits = bounded(robot.position_limit)
    middle, half = limits.mean(axis=1), USED * np.diff(limits, axis=1)[:, 0] / 2
    sequence = qmc.Halton(robot.n, scramble=False).fast_forward(1).random(TRIED)  # the first is a corner
    points = middle + half * (2 * sequence - 1)
    places = [posture(robot, q, numbers) for q in points]
    reach = max(float(np.linalg.norm(at.jacobian[:3], axis=0).max()) for at in places)
    units = np.array([1 / reach if axis < 3 else 1.0 for axis in task.held])[:, None]
    regular = [
        q for q, at in zip(points, places, strict=True) if _ratio(units * held_jacobian(task, at)) >= REGULAR
    ]
    if len(regular) < count:
        raise ValueRangeError(
            f"robot {robot.name!r} has too few regular postures",
            got=f"{len(regular)} of {TRIED} that were tried",
            needs=f"{count} from which the end effector can move in all directions of the task",
            try_="postures of your own",
        )
    return np.array(regular[:count])


def _ratio(jacobian: Array) -> float:
    values = np.linalg.svd(jacobian, compute_uv=False)
    return float(values[-1] / values[0])
