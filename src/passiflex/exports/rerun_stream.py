"""Columns of numbers into a Rerun recording: names, places and the timeline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from passiflex.robots.bodies import Array

TIMELINE = "time"

Colour = tuple[int, int, int]
BLUE: Colour = (0, 114, 178)
ORANGE: Colour = (230, 159, 0)
GREEN: Colour = (0, 158, 115)
PINK: Colour = (204, 121, 167)
RED: Colour = (213, 94, 0)
SKY: Colour = (86, 180, 233)
GREY: Colour = (128, 128, 128)
PALETTE = (BLUE, RED, GREEN, PINK, ORANGE, SKY)
"""Of Okabe and Ito, told apart by the colour-blind. A viewer may be light or dark, so neither black nor white."""


@dataclass(frozen=True, eq=False)
class Stream:
    """A Rerun recording that is being written.

    Attributes
    ----------
    rr: The module rerun.
    recording: Its recording stream.
    """

    rr: Any
    recording: Any

    def path(self, *place: str) -> str:
        """Return the path of an entity; names may hold any character."""
        return str(self.rr.new_entity_path(list(place)))

    def constant(self, place: Sequence[str], value: Any) -> None:
        """Log what holds at all times."""
        self.recording.log(self.path(*place), value, static=True)

    def columns(self, place: Sequence[str], time: ArrayLike, columns: Any) -> None:
        """Send columns with one entry per instant [s], to the nearest nanosecond."""
        nanoseconds = np.rint(np.asarray(time) * 1e9).astype("timedelta64[ns]")
        index = self.rr.TimeColumn(TIMELINE, duration=nanoseconds)
        self.recording.send_columns(self.path(*place), indexes=[index], columns=columns)

    def series(
        self,
        place: Sequence[str],
        names: Sequence[str],
        time: ArrayLike,
        values: Array,
        colours: Sequence[Colour] = PALETTE,
    ) -> None:
        """Send the curves (N, k) of one place; the colours are used in turn."""
        looks = [colours[i % len(colours)] for i in range(len(names))]
        self.constant(place, self.rr.SeriesLines(names=list(names), colors=looks))
        rows = self.rr.Scalars.columns(scalars=np.ravel(values))
        if len(names) != 1:
            rows = rows.partition(lengths=[len(names)] * len(values))
        self.columns(place, time, rows)
