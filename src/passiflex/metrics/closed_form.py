"""The ideal mass-spring-damper in closed form: exact at any instants, for thousands of responses."""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from passiflex.control.motion import DEGREE, Motion, pose_at
from passiflex.problems.problem import Event

Array = NDArray[np.float64]

STRIDE = 64
"""Instants of a grid that one product of matrices reaches at a time."""


def ideal_displacement(
    inertia: Array, stiffness: Array, damping: Array, events: tuple[Event, ...], interval: float, count: int
) -> Array:
    """Return x − x(0) of M_x ẍ + D_x ẋ + K_x (x − x_d) = F_e at the instants 0, interval, …; (count, 3) m.

    The reference is a sum of powers of its clock, a sine and a cosine, so that motion and reference together
    are one linear system ẇ = A w, and w(t + h) = exp(A h) w(t).

    Parameters
    ----------
    inertia, stiffness, damping: M_x, K_x, D_x; (k, k) with k = 3 for position or 6 with small rotations,
        which are not asked to move.
    events: Reference motions and wrenches; the first holds the home pose.
    interval: [s].
    """
    k = inertia.shape[0]
    assert events[0].motion is not None
    home = pose_at(events[0].motion, 0.0).position
    out = np.empty((count, 3))
    x: Array = np.zeros(2 * k)
    motion, began = events[0].motion, 0.0
    for event, end in zip(events, [*(e.time for e in events[1:]), math.inf], strict=True):
        if event.motion is not None:
            motion, began = event.motion, event.time
        turn = began + float(motion["horizon"])  # from here on the polynomial keeps its value
        for start, stop in _pieces(event.time, turn, end):
            first = max(0, math.ceil(start / interval - 1e-9))
            last = count if math.isinf(stop) else min(count, math.ceil(stop / interval - 1e-9))
            w = np.concatenate([x, _basis(motion, start - began)])
            A = _system(inertia, stiffness, damping, motion, event.F_e[:k], home, moving=start < turn)
            if last > first:
                here = scipy.linalg.expm(A * (first * interval - start)) @ w
                out[first:last] = _on_grid(A, here, interval, last - first)[:, :3]
            if not math.isinf(stop):
                x = (scipy.linalg.expm(A * (stop - start)) @ w)[: 2 * k]
    return out


def _pieces(start: float, turn: float, end: float) -> list[tuple[float, float]]:
    return [(start, turn), (turn, end)] if start < turn < end else [(start, end)]


def _basis(motion: Motion, clock: float) -> Array:
    """Return (1, s, …, s^5, sin ωs, cos ωs)."""
    s, angle = min(clock, float(motion["horizon"])), float(motion["frequency"]) * clock
    return np.concatenate([s ** np.arange(DEGREE + 1), [math.sin(angle), math.cos(angle)]])


def _system(
    inertia: Array, stiffness: Array, damping: Array, motion: Motion, F: Array, home: Array, *, moving: bool
) -> Array:
    """Return A of ẇ = A w for w = (x − home, ẋ, basis)."""
    k, size = len(inertia), 2 * len(inertia) + DEGREE + 3
    sine, cosine = size - 2, size - 1
    A = np.zeros((size, size))
    A[:k, k : 2 * k] = np.eye(k)
    A[k : 2 * k, :k] = -np.linalg.solve(inertia, stiffness)
    A[k : 2 * k, k : 2 * k] = -np.linalg.solve(inertia, damping)
    desired = np.zeros((k, DEGREE + 3))  # x_d − home in terms of the basis
    desired[:3, : DEGREE + 1] = motion["polynomial"]
    desired[:3, 0] += motion["cosine"] - home
    desired[:3, -2], desired[:3, -1] = motion["sine"], -motion["cosine"]
    pull = stiffness @ desired
    pull[:, 0] += F
    A[k : 2 * k, 2 * k :] = np.linalg.solve(inertia, pull)
    if moving:
        for power in range(1, DEGREE + 1):
            A[2 * k + power, 2 * k + power - 1] = power
    A[sine, cosine], A[cosine, sine] = motion["frequency"], -motion["frequency"]
    return A


def _on_grid(A: Array, w: Array, interval: float, count: int) -> Array:
    """Return w at `count` instants of a grid, the first of them given."""
    step = scipy.linalg.expm(A * interval)
    powers = [np.eye(len(A))]
    for _ in range(STRIDE):
        powers.append(step @ powers[-1])
    strides, blocks = np.array(powers[:-1]), []
    for _ in range(0, count, STRIDE):
        blocks.append(strides @ w)
        w = powers[-1] @ w
    return np.concatenate(blocks)[:count]
