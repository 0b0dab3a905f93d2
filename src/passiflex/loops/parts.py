"""The parameters of a control period, part by part."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import accumulate, pairwise
from types import SimpleNamespace
from typing import Any, NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.layout import Layout


class Parts(NamedTuple):
    """The parameters of the period, in the order of the flat vector; those of `ControlParameters` have its names."""

    plant: Layout
    model: Layout
    gains: Layout
    fallback: Layout
    tank: Layout
    actions: Layout
    observer: Layout
    inner: Layout
    errors: Layout
    sensors: Layout
    limits: Layout

    @property
    def size(self) -> int:
        """Return the length of the flat vector."""
        return sum(part.size for part in self)

    @property
    def slices(self) -> dict[str, slice]:
        """Return part → slice of the flat vector."""
        ends = list(accumulate(part.size for part in self))
        return {name: slice(*ab) for name, ab in zip(self._fields, pairwise([0, *ends]), strict=True)}

    def view(self, p: cs.SX) -> SimpleNamespace:
        """Return named symbolic views of all parts."""
        return SimpleNamespace(**{name: getattr(self, name).view(p[at]) for name, at in self.slices.items()})

    def pack(self, **values: Mapping[str, Any]) -> NDArray[np.float64]:
        """Return the flat vector of the numbers of all parts, each by name."""
        return np.concatenate([getattr(self, name).pack(values[name]) for name in self._fields])

    def unpack(self, name: str, numbers: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return the numbers of one part by name."""
        return getattr(self, name).unpack(numbers[self.slices[name]])
