"""Gains that are stated in the axes of a tool: the same matrices in world axes, for the orientation of the reference.

K_x has its translation in world axes and its rotation in those of the reference, D_x both in world axes (with a free
rotation, that of the reference). So W K Wᵀ has W = diag(R_d, I) for the one and diag(R_d, R_d) for the other. The
orientation is the reference's, not the hand's: a stiffness that turned with the hand would be no gradient of a
potential, while one that turns with the reference is told, and paid for, as any other change of it.
"""

from __future__ import annotations

import casadi as cs
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def stiffness_in_world(stiffness: Array, rotation: Array) -> Array:
    """Return K_x (k, k), stated in tool axes, for a reference of this orientation (3, 3)."""
    return _turned(stiffness, rotation, np.eye(3))


def damping_in_world(damping: Array, rotation: Array, *, turned: bool) -> Array:
    """Return D_x (k, k), stated in tool axes; `turned` as `AbstractTask.turned` says."""
    return _turned(damping, rotation, np.eye(3) if turned else rotation)


def _turned(matrix: Array, first: Array, second: Array) -> Array:
    W = np.zeros((6, 6))
    W[:3, :3], W[3:, 3:] = first, second
    k = len(matrix)
    return np.asarray(W[:k, :k] @ matrix @ W[:k, :k].T)


def in_world(matrix: cs.SX, rotation: cs.SX, in_tool: cs.SX, *, whole: bool) -> cs.SX:
    """Return a matrix (k, k) in world axes if `in_tool` is 1, as it is if 0; `whole`: with its rotational part."""
    W = rotation
    if matrix.size1() > rotation.size1():
        W = cs.diagcat(rotation, rotation if whole else cs.SX.eye(3))
    return cs.if_else(in_tool > 0, W @ matrix @ W.T, matrix)
