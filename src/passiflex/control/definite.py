"""Whether a matrix is symmetric and positive definite: asked of every gain of a scenario, so without SciPy."""

from __future__ import annotations

import numpy as np
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
