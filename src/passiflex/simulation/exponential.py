"""The matrix exponential of a small plant: balanced, scaled and squared, on one core.

SciPy's own hands even these to as many threads as there are cores, which wait for one another: on a busy machine
that takes a hundred times as long.
"""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

Array = NDArray[np.float64]

TERMS, SMALL = 18, 0.5
"""Terms of the series, and the norm below which they reach round-off: 0.5¹⁹/19! is below 1e-22."""


def exponential(matrix: Array) -> Array:
    """Return e to a square matrix."""
    balanced, (scale, _) = scipy.linalg.matrix_balance(matrix, permute=False, separate=True)
    norm = float(np.abs(balanced).sum(axis=0).max())
    squarings = max(0, math.ceil(math.log2(norm / SMALL))) if norm > 0 else 0
    small = balanced / 2**squarings
    out = term = np.eye(len(matrix))
    for k in range(1, TERMS + 1):
        term = term @ small / k
        out = out + term
    for _ in range(squarings):
        out = out @ out
    return np.asarray(scale[:, None] * out / scale)
