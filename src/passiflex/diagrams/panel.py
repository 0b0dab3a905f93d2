"""What one diagram over time shows: curves with their units, levels, spans and marks. It draws nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Curve(NamedTuple):
    """A signal over time: its name as a reader sees it, its role (a key of the style table), (N,) s, (N,)."""

    label: str
    role: str
    time: Array
    values: Array


class Level(NamedTuple):
    """A value that means something, as a limit or the floor of a tank."""

    value: float
    label: str


class Span(NamedTuple):
    """A stretch of time [s] in which something was in force."""

    start: float
    end: float
    label: str
    kind: Literal["governor", "fallback", "force"]


class Mark(NamedTuple):
    """An instant [s] at which something happened."""

    time: float
    label: str


@dataclass(frozen=True, eq=False)
class Panel:
    """One diagram.

    Attributes
    ----------
    kind: What it is about: energy, port, tracking, torque or contact.
    choice: Which of several diagrams of that kind; they take turns in one place.
    title, unit: Of the vertical axis; every curve has this unit.
    """

    kind: str
    choice: str
    title: str
    unit: str
    curves: tuple[Curve, ...]
    levels: tuple[Level, ...] = ()
    spans: tuple[Span, ...] = ()
    marks: tuple[Mark, ...] = ()
