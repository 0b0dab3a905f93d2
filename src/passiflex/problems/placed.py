"""A posture for a pose: inverse kinematics by damped least squares, from several seeds, within the joints' limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from passiflex.control.motion import Pose
from passiflex.control.posture import posture
from passiflex.errors import ValueRangeError
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.robots.once_over import bounded

Array = NDArray[np.float64]

SEEDS, STEPS = 24, 150
"""Postures from which it is begun, and steps from each at most."""
ENOUGH = 6
"""Postures that are found before the best of them is taken."""
REACHED = 1e-9
"""[m, rad] Off the pose by less, it is reached."""
LIGHT, HEAVY = 1e-12, 1e6
"""Between which the damping of a step is, m² or rad²."""


class _Found(NamedTuple):
    """How far off the pose a posture is, how far from singular, and the posture."""

    off: float
    regular: float
    q: Array


def posture_at(
    robot: FlexibleJointRobot,
    numbers: Mapping[str, Array],
    goal: Pose,
    *,
    turned: bool = True,
    near: Array | None = None,
) -> Array:
    """Return joint angles (n,) with the end effector at a pose: of those that are found the least singular one.

    Parameters
    ----------
    numbers: Of the robot, with its tool.
    turned: Whether the orientation counts.
    near: Where to begin; then the first posture that is found is taken.

    Raises
    ------
    ValueRangeError
        If none is found within the joints' limits; the message says how near the nearest one comes.
    """
    low, high = robot.position_limit.T
    begin = bounded(robot.position_limit)
    least, most = begin.T
    drawn = np.random.default_rng(0).uniform(least, most, (SEEDS, robot.n))
    seeds = [begin.mean(axis=1), *drawn] if near is None else [near, *drawn]
    found: list[_Found] = []
    for seed in seeds:
        found.append(_followed(robot, numbers, goal, np.clip(seed, low, high), turned=turned))
        reached = [f for f in found if f.off < REACHED]
        if len(reached) >= (ENOUGH if near is None else 1):
            break
    if not reached:
        nearest = min(found, key=lambda one: one.off)
        there = _error(robot, numbers, goal, nearest.q, turned=turned)
        off = f"{1e3 * np.linalg.norm(there[:3]):.3g} mm"
        off += f" and {np.degrees(np.linalg.norm(there[3:])):.3g} deg" if turned else ""
        raise ValueRangeError(
            f"no posture of {robot.name!r} has its end effector at this pose",
            got=f"the nearest of {len(found)} that were tried is {off} off",
            needs="a pose within reach, and within the joints' limits",
            try_="another pose, or `near: [...]`, angles to begin from",
        )
    return max(reached, key=lambda f: f.regular).q


def _error(
    robot: FlexibleJointRobot, numbers: Mapping[str, Array], goal: Pose, q: Array, *, turned: bool
) -> Array:
    """Return how far a posture is off the pose (6,) or (3,) [m, rad]."""
    pose = posture(robot, q, dict(numbers)).pose
    way = goal.position - pose.position
    if not turned:
        return np.asarray(way)
    return np.concatenate([way, Rotation.from_matrix(goal.rotation @ pose.rotation.T).as_rotvec()])


def _followed(
    robot: FlexibleJointRobot, numbers: Mapping[str, Array], goal: Pose, q: Array, *, turned: bool
) -> _Found:
    """Return where steps toward the pose lead: damped the more, the less they help."""
    low, high = robot.position_limit.T
    damping, error = 1e-3, _error(robot, numbers, goal, q, turned=turned)
    for _ in range(STEPS):
        off = float(np.abs(error).max())
        if off < REACHED or damping > HEAVY:
            break
        J = posture(robot, q, dict(numbers)).jacobian[: error.size]
        step = J.T @ np.linalg.solve(J @ J.T + damping * np.eye(error.size), error)
        there = np.clip(q + step, low, high)
        left = _error(robot, numbers, goal, there, turned=turned)
        if np.linalg.norm(left) < np.linalg.norm(error):
            q, error, damping = there, left, max(damping / 4, LIGHT)
        else:
            damping *= 8
    J = posture(robot, q, dict(numbers)).jacobian[: error.size]
    values = np.linalg.svd(J, compute_uv=False)
    return _Found(float(np.abs(error).max()), float(values[-1] / values[0]), q)
