"""The parameters of a loop, part by part: whose numbers they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.layout import Layout

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Parts:
    """Layouts by the name of their part, in the order of one flat vector."""

    layouts: Mapping[str, Layout]

    def __getitem__(self, part: str) -> Layout:
        return self.layouts[part]

    @cached_property
    def size(self) -> int:
        """Return the length of the flat vector."""
        return sum(layout.size for layout in self.layouts.values())

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Return part → slice of the flat vector."""
        ends = list(accumulate(layout.size for layout in self.layouts.values()))
        return {part: slice(*ab) for part, ab in zip(self.layouts, pairwise([0, *ends]), strict=True)}

    def view(self, p: cs.SX) -> dict[str, Any]:
        """Return named symbolic views of each part."""
        return {part: layout.view(p[self.slices[part]]) for part, layout in self.layouts.items()}

    def pack(self, values: Mapping[str, Mapping[str, Any]]) -> Array:
        """Return the flat vector of the numbers of all parts, each by name."""
        return np.concatenate([layout.pack(values[part]) for part, layout in self.layouts.items()])

    def unpack(self, part: str, numbers: Array) -> dict[str, Array]:
        """Return the numbers of one part by name."""
        return self[part].unpack(numbers[self.slices[part]])

    def replaced(self, numbers: Array, values: Mapping[str, ArrayLike], only: str | None = None) -> Array:
        """Return the flat vector with the named numbers replaced, in every part that has them.

        `only` names the one part in which they are.
        """
        out = numbers.copy()
        for part, at in self.slices.items():
            own = self[part].slices
            for name in own.keys() & values.keys() if only in (None, part) else ():
                out[at][own[name]] = np.ravel(values[name])
        return out
