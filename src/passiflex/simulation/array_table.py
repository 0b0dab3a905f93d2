"""Columns over time from arrays, as the text that a file of them would have."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import ValidationError

from passiflex.errors import ScenarioError, SizeError, ValueRangeError
from passiflex.texts.model_mistakes import told
from passiflex.texts.number_table import written
from passiflex.texts.section import Section

Array = NDArray[np.float64]
Entry = TypeVar("Entry", bound=Section)


class ArrayTable:
    """A table that begins with the column t; others come beside it.

    Parameters
    ----------
    time: (N,) s.
    """

    def __init__(self, time: ArrayLike):
        t = numbers_of("time", time)
        if t.ndim != 1 or not t.size:
            raise SizeError("time", got=f"shape {t.shape}", needs="(N,)")
        self._size, self._names, self._columns = t.size, ["t"], [t[:, None]]

    def add(self, name: str, given: ArrayLike | None, shapes: dict[tuple[int, ...], tuple[str, ...]]) -> None:
        """Add the columns of an array (N, …), if it is given, by the names that belong to its shape."""
        if given is None:
            return
        values = numbers_of(name, given)
        if values.shape[:1] != (self._size,) or values.shape[1:] not in shapes:
            needs = " or ".join(str((self._size, *shape)) for shape in shapes)
            raise SizeError(name, got=f"shape {values.shape}", needs=needs)
        self._names.extend(shapes[values.shape[1:]])
        self._columns.append(values.reshape(self._size, -1))

    def build(self, entry: type[Entry], **settings: Any) -> Entry:
        """Return the entry of a scenario with these rows; its mistakes are those of a file."""
        data = {"rows": written(self._names, np.hstack(self._columns)), **settings}
        try:
            return entry.model_validate(data)
        except ValidationError as error:
            raise ScenarioError("table", told(error, data, entry)) from None


def numbers_of(name: str, given: Any) -> Array:
    """Return an array of numbers."""
    try:
        values = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueRangeError(name, got=type(given).__name__, needs="an array of numbers") from None
    return values
