"""Damping from a ratio, by double diagonalisation of stiffness and inertia."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from passiflex.errors import ValueRangeError


def require_positive_definite(name: str, matrix: NDArray[np.float64]) -> None:
    """Raise ValueRangeError unless `matrix` is symmetric and positive definite."""
    if not np.allclose(matrix, matrix.T, rtol=1e-12, atol=0):
        worst = np.abs(matrix - matrix.T).max()
        raise ValueRangeError(
            f"{name} is not symmetric", got=f"difference {worst:.3g}", needs="a symmetric matrix"
        )
    least = float(np.linalg.eigvalsh(matrix).min())
    if not least > 0:
        raise ValueRangeError(
            f"{name} is not positive definite",
            got=f"smallest eigenvalue {least:.6g}",
            needs="> 0 in every direction",
        )


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
    require_positive_definite("stiffness", stiffness)
    require_positive_definite("inertia", inertia)
    if np.any(np.asarray(ratio) < 0):
        raise ValueRangeError("damping ratio is negative", got=ratio, needs="ζ ≥ 0")
    k, modes = scipy.linalg.eigh(stiffness, inertia)  # modesᵀ inertia modes = I
    Q = inertia @ modes  # = modes⁻ᵀ
    damping = Q @ np.diag(2 * np.asarray(ratio) * np.sqrt(k)) @ Q.T
    return (damping + damping.T) / 2
