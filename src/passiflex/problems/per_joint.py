"""Numbers of a scenario that are one for all joints, or one each."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.errors import SizeError
from passiflex.robots.flexible import FlexibleJointRobot

Array = NDArray[np.float64]


def per_joint(robot: FlexibleJointRobot, name: str, value: ArrayLike) -> Array:
    """Return a number for each joint.

    Raises
    ------
    SizeError
        For a list of another length.
    """
    if np.size(value) not in (1, robot.n):
        raise SizeError(
            f"{name} does not fit robot {robot.name!r}",
            got=f"{np.size(value)} numbers",
            needs=f"one number or {robot.n}",
        )
    return np.broadcast_to(np.asarray(value, dtype=float), robot.n).copy()
