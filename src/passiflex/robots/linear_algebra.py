"""Solves with small symbolic matrices that are symmetric and positive definite: fixed operations, no pivoting.

A = L D Lᵀ with unit lower L needs no roots and one divisor for each row, which `native.lane_source` divides
by once: in wide registers a root or a division takes as long as thirty products.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as cs


def gram(columns: cs.SX, weights: cs.SX | None = None) -> cs.SX:
    """Return Hᵀ W H with a symmetric W, or the unit matrix: each entry and its mirror image once, the same."""
    weighted = columns if weights is None else weights @ columns
    n = columns.shape[1]
    out = cs.SX(n, n)
    for i in range(n):
        for j in range(i + 1):
            out[i, j] = out[j, i] = cs.dot(columns[:, i], weighted[:, j])
    return cs.densify(out)


class _Factors(NamedTuple):
    """A = L D Lᵀ: the rows of L left of its diagonal of ones, and D⁻¹."""

    rows: list[list[cs.SX]]
    inverse: list[cs.SX]


def solve_spd(A: cs.SX, b: cs.SX) -> cs.SX:
    """Return A⁻¹ b for a symmetric positive definite A, of which the lower triangle is read."""
    f = _factors(A)
    x = [row * inverse for row, inverse in zip(_forward(f, b), f.inverse, strict=True)]
    for i in reversed(range(len(x))):
        for j in range(i):
            x[j] -= f.rows[i][j] * x[i]
    return cs.vertcat(*x)


def half_solve_spd(A: cs.SX, b: cs.SX) -> cs.SX:
    """Return H with Hᵀ H = bᵀ A⁻¹ b, symmetric to the last bit."""
    f = _factors(A)
    rows = zip(_forward(f, b), f.inverse, strict=True)
    return cs.vertcat(*(row * cs.sqrt(inverse) for row, inverse in rows))


def _factors(A: cs.SX) -> _Factors:
    rows: list[list[cs.SX]] = []
    inverse: list[cs.SX] = []
    for i in range(A.shape[0]):
        scaled: list[cs.SX] = []  # L_ij D_j
        row: list[cs.SX] = []
        for j in range(i):
            scaled.append(A[i, j] - sum(scaled[k] * rows[j][k] for k in range(j)))
            row.append(scaled[j] * inverse[j])
        inverse.append(1 / (A[i, i] - sum(scaled[k] * row[k] for k in range(i))))
        rows.append(row)
    return _Factors(rows, inverse)


def _forward(f: _Factors, b: cs.SX) -> list[cs.SX]:
    """Return the rows of L⁻¹ b."""
    z: list[cs.SX] = []
    for i, row in enumerate(f.rows):
        z.append(b[i, :] - sum(row[k] * z[k] for k in range(i)))
    return z
