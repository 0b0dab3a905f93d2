"""Gains that are designed for a posture: a damping with a ratio in every mode, an inertia that a damping fits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from passiflex.control.damping_design import ElasticArm, damping_of_elastic
from passiflex.control.inner_loop import shaped_damping
from passiflex.control.posture import Posture, held_jacobian
from passiflex.control.task import AbstractTask

Array = NDArray[np.float64]


def in_world(stiffness: Array, rotation: Array) -> Array:
    """Return K_x with its rotational block, which is in the axes of the reference, turned into world axes."""
    turn = np.eye(len(stiffness))
    if len(stiffness) == 6:
        turn[3:, 3:] = rotation
    return _symmetric(turn @ stiffness @ turn.T)


def target_inertia(stiffness: Array, damping: Array, ratio: float) -> Array:
    """Return M_x = D K⁻¹ D / (4 ζ²), for which D is the damping ratio ζ in every mode (theory note 2.8).

    For one axis it is m = (D / 2ζ)² / K.
    """
    return _symmetric(damping @ np.linalg.solve(stiffness, damping) / (4 * ratio**2))


def designed_damping(
    task: AbstractTask, gains: dict[str, Array], start: Posture, model: dict[str, Array], ratio: float
) -> Array:
    """Return the D_x (k, k) with which every mode of the directions that are held has a damping ratio.

    The inertia is that of all that moves, links and motors as the law shapes them: (J (M + B_e)⁻¹ Jᵀ + ε I)⁻¹.
    """
    J, M, stiffness, motors = (
        held_jacobian(task, start),
        start.mass_matrix,
        gains["stiffness"],
        gains["shaped_inertia"],
    )

    def felt(moving: Array) -> Array:
        mobility = J @ np.linalg.solve(moving, J.T) + gains["regularisation"] * np.eye(len(J))
        return _symmetric(np.linalg.inv(mobility).astype(np.float64))

    K, K_e = model["joint_stiffness"], gains["shaped_stiffness"]
    still = gains["null_space_damping"] * (M - J.T @ felt(M) @ J)
    arm = ElasticArm(M, still, motors, K_e, np.asarray(shaped_damping(K, model["joint_damping"], K_e)), J)
    axes = np.ix_(task.held, task.held)
    damping = np.zeros_like(stiffness)
    held = stiffness if task.turned else in_world(stiffness, start.pose.rotation)
    damping[axes] = damping_of_elastic(held[axes], felt(M + np.diag(motors)), ratio, arm)
    return damping


def _symmetric(matrix: Array) -> Array:
    return (matrix + matrix.T) / 2
