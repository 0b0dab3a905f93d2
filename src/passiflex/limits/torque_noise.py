"""How much motor torque the noise of the joint torque sensors makes, by the covariance of the linear loop."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from passiflex.simulation.linear_loop import DRIFT, DrivenLoop

Array = NDArray[np.float64]


def torque_by_noise(loop: DrivenLoop, variance: float) -> Array:
    """Return the rms motor torque (n,) [N m] by white noise of this variance [(N m)²] on each sensor.

    z⁺ = A z + G w with τ = C z + D w has the covariance P = A P Aᵀ + σ² G Gᵀ, and τ the variances
    diag(C P Cᵀ + σ² D Dᵀ). Eigenvalues at 1 belong to a self-motion that drifts and calls for no torque: that
    part is taken out first. inf if the rest is not stable.
    """
    A, G, C = _without_drift(loop)
    if A.size and np.abs(np.linalg.eigvals(A)).max() >= 1:
        return np.full(len(C), np.inf)
    P = scipy.linalg.solve_discrete_lyapunov(A, G @ G.T)
    return np.sqrt(variance * np.diag(C @ P @ C.T + loop.D @ loop.D.T))


def _without_drift(loop: DrivenLoop) -> tuple[Array, Array, Array]:
    """Return A, G, C of the part that does not drift: an ordered Schur form, its two blocks decoupled."""
    T, Z, size = scipy.linalg.schur(
        loop.A, output="real", sort=lambda re, im: float(np.hypot(re - 1, im)) >= DRIFT
    )
    first, rest = slice(0, size), slice(size, None)
    # s = z₁ + X z₂ evolves by itself if T₁₁ X − X T₂₂ = T₁₂.
    X = (
        scipy.linalg.solve_sylvester(T[first, first], -T[rest, rest], T[first, rest])
        if size < len(T)
        else np.zeros((size, 0))
    )
    G = Z.T @ loop.G
    return T[first, first], G[first] + X @ G[rest], loop.C @ Z[:, first]
