"""A table of set-points from arrays, in place of a file."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from passiflex.errors import ValueRangeError
from passiflex.scenarios.setpoint_rows import POSITION, QUATERNION, SPIN, TURN, VELOCITY, gain_names
from passiflex.scenarios.setpoints import Stream, Table
from passiflex.simulation.array_table import ArrayTable, numbers_of

Array = NDArray[np.float64]


def setpoint_table(
    time: ArrayLike,
    position: ArrayLike | None = None,
    rotation: ArrayLike | Rotation | None = None,
    *,
    velocity: ArrayLike | None = None,
    spin: ArrayLike | None = None,
    stiffness: ArrayLike | None = None,
    damping: ArrayLike | None = None,
    at: float = 0.0,
    between: Literal["held", "linear", "minimum_jerk", "smooth"] = "linear",
    relative: bool = False,
    axes: Literal["world", "tool"] = "world",
    stream: Stream | dict[str, Any] | None = None,
) -> Table:
    """Return a table of set-points for `simulate(…, reference=…)`, or for `reference` of a scenario.

    Parameters
    ----------
    time: (N,) s, increasing, from `at` on.
    position: (N, 3) m.
    rotation: Rotation vectors (N, 3) rad, quaternions (N, 4) with the scalar last, matrices (N, 3, 3), or SciPy's
        rotations.
    velocity, spin: (N, 3) m/s and rad/s at the rows, with `between="smooth"`.
    stiffness, damping: K_x and D_x, their diagonals (N, k) or the whole (N, k, k).
    at, between, relative, axes, stream: As in a scenario file.

    Raises
    ------
    SizeError
        For an array of another shape.
    ValueRangeError
        For what is no array of numbers.
    ScenarioError
        For rows that a file could not have either.
    """
    table = ArrayTable(time)
    table.add("position", position, {(3,): POSITION})
    if isinstance(rotation, Rotation):
        rotation = rotation.as_quat()
    elif rotation is not None and (R := numbers_of("rotation", rotation)).ndim == 3 and R.shape[1:] == (3, 3):
        rotation = _quaternions(R)
    table.add("rotation", rotation, {(3,): TURN, (4,): QUATERNION})
    table.add("velocity", velocity, {(3,): VELOCITY})
    table.add("spin", spin, {(3,): SPIN})
    for name, gains in (("stiffness", stiffness), ("damping", damping)):
        shapes: dict[tuple[int, ...], tuple[str, ...]] = {}
        shapes |= {(k,): gain_names(name[0].replace("s", "k"), k) for k in (3, 6)}
        shapes |= {(k, k): gain_names(name[0].replace("s", "k"), k, in_full=True) for k in (3, 6)}
        table.add(name, gains, shapes)
    return table.build(
        Table, kind="table", at=at, between=between, relative=relative, axes=axes, stream=stream
    )


def _quaternions(R: Array) -> Array:
    """Return the quaternions of rotation matrices; what is none is refused."""
    off = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    if (bad := np.flatnonzero(~((off < 1e-6) & (np.linalg.det(np.nan_to_num(R)) > 0)))).size:
        raise ValueRangeError(
            f"rotation[{bad[0]}] is no rotation matrix", needs="R Rᵀ = I and det R = 1, to 1e-6"
        )
    return np.asarray(Rotation.from_matrix(R).as_quat())
