"""What is kept of a run in lanes: the signals that were asked for, as `Run` has them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from passiflex.elements import Books
from passiflex.problems.problem import SampledProblem

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Recording:
    """The signals of one run that were asked for, as `Run` has them.

    Attributes
    ----------
    signals: By name, arrays whose first axis is the row.
    time: Of the rows [s].
    failure: Why the run ended early; empty if it did not.
    has_tank: Whether its law has a tank.
    unbooked: What the law's books do not know in it, in words.
    noted: What was noted at every step, whatever was asked for.
    elements: What touched the robot, as far as its books were asked for.
    """

    signals: dict[str, Array]
    time: Array
    failure: str
    has_tank: bool
    unbooked: str
    noted: dict[str, Array]
    elements: tuple[Books, ...] = ()
    sampled: bool = True

    def __getitem__(self, name: str) -> Array:
        """Return a signal as an array, time is the first axis; or what was noted."""
        return self.signals[name] if name in self.signals else self.noted[name]


def books_kept(problem: SampledProblem, keep: Collection[str]) -> tuple[Books, ...]:
    """Return the elements all of whose books are kept."""
    books = (e.books for e in problem.loop.plant.booked)
    return tuple(b for b in books if set(b.signals) <= set(keep))
