"""Which points of a limit map to confirm: just inside and just outside its borders."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.limits.confirmation import VISIBLE
from passiflex.limits.planes import scaled_impedance, within
from passiflex.stability.admissible import RATES, shaping
from passiflex.stability.linear_loop import LinearLoop

if TYPE_CHECKING:
    from passiflex.limits.limit_map import LimitMap

Array = NDArray[np.float64]

INSIDE, OUTSIDE = 1.15, (0.85, 0.7, 0.5, 0.3)
"""Points to confirm, as multiples of a least stable value, and of a largest one the other way round: outside the
first at which theory has the motion grow visibly."""
CONFIRMED_STIFFNESS = (0.5, 1.0, 2.0)
CONFIRMED_SCALES = (1.0, 10.0)
"""Where on the borders: K_e/K and multiples of K_x."""


class Point(NamedTuple):
    """A point of a map, with the gains and the rate [Hz] that it stands for."""

    plane: str
    point: tuple[float, float]
    gains: dict[str, Array]
    rate: float | None = None


def points_to_confirm(found: LimitMap, own: LinearLoop) -> Iterator[Point]:
    """Yield the problem's own gains, then points just inside and just outside the borders at its delay."""
    yield Point("impedance", (1.0, 1.0), {})
    if found.shaping is not None and found.least_inertia is not None:
        borders = found.least_inertia[found.own_delay]
        for ratio, border in zip(found.shaping.horizontal, borders, strict=True):
            if within(border) and np.isclose(ratio, CONFIRMED_STIFFNESS).any():
                yield from _both_sides(own, partial(_shaped, own, ratio), border)
    for scale, least, most in zip(found.impedance.horizontal, *found.damping, strict=True):
        if np.isclose(scale, CONFIRMED_SCALES).any():
            if least > 0:
                yield from _both_sides(own, partial(_scaled, own, scale), least)
            if most < np.inf:
                yield from _both_sides(own, partial(_scaled, own, scale), most, largest=True)
    if found.least_inertia_by_rate is not None:
        borders = found.least_inertia_by_rate[found.own_delay]
        places = np.flatnonzero([within(border) for border in borders])
        for i in sorted({int(places[0]), int(places[-1])}) if places.size else ():
            yield from _both_sides(own, partial(_sampled, own, found.rates[i]), borders[i])
    elif RATES[0] < found.admissible.from_rate < np.inf:
        yield from _both_sides(own, partial(_faster, own), found.admissible.from_rate)


def _both_sides(
    own: LinearLoop, place: Callable[[float], Point], border: float, *, largest: bool = False
) -> Iterator[Point]:
    """Yield the point outside a border, if one there is seen to grow, and the one inside."""
    periods = own.problem.delay / own.problem.period

    def beside(side: float) -> Point:
        return place(float(border / side if largest else border * side))

    for outside in map(beside, OUTSIDE):
        T = own.problem.period if outside.rate is None else 1 / outside.rate
        if own.radius(T, periods * T, outside.gains) >= VISIBLE:
            yield outside
            break
    yield beside(INSIDE)


def _shaped(own: LinearLoop, stiffness_ratio: float, inertia_ratio: float) -> Point:
    point = float(stiffness_ratio), inertia_ratio
    return Point("shaping", point, shaping(own, *point))


def _scaled(own: LinearLoop, stiffness_scale: float, damping_scale: float) -> Point:
    point = float(stiffness_scale), damping_scale
    return Point("impedance", point, scaled_impedance(own, *point))


def _sampled(own: LinearLoop, rate: float, inertia_ratio: float) -> Point:
    return Point("rate", (float(rate), inertia_ratio), shaping(own, 1.0, inertia_ratio), float(rate))


def _faster(own: LinearLoop, rate: float) -> Point:
    periods = own.problem.delay / own.problem.period
    return Point("rate", (rate, own.radius(1 / rate, periods / rate)), {}, rate)
