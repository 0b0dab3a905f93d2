"""Cholesky solve of small symbolic matrices: a fixed sequence of operations, without pivoting."""

from __future__ import annotations

import casadi as cs


def solve_spd(A: cs.SX, b: cs.SX) -> cs.SX:
    """Return A⁻¹ b for a symmetric positive definite A."""
    upper = cs.chol(A)
    return cs.solve(upper, cs.solve(upper.T, b))
