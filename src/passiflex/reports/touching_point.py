"""Where a hand touches a surface: on its face, below the point of the hand that is deepest."""

from __future__ import annotations

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.scenarios.surface_settings import AbstractSurface
from passiflex.scenarios.touching import Hand

Array = NDArray[np.float64]


def touching_point(
    entry: AbstractSurface, axes: Array, hand: Hand, place: Array, position: Array, rotation: Array
) -> Array:
    """Return where the hand touches a surface, or is nearest to it, (N, 3) m in the world.

    Parameters
    ----------
    axes: Of the surface, as columns.
    place: Origin of its axes in the world, (N, 3) m.
    position, rotation: Of the end effector, (N, 3) m and (N, 3, 3).
    """
    shape, p = entry.shape(), cs.SX.sym("p", 3)
    nearest = shape.nearest(p, {name: cs.SX(value) for name, value in shape.numbers().items()})
    function = cs.Function("nearest", [p], [nearest.distance, nearest.outward])
    depths, points = [], []
    for point in hand.points:
        centre = position + rotation @ np.array(point)
        distance, outward = (np.array(part) for part in function(((centre - place) @ axes).T))
        depth = hand.radius - distance.ravel()
        depths.append(depth)
        points.append(centre - (hand.radius - np.maximum(depth, 0.0))[:, None] * (axes @ outward).T)
    deepest = np.argmax(depths, axis=0)
    return np.array(points)[deepest, np.arange(deepest.size)]
