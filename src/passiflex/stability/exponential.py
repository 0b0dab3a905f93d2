"""The matrix exponential of a small plant: balanced, scaled and squared, on one core.

SciPy's own hands even these to as many threads as there are cores, which wait for one another: on a busy machine
that takes a hundred times as long.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgebal

Array = NDArray[np.float64]

PADE = (1.0, 1 / 2, 5 / 44, 1 / 66, 1 / 792, 1 / 15840, 1 / 665280)
"""Of the fraction of degree 6 in numerator and denominator."""
SMALL = 0.5
"""Norm below which that fraction is e^x to round-off: its error there is 2e-17."""


def exponential(matrix: Array) -> Array:
    """Return e to a square matrix."""
    balanced, _, _, scale, _ = dgebal(matrix, scale=1, permute=0)
    norm = float(np.abs(balanced).sum(axis=0).max())
    squarings = max(0, math.ceil(math.log2(norm / SMALL))) if norm > 0 else 0
    x = balanced / 2**squarings
    x2 = x @ x
    x4 = x2 @ x2
    eye = np.eye(len(matrix))
    even = PADE[0] * eye + PADE[2] * x2 + PADE[4] * x4 + PADE[6] * (x2 @ x4)
    odd = x @ (PADE[1] * eye + PADE[3] * x2 + PADE[5] * x4)
    out = np.linalg.solve(even - odd, even + odd)
    for _ in range(squarings):
        out = out @ out
    return np.asarray(scale[:, None] * out / scale)
