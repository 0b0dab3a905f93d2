"""A wrench over time from arrays, in place of a file."""

from __future__ import annotations

from numpy.typing import ArrayLike

from passiflex.scenarios.forces import FORCE, MOMENT, WrenchTable
from passiflex.simulation.array_table import ArrayTable


def wrench_table(
    time: ArrayLike, force: ArrayLike | None = None, moment: ArrayLike | None = None, *, at: float = 0.0
) -> WrenchTable:
    """Return a wrench on the end effector over time, for `forces` of a scenario: each row holds until the next.

    Parameters
    ----------
    time: (N,) s, increasing, from `at` on.
    force, moment: (N, 3) N and N m, world axes; at least one of the two.
    at: As in a scenario file.

    Raises
    ------
    SizeError
        For an array of another shape.
    ValueRangeError
        For what is no array of numbers.
    ScenarioError
        For rows that a file could not have either.
    """
    table = ArrayTable(time)
    table.add("force", force, {(3,): FORCE})
    table.add("moment", moment, {(3,): MOMENT})
    return table.build(WrenchTable, at=at)
