"""Reads a report as its viewer does: the header, the arrays behind it, and every element of the document."""

from __future__ import annotations

import base64
import gzip
import json
from dataclasses import dataclass
from functools import lru_cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from passiflex.reports.header import content
from passiflex.reports.page import page_text
from passiflex.reports.viewer import Viewer
from passiflex.simulation import Run, parse_scenario, simulate
from worlds import planar_text, ran

VIEWER = Viewer("window.viewer = 1;", "body { margin: 0 }", "a licence")
"""A bundle that shows nothing."""
PLANAR = planar_text(
    reference=[{"at": 0.2, "kind": "step", "by": [0, 0, 0.05]}],
    forces=[{"from": 0.5, "to": 0.6, "force": [1, 0, 0]}],
    duration=1,
)
TURRET = Path(__file__).parents[1] / "campaigns" / "turret.yaml"
RIGID = {
    "name": "baseline",
    "robot": str(TURRET),
    "posture": [0.3, 0.5, 0.8],
    "law": {
        "type": "rigid",
        "task": "position",
        "gravity": "robot",
        "stiffness": {"translation": 60},
        "damping": {"translation": 20},
        "target_inertia": {"damping_ratio": 0.7},
    },
}


@lru_cache
def continuous() -> Run:
    """Return a run of the planar arm in continuous time, 101 rows."""
    return simulate(parse_scenario(PLANAR))


@lru_cache
def baseline() -> Run:
    """Return a run of an arm with three joints under the rigid law, which has no tank, 101 rows."""
    return simulate(parse_scenario(yaml.safe_dump(yaml.safe_load(PLANAR) | RIGID)))


@lru_cache
def sampled() -> Run:
    """Return a run at 1 kHz, 601 rows."""
    return ran()


def changed(run: Run, *, without: tuple[str, ...] = (), **attributes: Any) -> Run:
    """Return the run without some signals, and with other attributes."""
    return Run(run.data.drop_vars(without).assign_attrs(attributes))


def with_nan(run: Run, name: str, rows: slice) -> Run:
    """Return the run with a gap in one signal."""
    data = run.data.copy(deep=True)
    data[name][rows] = np.nan
    return Run(data)


class Document(HTMLParser):
    """Collects the elements of a document, and the text inside each of those that end."""

    def __init__(self, text: str):
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[str, str | None, str]] = []
        self._open: list[tuple[str, str | None]] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self._open.append((tag, dict(attrs).get("id")))

    def handle_data(self, data: str) -> None:
        if self._open and data.strip():
            self.texts.append((*self._open[-1], data))

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop()[0] != tag:
            pass

    def text(self, tag: str, ident: str | None = None) -> str:
        """Return the whole text of one element."""
        return "".join(data for t, i, data in self.texts if (t, i) == (tag, ident))


@dataclass
class Page:
    """A report that was read."""

    document: Document
    header: dict[str, Any]
    blob: bytes

    @classmethod
    def of(cls, text: str) -> Page:
        document = Document(text)
        packed = base64.b64decode(document.text("script", "passiflex-data"), validate=True)
        return cls(document, json.loads(document.text("script", "passiflex-report")), gzip.decompress(packed))

    def array(self, place: dict[str, Any]) -> np.ndarray:
        """Return the numbers of one place."""
        return unpacked(self.blob, place)

    def panel(self, kind: str, choice: str) -> dict[str, Any]:
        """Return the one panel of that name."""
        (found,) = [p for p in self.header["panels"] if (p["kind"], p["choice"]) == (kind, choice)]
        return found

    def curve(self, kind: str, choice: str, role: str) -> tuple[np.ndarray, np.ndarray]:
        """Return instants and values of the one curve of that role."""
        (found,) = [c for c in self.panel(kind, choice)["curves"] if c["role"] == role]
        return self.array(self.header["times"][found["time"]]), self.array(found["values"])


def unpacked(blob: bytes, place: dict[str, Any]) -> np.ndarray:
    """Return an array as the viewer reads it: unshuffled, little-endian, in C order."""
    size = {"f32": 4, "f64": 8}[place["dtype"]]
    count = int(np.prod(place["shape"]))
    part = np.frombuffer(blob, np.uint8, count * size, place["offset"]).reshape(size, count)
    numbers = np.frombuffer(np.ascontiguousarray(part.T).tobytes(), f"<f{size}")
    return numbers.reshape(place["shape"])


def page(run: Run, others: tuple = (), notices: tuple[str, ...] = ()) -> Page:
    """Return the page on a run as its reader finds it."""
    header, data = content(run, others, notices)
    return Page.of(page_text(header["title"], header, data, VIEWER))
