"""The matrix exponential against SciPy's, on plants whose velocities are a thousand times their angles."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from passiflex.stability.exponential import exponential


@pytest.mark.parametrize("time", [0.0, 1e-6, 1e-3, 0.05])
def test_it_is_scipys(time: float) -> None:
    """Entry by entry, to round-off of the largest in its row and column."""
    rng = np.random.default_rng(0)
    for n in (1, 4):
        K, M, D = rng.uniform(1e3, 1e4, n), rng.uniform(1e-3, 1, n), rng.uniform(0, 5, n)
        A = np.zeros((3 * n, 3 * n))
        A[:n, n : 2 * n] = np.eye(n)
        A[n : 2 * n, :n], A[n : 2 * n, n : 2 * n] = -np.diag(K / M), -np.diag(D / M)
        A[n : 2 * n, 2 * n :] = np.diag(1 / M)
        expected, found = scipy.linalg.expm(A * time), exponential(A * time)
        size = np.sqrt(np.abs(expected).max(axis=1)[:, None] * np.abs(expected).max(axis=0)[None])
        assert (np.abs(found - expected) <= 1e-9 * size).all()


def test_a_nilpotent_matrix_has_a_closed_form() -> None:
    np.testing.assert_array_equal(exponential(np.array([[0.0, 3.0], [0.0, 0.0]])), [[1.0, 3.0], [0.0, 1.0]])
