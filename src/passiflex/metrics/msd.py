"""The ideal that the robot is held against: the mass-spring-damper M_x ẍ + D_x ẋ + K_x (x − x_d) = F_e."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.integrate
from numpy.typing import NDArray

from passiflex.control.motion import Motion, pose_at
from passiflex.problems.problem import Event

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class IdealResponse:
    """The motion of the ideal system.

    Attributes
    ----------
    time: (N,) s.
    displacement: x − x(0), (N, 3) m.
    ledger_residual: Largest |H − H(0) − supplied + dissipated| [J].
    largest_rise: Largest rise of H above what was supplied [J]: ≤ 0 but for round-off, as the system is passive.
    """

    time: Array
    displacement: Array
    ledger_residual: float
    largest_rise: float


def ideal_response(
    inertia: Array, stiffness: Array, damping: Array, events: tuple[Event, ...], time: Array
) -> IdealResponse:
    """Return the motion of the mass-spring-damper under the events of a scenario.

    Parameters
    ----------
    inertia, stiffness, damping: M_x, K_x, D_x; (k, k) with k = 3 for position or 6 with small rotations,
        which are not asked to move.
    events: Reference motions and wrenches; the first holds the home pose.
    time: Increasing instants of the answer, from 0 [s].
    """
    k = inertia.shape[0]
    inverse = np.linalg.inv(inertia)
    assert events[0].motion is not None
    home = pose_at(events[0].motion, 0.0).position
    motion, began = events[0].motion, 0.0
    y = np.zeros(2 * k + 2)  # x − home, ẋ, ∫ supplied, ∫ dissipated
    rows = np.empty((time.size, y.size))
    stored = np.empty(time.size)
    ends = [e.time for e in events[1:]] + [float(time[-1]) + 1e-9]
    for event, end in zip(events, ends, strict=True):
        if event.motion is not None:
            before = _spring(stiffness, y[:k], motion, event.time - began, home)
            motion, began = event.motion, event.time
            y[2 * k] += _spring(stiffness, y[:k], motion, 0.0, home) - before
        moving, start = motion, began
        F = event.F_e[:k]

        def slope(t: float, y: Array, moving: Motion = moving, start: float = start, F: Array = F) -> Array:
            x, dx = y[:k], y[k : 2 * k]
            desired, velocity = _desired(moving, t - start, home, k)
            pull = stiffness @ (x - desired)
            ddx = inverse @ (F - damping @ dx - pull)
            return np.concatenate([dx, ddx, [F @ dx - pull @ velocity, dx @ damping @ dx]])

        inside = np.flatnonzero((time >= event.time) & (time < end))
        solution = scipy.integrate.solve_ivp(
            slope, (event.time, end), y, "LSODA", np.append(time[inside], end), rtol=1e-9, atol=1e-12
        )
        rows[inside] = solution.y.T[:-1]
        for i in inside:
            x, dx = rows[i, :k], rows[i, k : 2 * k]
            stored[i] = dx @ inertia @ dx / 2 + _spring(stiffness, x, moving, time[i] - start, home)
        y = solution.y[:, -1]
    excess = stored - stored[0] - rows[:, 2 * k]
    return IdealResponse(
        time=time,
        displacement=rows[:, :3],
        ledger_residual=float(np.abs(excess + rows[:, 2 * k + 1]).max()),
        largest_rise=float((excess - np.minimum.accumulate(excess)).max()),
    )


def _desired(motion: Motion, clock: float, home: Array, k: int) -> tuple[Array, Array]:
    """Return displacement and velocity of the reference, without its orientation."""
    degree = np.arange(motion["polynomial"].shape[1])
    w, a, b = float(motion["frequency"]), motion["sine"], motion["cosine"]
    sin, cos = math.sin(w * clock), math.cos(w * clock)
    x, velocity = np.zeros(k), np.zeros(k)
    s, moving = min(clock, float(motion["horizon"])), clock < motion["horizon"]
    x[:3] = motion["polynomial"] @ s**degree + a * sin + b * (1 - cos) - home
    velocity[:3] = moving * motion["polynomial"][:, 1:] @ (degree[1:] * s ** degree[:-1]) + w * (
        a * cos + b * sin
    )
    return x, velocity


def _spring(stiffness: Array, x: Array, motion: Motion, clock: float, home: Array) -> float:
    e = x - _desired(motion, clock, home, x.size)[0]
    return float(e @ stiffness @ e) / 2
