"""What an arm carries: bodies on its flange, as numbers of its last link."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from passiflex.robots.bodies import Array, Body, Placement, about_origin, turned
from passiflex.robots.chain import SerialChain


def carrying(chain: SerialChain, numbers: Mapping[str, Array], body: Body) -> dict[str, Array]:
    """Return the numbers of the links with a body on the flange, which is given in the axes of the chain's tip."""
    carried = turned(body, Placement(np.asarray(chain.tip_xyz), np.asarray(chain.tip_rotation)))
    more = {
        "link_mass": np.asarray(carried.mass),
        "link_moment": carried.mass * carried.com,
        "link_inertia": about_origin(carried),
    }
    out = {name: np.array(numbers[name], dtype=float) for name in more}
    for name, value in more.items():
        out[name][-1] += value
    return out
