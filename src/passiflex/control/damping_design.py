"""Damping from a ratio, by double diagonalisation of stiffness and inertia, and then with the joints' elasticity."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from passiflex.control.definite import require_positive_definite
from passiflex.errors import ValueRangeError

NEAR, ROUNDS = 0.01, 20
"""How near to the wanted ratio every mode is brought, and the corrections at most."""
UNSEEN = 1e-3
"""Share of the largest motion of the task below which a mode is a self-motion."""
BOLD = 0.8
"""Share of a correction that is made at once, in the logarithm."""


class ElasticArm(NamedTuple):
    """Links and shaped motors about a posture: M q̈ = −τ, B_e φ̈ = τ − Jᵀ(K_x J φ + D_x J φ̇) − D_ns φ̇.

    τ = K_e (q − φ) + D_e (q̇ − φ̇).

    Attributes
    ----------
    mass_matrix, null_damping: M and D_ns (n, n).
    motor_inertia, joint_stiffness, joint_damping: B_e, K_e and D_e (n,).
    jacobian: J of the directions that are held (k, n).
    """

    mass_matrix: NDArray[np.float64]
    null_damping: NDArray[np.float64]
    motor_inertia: NDArray[np.float64]
    joint_stiffness: NDArray[np.float64]
    joint_damping: NDArray[np.float64]
    jacobian: NDArray[np.float64]


def damping_from_ratio(
    stiffness: NDArray[np.float64], inertia: NDArray[np.float64], ratio: float | NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return D_x = 2 Q ζ √K₀ Qᵀ, where inertia = Q Qᵀ and stiffness = Q K₀ Qᵀ with K₀ diagonal.

    Every mode of  inertia ẍ + D_x ẋ + stiffness x = 0  then has the damping ratio ζ. (2√K, whatever the
    inertia, has not.)

    Parameters
    ----------
    stiffness: K_x, symmetric positive definite.
    inertia: Λ at the posture of the design, symmetric positive definite.
    ratio: ζ ≥ 0, one number or one for each mode.
    """
    if np.any(np.asarray(ratio) < 0):
        raise ValueRangeError("damping ratio is negative", got=ratio, needs="ζ ≥ 0")
    k, Q = _diagonal(stiffness, inertia)
    return _damping(Q, 2 * np.asarray(ratio) * np.sqrt(k))


def damping_of_elastic(
    stiffness: NDArray[np.float64], inertia: NDArray[np.float64], ratio: float, arm: ElasticArm
) -> NDArray[np.float64]:
    """Return D_x (k, k) that gives the task's modes of an arm with elastic joints the damping ratio.

    As `damping_from_ratio`, for which joints are rigid; then the damping of each of its modes is corrected until the
    mode of the elastic arm that moves like it has the ratio. Where that does not come to an end, the best is returned.
    A ratio of 1 or more has no such modes, and stays with the rigid design.

    Parameters
    ----------
    stiffness: K_x of the directions that are held.
    inertia: Of all that moves with them, links and motors.
    """
    k, Q = _diagonal(stiffness, inertia)
    own = 2 * ratio * np.sqrt(k)
    best, least = own, np.inf
    for _ in range(ROUNDS if 0 < ratio < 1 else 0):
        found = _ratios(stiffness, _damping(Q, own), Q, arm)
        off = float(np.abs(found - ratio).max())
        if off < least:
            best, least = own, off
        if not off > NEAR or np.isnan(found).any():
            break
        own = own * np.clip(ratio / found, 0.5, 2) ** BOLD
    return _damping(Q, best)


def _ratios(
    stiffness: NDArray[np.float64], damping: NDArray[np.float64], Q: NDArray[np.float64], arm: ElasticArm
) -> NDArray[np.float64]:
    """Return the damping ratio of the elastic arm's mode that moves like each column of Q⁻ᵀ; nan if none is left."""
    J, n = arm.jacobian, len(arm.motor_inertia)
    K, D = np.diag(arm.joint_stiffness), np.diag(arm.joint_damping)
    springs = np.block([[K, -K], [-K, K + J.T @ stiffness @ J]])
    dampers = np.block([[D, -D], [-D, D + J.T @ damping @ J + arm.null_damping]])
    masses = scipy.linalg.block_diag(arm.mass_matrix, np.diag(arm.motor_inertia))
    lower = -np.linalg.solve(masses, np.hstack([springs, dampers]))
    poles, vectors = np.linalg.eig(np.vstack([np.hstack([np.zeros((2 * n, 2 * n)), np.eye(2 * n)]), lower]))
    turned, reach = vectors[n : 2 * n], np.linalg.norm(J, 2)
    seen = np.linalg.norm(J @ turned, axis=0) > UNSEEN * reach * np.linalg.norm(turned, axis=0)
    swinging = np.flatnonzero((poles.imag > 0) & seen)  # an undamped self-motion is near 0, with any sign
    slowest = swinging[np.argsort(np.abs(poles[swinging]))][: len(Q)]
    moved: NDArray[Any] = np.abs(Q.T @ J @ turned[:, slowest])
    alike = moved / np.maximum(np.linalg.norm(moved, axis=0), 1e-300)
    out = np.full(len(Q), np.nan)
    for _ in slowest:
        mode, pole = np.unravel_index(np.argmax(alike), alike.shape)
        out[mode] = -poles[slowest[pole]].real / np.abs(poles[slowest[pole]])
        alike[mode], alike[:, pole] = -1, -1
    return out


def _diagonal(
    stiffness: NDArray[np.float64], inertia: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return K₀ (k,) and Q with inertia = Q Qᵀ and stiffness = Q K₀ Qᵀ."""
    require_positive_definite("stiffness", stiffness)
    require_positive_definite("inertia", inertia)
    k, modes = scipy.linalg.eigh(stiffness, inertia)  # modesᵀ inertia modes = I
    return k, inertia @ modes  # = modes⁻ᵀ


def _damping(Q: NDArray[np.float64], own: NDArray[np.float64]) -> NDArray[np.float64]:
    damping = Q @ np.diag(own) @ Q.T
    return (damping + damping.T) / 2
