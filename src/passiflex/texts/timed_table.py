"""Tables of numbers over time: which columns there may be, which go together, and rows in the order of time."""

from __future__ import annotations

import re
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from passiflex.texts.model_mistakes import suggested
from passiflex.texts.number_table import NumberTable, parsed, unpacked

Array = NDArray[np.float64]


def timed_table(text: str, known: Collection[str], example: str) -> NumberTable:
    """Return the table of a text, packed or not: a column t [s] that increases from 0 on, and others of those known.

    Parameters
    ----------
    example: What is said of a name of one letter that is not known.

    Raises
    ------
    ValueError
        With line and remedy, for a table that has mistakes.
    UnreadableError
        For packed rows that are damaged.
    """
    table = parsed(unpacked(text))
    for name in table.names:
        if name not in known:
            if (bare := re.sub(r"\s*[\[(].*", "", name)) in known:
                raise ValueError(
                    f"unknown column {name!r}; try {bare!r}: columns are in SI units, without one"
                )
            if "t" not in table.names and re.match(r"t\b|t_|time|stamp|sec", name, re.IGNORECASE):
                raise ValueError(f"unknown column {name!r}; if it is the time in s, call it t")
            hint = suggested(name, known) if len(name) > 1 else f"known are {example}"
            raise ValueError(f"unknown column {name!r}; {hint}")
    if "t" not in table.names:
        raise ValueError("has no column t, the time in s; add it")
    time = columns(table, ("t",))
    assert time is not None
    _require_order(time[:, 0], table.lines)
    return table


def columns(table: NumberTable, names: tuple[str, ...]) -> Array | None:
    """Return the columns of these names, (N, k); None if none is there.

    Raises
    ------
    ValueError
        If some are there and others are missing.
    """
    there = [name for name in names if name in table.names]
    if not there:
        return None
    if missing := [name for name in names if name not in there]:
        raise ValueError(f"has {', '.join(there)} without {', '.join(missing)}; add what is missing")
    return table.numbers[:, [table.names.index(name) for name in names]]


def _require_order(time: Array, lines: NDArray[np.int64]) -> None:
    if time[0] < 0:
        raise ValueError(f"line {lines[0]}, column t: {time[0]:g} s is before the start; begin at 0 or later")
    if (back := np.flatnonzero(np.diff(time) <= 0)).size:
        i = int(back[0])
        what = "repeats" if time[i + 1] == time[i] else "goes back"
        raise ValueError(
            f"line {lines[i + 1]}, column t: the time {what}, {time[i + 1]:.9g} s after {time[i]:.9g} s; "
            "sort the rows by t, each instant once"
        )
