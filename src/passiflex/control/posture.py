"""The arm at one posture, in numbers."""

from __future__ import annotations

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


def held_jacobian(task: AbstractTask, at: Posture) -> Array:
    """Return the rows of J for the directions that a task holds, with its reference at that pose."""
    pose = EndEffectorPose(cs.SX(at.pose.position), cs.SX(at.pose.rotation))
    basis = np.array(cs.evalf(cs.densify(task.basis(pose))))
    return np.asarray(basis.T @ at.jacobian[: task.size])


@lru_cache(maxsize=16)
def _posture_function(arm: SerialArm) -> cs.Function:
    q = cs.SX.sym("q", arm.n)
    vector, m = arm.layout.symbols("m")
    outputs = [*arm.pose(q, m), arm.jacobian(q, m), arm.mass_matrix(q, m), arm.gravity_torque(q, m)]
    flat = cs.vertcat(
        *(cs.vec(cs.densify(value).T) for value in outputs)
    )  # one array is sooner read than five
    return cs.Function("posture", [q, vector], [flat], {"cse": True})
