"""From pose to pose: the motions between points that are passed at given times.

`held` stays until the next point; `linear` and `minimum_jerk` go straight and by the shortest turn, the second with a
rest at each point. `smooth` passes the points without one: its position is the spline of degree five that passes them
with the least jerk, at rest at both ends, its turns have the angular velocity and acceleration at the points that the
same spline through their sum has, and each leg is a rotation vector of degree five with them. So velocity and
acceleration are continuous, and two points are the move with minimum jerk.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from passiflex.control.motion import DEGREE, LINEAR, MINIMUM_JERK, Motion, Pose, along, hold
from passiflex.control.rotation_vector import rates_for

Array = NDArray[np.float64]
Between = Literal["held", "linear", "minimum_jerk", "smooth"]
SHAPES = {"linear": LINEAR, "minimum_jerk": MINIMUM_JERK}


def legs(
    time: Array,
    position: Array,
    rotation: Array,
    between: Between,
    velocity: Array | None = None,
    spin: Array | None = None,
) -> list[Motion]:
    """Return the motion that begins at each point; the last one stays there.

    Parameters
    ----------
    time: (N,) s, increasing.
    position, rotation: (N, 3) m, (N, 3, 3).
    velocity, spin: With `smooth`, at the points, (N, 3) m/s and rad/s; each leg is then of degree three.
    """
    poses = [Pose(p, R) for p, R in zip(position, rotation, strict=True)]
    if between == "held" or len(poses) == 1:
        return [hold(pose) for pose in poses]
    turns = Rotation.from_matrix(rotation[1:] @ rotation[:-1].transpose(0, 2, 1)).as_rotvec()
    turns[np.abs(turns).max(axis=1) < ROUND_OFF] = 0.0
    spans, ways = np.diff(time), np.diff(position, axis=0)
    if between != "smooth":
        shape = SHAPES[between]
        steps = zip(poses[:-1], ways, turns, spans, strict=True)
        return [*(along(pose, by, turn, t, shape) for pose, by, turn, t in steps), hold(poses[-1])]
    places = _degree_three(spans, ways, velocity) if velocity is not None else _splines(time, position)
    turning = _turning(time, spans, turns, spin)
    motions: list[Motion] = []
    for pose, place, turn, span in zip(poses[:-1], places, turning, spans, strict=True):
        motion = hold(pose)
        motion["horizon"] = np.asarray(span)
        motion["polynomial"][:, 1:], motion["turn"][:, 1:] = place[:, 1:], turn[:, 1:]
        motions.append(motion)
    return [*motions, hold(poses[-1])]


ROUND_OFF = 1e-15
"""A turn [rad] that is none."""


def _spline(time: Array, values: Array) -> Any:
    """Return the spline of degree five through values (N, 3), at rest without acceleration at both ends."""
    still: Any = [(order, np.zeros(3)) for order in (1, 2)]
    return make_interp_spline(time, values, k=DEGREE, bc_type=(still, still))


def _splines(time: Array, values: Array) -> Array:
    """Return the powers of the spline from each point on, (N − 1, 3, 6)."""
    spline = _spline(time, values)
    factorials = np.cumprod([1.0, *range(1, DEGREE + 1)])
    starts = time[:-1]
    found = [spline(starts, k) / factorials[k] for k in range(DEGREE)]
    spans = np.diff(time)[:, None]
    # the fifth power so that the leg ends at its point
    rest = np.diff(values, axis=0) - sum(c * spans**k for k, c in enumerate(found) if k)
    return np.stack([*found, rest / spans**DEGREE], axis=-1)


def _degree_three(spans: Array, ways: Array, rates: Array) -> Array:
    """Return the powers (N − 1, 3, 6) of legs of these displacements, with these rates at their ends (N, 3)."""
    h, out = spans[:, None], np.zeros((len(spans), 3, DEGREE + 1))
    first, last = rates[:-1], rates[1:]
    out[:, :, 1] = first
    out[:, :, 2] = (3 * ways / h - 2 * first - last) / h
    out[:, :, 3] = (first + last - 2 * ways / h) / h**2
    return out


def _turning(time: Array, spans: Array, turns: Array, spin: Array | None) -> Array:
    """Return the powers (N − 1, 3, 6) of the rotation vector of each leg."""
    if spin is not None:
        last = [rates_for(u, omega, np.zeros(3))[0] for u, omega in zip(turns, spin[1:], strict=True)]
        out = np.zeros((len(spans), 3, DEGREE + 1))
        for i, (h, u) in enumerate(zip(spans, turns, strict=True)):
            out[i] = _degree_three(np.array([h]), u[None], np.array([spin[i], last[i]]))[0]
        return out
    if not turns.any():
        return np.zeros((len(spans), 3, DEGREE + 1))
    summed = _spline(time, np.vstack([np.zeros(3), np.cumsum(turns, axis=0)]))
    omega, alpha = summed(time, 1), summed(time, 2)
    omega[[0, -1]] = alpha[[0, -1]] = 0.0
    out = np.zeros((len(spans), 3, DEGREE + 1))
    for i, (h, u) in enumerate(zip(spans, turns, strict=True)):
        out[i] = _degree_five(h, u, (omega[i], alpha[i]), rates_for(u, omega[i + 1], alpha[i + 1]))
    return out


def _degree_five(h: float, way: Array, begin: tuple[Array, Array], end: tuple[Array, Array]) -> Array:
    """Return the powers (3, 6) of the one leg from 0 to `way` with these first and second rates at its ends."""
    (v, a), (w, b) = begin, end
    rest = way - v * h - a * h**2 / 2, w - v - a * h, b - a
    p, q, r = rest[0] / h**3, rest[1] / h**2, rest[2] / h
    third = 10 * p - 4 * q + r / 2
    fourth = (-15 * p + 7 * q - r) / h
    fifth = (6 * p - 3 * q + r / 2) / h**2
    return np.column_stack([np.zeros(3), v, a / 2, third, fourth, fifth])
