"""The arm at one posture, in numbers."""

from __future__ import annotations

import itertools
from functools import lru_cache
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.control.motion import Pose
from passiflex.control.task import AbstractTask
from passiflex.robots.arm import EndEffectorPose, SerialArm
from passiflex.robots.flexible import FlexibleJointRobot

Array = NDArray[np.float64]

SINGULAR = 1e-6
"""A posture is singular if the smallest singular value of the task's Jacobian is below this share of the largest."""


class Posture(NamedTuple):
    """The arm at one posture, in numbers."""

    pose: Pose
    jacobian: Array
    mass_matrix: Array
    gravity_torque: Array


def posture(robot: FlexibleJointRobot, q: Array, parameters: dict[str, Array]) -> Posture:
    """Return pose, Jacobian, M and ∇V at q (n,) for the numbers of `robot.layout`."""
    numbers = robot.arm.layout.pack({f.name: parameters[f.name] for f in robot.arm.layout})
    flat = np.array(_posture_function(robot.arm)(q, numbers)).ravel()
    n = robot.n
    p, R, J, M, gravity = np.split(flat, np.cumsum([3, 9, 6 * n, n * n]))
    return Posture(Pose(p, R.reshape(3, 3)), J.reshape(6, n), M.reshape(n, n), gravity)


def held_basis(task: AbstractTask, at: Posture) -> Array:
    """Return the directions that a task holds, with its reference at that pose, as columns in world axes."""
    pose = EndEffectorPose(cs.SX(at.pose.position), cs.SX(at.pose.rotation))
    return np.array(cs.evalf(cs.densify(task.basis(pose))))


def held_jacobian(task: AbstractTask, at: Posture) -> Array:
    """Return the rows of J for the directions that a task holds, with its reference at that pose."""
    return np.asarray(held_basis(task, at).T @ at.jacobian[: task.size])


def lost_directions(task: AbstractTask, at: Posture) -> Array:
    """Return the directions that a task holds and a singular posture cannot move in (size, lost), in world axes.

    Those that an arm of fewer joints can move in nowhere are not among them.
    """
    directions, sizes, _ = np.linalg.svd(held_jacobian(task, at))
    enough = len(sizes) == len(directions)
    lost = np.flatnonzero(sizes < SINGULAR * sizes[0]) if enough else np.arange(0)
    return np.asarray(held_basis(task, at) @ directions[:, lost])


def freest_turns(at: Posture, count: int) -> tuple[int, ...]:
    """Return the `count` axes of the end effector (0 to 2) about which a free turn leaves the best-conditioned J."""

    def worst(free: tuple[int, ...]) -> float:
        held = [3 + i for i in range(3) if i not in free]
        local = np.vstack([at.jacobian[:3], at.pose.rotation.T @ at.jacobian[3:]])
        values = np.linalg.svd(local[[0, 1, 2, *held]], compute_uv=False)
        return float(values[-1] / values[0])

    return max(itertools.combinations(range(3), count), key=worst)


@lru_cache(maxsize=16)
def _posture_function(arm: SerialArm) -> cs.Function:
    q = cs.SX.sym("q", arm.n)
    vector, m = arm.layout.symbols("m")
    outputs = [*arm.pose(q, m), arm.jacobian(q, m), arm.mass_matrix(q, m), arm.gravity_torque(q, m)]
    flat = cs.vertcat(
        *(cs.vec(cs.densify(value).T) for value in outputs)
    )  # one array is sooner read than five
    return cs.Function("posture", [q, vector], [flat], {"cse": True})
