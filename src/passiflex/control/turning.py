"""What the rotational spring of a pose task gives at an angle, and the largest moment that it can hold."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

FINEST = 1e-5
"""Steps of the load, as a share of the largest stiffness, in which the end of what can be held is found."""
CONVERGED = 1e-10
MOST_CORRECTIONS = 30


def turning_moment(stiffness: Array, turn: Array) -> Array:
    """Return the moment (3,) N m that holds the hand at a turn R_dᵀ R (3, 3), in the axes of the reference.

    For the potential tr(G (I − R)) with G = ½ tr(K_o) I − K_o it is vee(A − Aᵀ) with A = R G: about a principal axis
    k sin(angle), in general 2 √(|K_o v|² − (vᵀ K_o v)²) with v the vector part of the turn's quaternion. It is never
    more than the largest eigenvalue of K_o, and zero at half a turn about a principal axis.
    """
    A = turn @ _shape(stiffness)
    slope = A - A.T
    return np.array([slope[2, 1], slope[0, 2], slope[1, 0]])


def held_angle(stiffness: Array, turn: Array) -> float:
    """Return the angle [rad] of a turn R_dᵀ R, without what it has about free axes, for which K_o (3, 3) is zero.

    With v the vector part of the turn's quaternion it is 2 asin |v|, the free ones left out of v.
    """
    held = np.any(stiffness != 0, axis=1)
    v = Rotation.from_matrix(turn).as_quat()[:3][held]
    return 2 * math.asin(min(float(np.linalg.norm(v)), 1.0))


def largest_moment(stiffness: Array, direction: Array) -> float:
    """Return the largest moment [N m] that K_o (3, 3) holds as it grows in a fixed direction (3,) of the reference.

    It is K for an isotropic spring. About a principal axis it is k, unless k is more than both others together:
    then the hand gives way sideways at the angle with cos = (k − k₁ − k₂)/k. In other directions it is found by
    following the equilibrium from zero load to the last that is stable, to 1e-4 of the largest stiffness; nothing
    is held about a free axis.
    """
    towards = direction / np.linalg.norm(direction)
    free = ~np.any(stiffness != 0, axis=1)
    if np.any(np.abs(towards[free]) > CONVERGED):
        return 0.0
    most = float(np.linalg.eigvalsh(stiffness).max())
    load, step, turn = 0.0, most / 50, np.eye(3)
    while step > FINEST * most:
        found = _equilibrium(stiffness, (load + step) * towards, turn)
        if found is None:
            step /= 2
        else:
            load, turn = load + step, found
    return load


def _shape(stiffness: Array) -> Array:
    """Return G."""
    return np.asarray(np.trace(stiffness) / 2 * np.eye(3) - stiffness)


def _equilibrium(stiffness: Array, moment: Array, turn: Array) -> Array | None:
    """Return the stable turn near `turn` at which the spring holds a moment; None if there is none."""
    G, scale = _shape(stiffness), np.abs(stiffness).max()
    for _ in range(MOST_CORRECTIONS):
        A = turn @ G
        slope = np.trace(A) * np.eye(3) - A  # ∂ moment / ∂ (small turn in the axes of the reference)
        missing = moment - turning_moment(stiffness, turn)
        if np.abs(missing).max() <= CONVERGED * scale:
            stable = np.linalg.eigvals(slope).real.min() >= -CONVERGED * scale
            return turn if stable else None
        move = np.linalg.lstsq(slope, missing, rcond=CONVERGED)[0]
        if np.linalg.norm(move) > 0.5:  # no longer near
            return None
        turn = Rotation.from_rotvec(move).as_matrix() @ turn
    return None
