"""A wrench over time from arrays, in place of a file."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydantic import ValidationError

from passiflex.errors import ScenarioError, SizeError
from passiflex.scenarios.forces import FORCE, MOMENT, WrenchTable
from passiflex.simulation.setpoint_arrays import numbers_of
from passiflex.texts.model_mistakes import told
from passiflex.texts.number_table import written


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
    t = numbers_of("time", time)
    if t.ndim != 1 or not t.size:
        raise SizeError("time", got=f"shape {t.shape}", needs="(N,)")
    names, columns = ["t"], [t[:, None]]
    for name, given, named in (("force", force, FORCE), ("moment", moment, MOMENT)):
        if given is not None:
            values = numbers_of(name, given)
            if values.shape != (t.size, 3):
                raise SizeError(name, got=f"shape {values.shape}", needs=f"{(t.size, 3)}")
            names.extend(named)
            columns.append(values)
    data = {"rows": written(names, np.hstack(columns)), "at": at}
    try:
        return WrenchTable.model_validate(data)
    except ValidationError as error:
        raise ScenarioError("table", told(error, data, WrenchTable)) from None
