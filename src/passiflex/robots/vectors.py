"""Vectors of three scalar expressions: products with 0 and 1 vanish as they are made, unlike those of matrices."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as cs
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Vector = list[cs.SX]
"""Three entries, or the six of a symmetric matrix: xx, xy, xz, yy, yz, zz."""


def scalars(row: cs.SX) -> Vector:
    """Return the entries of a row."""
    return cs.horzsplit(row)


def constants(v: Array) -> Vector:
    """Return numbers as expressions."""
    return [cs.SX(float(x)) for x in v]


def zero() -> Vector:
    """Return 0."""
    return [cs.SX(0)] * 3


def plus(a: Vector, b: Vector) -> Vector:
    """Return a + b, of any length."""
    return [x + y for x, y in zip(a, b, strict=True)]


def cross(a: Vector, b: Vector) -> Vector:
    """Return a × b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a: Vector, b: Vector) -> cs.SX:
    """Return aᵀ b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def combined(columns: Sequence[Vector], v: Vector) -> Vector:
    """Return the vector with the coordinates v along these axes."""
    return [sum((axis[i] * x for axis, x in zip(columns, v, strict=True)), cs.SX(0)) for i in range(3)]


def through(rows: Sequence[Vector], v: Vector) -> Vector:
    """Return the matrix of these rows times v."""
    return [dot(row, v) for row in rows]


def times(constant: Array, v: Vector) -> Vector:
    """Return a constant matrix times a vector; zeros and ones cost nothing."""
    return [sum((float(c) * x for c, x in zip(row, v, strict=True) if c), cs.SX(0)) for row in constant]


def congruent(constant: Array, tensor: Vector) -> Vector:
    """Return C I Cᵀ."""
    xx, xy, xz, yy, yz, zz = tensor
    columns = [times(constant, v) for v in ([xx, xy, xz], [xy, yy, yz], [xz, yz, zz])]  # of C I
    rows = [times(constant, [column[i] for column in columns]) for i in range(3)]
    return [rows[0][0], rows[0][1], rows[0][2], rows[1][1], rows[1][2], rows[2][2]]
