"""The box that a search for the worst case goes through: one side for each column of the draws."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from passiflex.campaigns.campaign import Campaign
from passiflex.campaigns.distributions import Choice, Distribution, LogUniform
from passiflex.campaigns.draws import columns
from passiflex.errors import ValueRangeError

Array = NDArray[np.float64]

EDGE = 0.1
"""How far an optimiser may go beyond a side, as a share of it; what is out there counts as the border.

Else it would come ever nearer to a border or corner, where the worst case often is, and never be on it."""


@dataclass(frozen=True, eq=False)
class Box:
    """The supports of a campaign's parameters as a box for an optimiser.

    A side is 0 to 1 from the least to the largest value, logarithmic for log_uniform; that of a choice counts its
    values from 0.
    """

    names: tuple[str, ...]
    parameters: tuple[Distribution, ...]

    @classmethod
    def of(cls, campaign: Campaign) -> Box:
        """Return the box of a campaign.

        Raises
        ------
        ValueRangeError
            If it has no parameter, or one whose support has no end.
        """
        for path, parameter in campaign.parameters.items():
            if not all(math.isfinite(end) for end in parameter.support):
                low, high = parameter.support
                raise ValueRangeError(
                    f"parameter {path!r} has no worst value: its distribution has an open end",
                    got=f"a support from {low:g} to {high:g}",
                    needs="a least and a largest value",
                    try_="`low: …` and `high: …`",
                )
        if not campaign.parameters:
            raise ValueRangeError(
                f"campaign {campaign.name!r} has no parameters", needs="at least one to search over"
            )
        sides = tuple(p for p in campaign.parameters.values() for _ in range(campaign.joints if p.per else 1))
        return cls(columns(campaign), sides)

    @property
    def whole(self) -> NDArray[np.bool_]:
        """Return which sides are whole numbers."""
        return np.array([isinstance(p, Choice) for p in self.parameters])

    @property
    def bounds(self) -> Array:
        """Return where an optimiser may go, (sides, 2)."""
        return np.array(
            [
                (0.0, len(p.values) - 1.0) if isinstance(p, Choice) else (-EDGE, 1 + EDGE)
                for p in self.parameters
            ]
        )

    def inside(self, points: Array) -> Array:
        """Return the points of the box that points at which an optimiser is stand for, (points, sides)."""
        low, high = self.bounds.T
        points = np.clip(points, np.where(self.whole, low, 0.0), np.where(self.whole, high, 1.0))
        return np.where(self.whole, np.round(points), points)

    def row(self, point: Array) -> Array:
        """Return the values at a point inside, as a row of `draws.draws`."""
        return np.array([_value(p, x) for p, x in zip(self.parameters, point.tolist(), strict=True)])

    def distance(self, one: Array, other: Array) -> float:
        """Return how far apart two points inside are: the largest share of a side; 1 for different choices."""
        apart = np.abs(one - other)
        return float(np.where(self.whole, np.minimum(apart, 1.0), apart).max())


def _value(parameter: Distribution, x: float) -> float:
    if isinstance(parameter, Choice):
        return float(parameter.values[int(x)]) if parameter.numeric else x
    low, high = parameter.support
    if isinstance(parameter, LogUniform):
        return min(low * (high / low) ** x, high) if x < 1 else high
    return (1 - x) * low + x * high
