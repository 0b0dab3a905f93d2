"""The diagrams of a page: their curves thinned, on as few time axes as possible, with their styles."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.diagrams import Mark, Panel, Span
from passiflex.reports.arrays import Arrays
from passiflex.reports.thinning import CLOSE, Bins

Array = NDArray[np.float64]

NOW = 1e-9
"""Two instants closer than this are one [s]."""


class Diagrams:
    """Turns panels into what a page says of them.

    Parameters
    ----------
    main: Instants [s] of the run that the page is about.
    moments: Instants [s] near which long series show every row.
    """

    def __init__(self, main: Array, arrays: Arrays, moments: Sequence[float] = ()):
        self._main, self._arrays, self._moments = main, arrays, sorted(set(moments))
        self._thinned: dict[int, float] = {}
        self.times: list[dict[str, Any]] = []

    def header(self, panel: Panel) -> dict[str, Any]:
        """Return a panel, with the places of its curves."""
        return {
            "kind": panel.kind,
            "choice": panel.choice,
            "title": panel.title,
            "unit": panel.unit,
            "curves": [
                {"label": curve.label, "role": curve.role} | self._series(curve.time, curve.values)
                for curve in panel.curves
            ],
            "levels": [
                {"value": float(level.value), "label": level.label}
                for level in panel.levels
                if np.isfinite(level.value)
            ],
            "spans": spans_header(panel.spans),
            "marks": marks_header(panel.marks),
        }

    @property
    def thinning(self) -> str:
        """Return what the curves so far leave out, in words; empty if nothing."""
        if not self._thinned:
            return ""
        width = max(self._thinned)
        interval = self._thinned[width]
        said = (
            f"each plotted point is the least or the greatest of {width} rows "
            f"({width * interval * 1000:.4g} ms): no peak is lost, but an oscillation may look like a band"
        )
        if not self._moments:
            return said
        moments = " and ".join(dict.fromkeys(f"{moment:.4g} s" for moment in self._moments))
        return f"{said}; within {CLOSE * interval:.3g} s of {moments} every row is there"

    def _series(self, time: Array, values: Array) -> dict[str, Any]:
        """Return index of the times and place of the values; a run that ended early is followed by a gap."""
        count, main = time.size, self._main
        if count <= main.size and np.allclose(time, main[:count], rtol=0, atol=NOW):
            time, values = main, np.append(values, np.full(main.size - count, np.nan))
        bins = Bins.of(time.size, [int(row) for row in np.searchsorted(time, self._moments)])
        if bins.width > 1:
            self._thinned[bins.width] = float(time[-1] - time[0]) / (time.size - 1)
        place = self._arrays.add(bins.times(time), "f64")
        if place not in self.times:
            self.times.append(place)
        return {"time": self.times.index(place), "values": self._arrays.add(bins.values(values))}


def spans_header(spans: Iterable[Span]) -> list[dict[str, Any]]:
    """Return spans as a page says them."""
    return [{"start": float(s.start), "end": float(s.end), "label": s.label, "kind": s.kind} for s in spans]


def marks_header(marks: Iterable[Mark]) -> list[dict[str, Any]]:
    """Return marks as a page says them."""
    return [{"time": float(m.time), "label": m.label} for m in marks]
