"""Spectral radii over two gains at a time, and the borders of what is stable."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.stability.admissible import INERTIA_RATIOS, first_stable, least_inertia, shaping
from passiflex.stability.linear_loop import LinearLoop

Array = NDArray[np.float64]

SCAN, FINE = 16, 0.01
"""Points that are tried for a border of a map, and its relative precision."""


class Plane(NamedTuple):
    """Spectral radii (a, b) per period over a grid of two gains: `horizontal` (a,) and `vertical` (b,)."""

    horizontal: Array
    vertical: Array
    radius: Array


class StableRange(NamedTuple):
    """What is stable of a gain at each value of another: from `least` to `most`, (a,).

    nan where nothing is; 0 and inf where the end lies beyond the plane.
    """

    least: Array
    most: Array


def shaping_plane(loop: LinearLoop, stiffness_ratios: Array, inertia_ratios: Array) -> Plane:
    """Return the radii over K_e/K and B_e/B."""

    def radius(stiffness: float, inertia: float) -> float:
        return loop.radius(gains=shaping(loop, stiffness, inertia))

    return _plane(stiffness_ratios, inertia_ratios, radius)


def impedance_plane(loop: LinearLoop, stiffness_scales: Array, damping_scales: Array) -> Plane:
    """Return the radii over multiples of the problem's own K_x and D_x."""
    return _plane(
        stiffness_scales, damping_scales, lambda k, d: loop.radius(gains=scaled_impedance(loop, k, d))
    )


def scaled_impedance(loop: LinearLoop, stiffness_scale: float, damping_scale: float) -> dict[str, Array]:
    """Return the gains K_x and D_x as multiples of the problem's own."""
    own = loop.problem.law.layout.unpack(loop.problem.gains)
    return {"stiffness": stiffness_scale * own["stiffness"], "damping": damping_scale * own["damping"]}


def stable_damping(loop: LinearLoop, plane: Plane) -> StableRange:
    """Return the stable D_x of an impedance plane at each K_x: the longest stretch of the grid, its ends refined."""
    ends = []
    for k, radii in zip(plane.horizontal, plane.radius, strict=True):

        def stable(d: float, k: float = float(k)) -> bool:
            return loop.radius(gains=scaled_impedance(loop, k, d)) < 1

        ends.append(_stretch(plane.vertical, radii < 1, stable))
    least, most = np.array(ends).T
    return StableRange(least, most)


def least_inertias(loop: LinearLoop, stiffness_ratios: Array) -> Array:
    """Return the smallest stable B_e/B at each K_e/K (a,), as `least_inertia` has it."""
    T, late = loop.problem.period, loop.problem.delay
    return np.array([least_inertia(loop, float(r), T, late, SCAN, FINE) for r in stiffness_ratios])


def least_inertias_by_rate(loop: LinearLoop, rates: Iterable[float]) -> Array:
    """Return the smallest stable B_e/B with K_e = K at each rate [Hz], with as many periods of delay."""
    periods = loop.problem.delay / loop.problem.period
    return np.array([least_inertia(loop, 1.0, 1 / r, periods / r, SCAN, FINE) for r in rates])


def radii_by_rate(loop: LinearLoop, rates: Iterable[float]) -> Array:
    """Return the radius of the problem's own gains at each rate [Hz], with as many periods of delay."""
    periods = loop.problem.delay / loop.problem.period
    return np.array([loop.radius(1 / r, periods / r) for r in rates])


def within(border: float) -> bool:
    """Return whether a smallest stable B_e/B is a border, and not the end of where one was looked for."""
    return INERTIA_RATIOS[0] < border < math.inf


def _plane(horizontal: Array, vertical: Array, radius: Callable[[float, float], float]) -> Plane:
    radii = [[radius(float(x), float(y)) for y in vertical] for x in horizontal]
    return Plane(horizontal, vertical, np.array(radii).reshape(horizontal.size, vertical.size))


def _stretch(
    values: Array, inside: NDArray[np.bool_], stable: Callable[[float], bool]
) -> tuple[float, float]:
    """Return both ends of the longest run of what is inside; 0 or inf if it goes on beyond the values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]])))
    if edges.size == 0:
        return math.nan, math.nan
    runs = edges.reshape(-1, 2)
    first, after = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    least, most = 0.0, math.inf
    if first > 0:
        least = first_stable(stable, (float(values[first - 1]), float(values[first])), 2, FINE)
    if after < values.size:
        limits = 1 / float(values[after]), 1 / float(values[after - 1])
        most = 1 / first_stable(lambda inverse: stable(1 / inverse), limits, 2, FINE)
    return least, most
