"""A run as a figure: the diagrams of one kind, with levels, stretches of time and events."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

from passiflex.diagrams import Mark, Panel, Span, Viewed, panels
from passiflex.errors import RunFileError
from passiflex.plotting.style import ROLES, SHADE, Size, axis_label, figure_style, line, size_of

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

UNBROKEN = "\N{NO-BREAK SPACE}"
SLIDE_HEIGHT = 5.625
"""Of a slide [in]: 16 : 9."""
FURTHER = 3.0
"""A level is drawn if it is no further from the curves than so many of their ranges; else it is only named."""
SMALLER = 1.5
"""By how much the names of levels and events are smaller than the other text [pt]."""
STRIP = 0.05
"""Height of the strip that shows a force, as a share of the diagram: it may act all the time, beside other things."""
ROWS_OF_EVENTS = 3
"""Names of events that would overlap stand above each other; those that find no room are left out."""
GROUND = {"boxstyle": "square,pad=0.1", "facecolor": "white", "alpha": 0.6, "linewidth": 0}
"""Behind text that stands among curves."""
LONGEST = 60
"""Longer labels stand in several lines [characters]."""
SYMBOLS = {
    "x_d": "$x_d$",
    "τ_m": r"$\tau_m$",
    "τ_a": r"$\tau_a$",
    "T_min": r"$T_{\min}$",
}
"""Symbols of labels as they are printed."""


class Place(NamedTuple):
    """Font [pt] and line widths of the figure's size, and about how wide and high each diagram is [in]."""

    size: Size
    width: float
    height: float


def draw_run(kind: str, viewed: Viewed, others: Sequence[Viewed] = (), size: str = "double") -> Figure:
    """Return the figure of a run: energy, port, tracking, torque or contact, at a named size.

    Parameters
    ----------
    others: Runs to compare it with, where their curves can stand beside each other.
    size: column or double, of a paper; slide.

    Raises
    ------
    NameUnknownError
        For another kind or size.
    RunFileError
        If the run has none of the signals.
    """
    import matplotlib.pyplot as plt

    chosen, found = size_of(size), panels(kind, viewed, others)
    if not found:
        raise RunFileError(f"{viewed.label} has no signals to draw for {kind}")
    columns = _columns(kind, size, len(found))
    rows = math.ceil(len(found) / columns)
    labels = dict.fromkeys(name for p in found for name in _explained(p))
    across = _beside(labels, chosen)
    legend = math.ceil(len(labels) / across) * 1.45 * (chosen.font - 1) / 72 + 0.1
    height = SLIDE_HEIGHT if size == "slide" else rows * chosen.height + legend + 0.3
    place = Place(chosen, 0.85 * chosen.width / columns, 0.85 * (height - legend - 0.3) / rows)
    with figure_style(size):
        figure, grid = plt.subplots(rows, columns, figsize=(chosen.width, height), sharex=True, squeeze=False)
        handles: dict[str, Artist] = {}
        for i, axes in enumerate(grid.ravel()):
            if i >= len(found):
                axes.set_axis_off()
                continue
            handles |= _draw(axes, found[i], place)
            if i < columns:
                _name_marks(axes, found[i], place)
            if i + columns >= len(found):
                axes.set_xlabel("time [s]")
                axes.tick_params(labelbottom=True)
        order = [printed(label) for label in labels]
        figure.legend([handles[k] for k in order], order, loc="outside upper center", ncols=across)
        return figure


def _explained(panel: Panel) -> list[str]:
    """Return what the legend explains of a diagram."""
    return [curve.label for curve in panel.curves] + [span.label for span in panel.spans]


def _columns(kind: str, size: str, count: int) -> int:
    """Return how many diagrams stand beside each other."""
    if size == "slide":
        return 1 if count <= 2 else math.ceil(count / 2)
    return 2 if kind in ("torque", "contact") and size == "double" else 1


def _beside(labels: Iterable[str], size: Size) -> int:
    """Return how many entries of a legend stand beside each other."""
    entry = (
        0.52 * min(max(len(label) for label in labels), LONGEST) + 5.5
    )  # its line included, in widths of the font
    return max(1, int(size.width * 72 / (entry * (size.font - 1))))


def _draw(axes: Axes, panel: Panel, place: Place) -> dict[str, Artist]:
    """Draw a diagram, and return what the legend explains."""
    handles: dict[str, Artist] = {}
    for curve in panel.curves:
        look = line(curve.role, place.size.lines) | {"label": printed(curve.label)}
        (handles[look["label"]],) = axes.plot(curve.time, curve.values, **look)
    ends = [float(t) for c in panel.curves for t in (c.time[0], c.time[-1])]
    axes.set_xlim(min(ends), max(ends) if max(ends) > min(ends) else None)
    _levels(axes, panel, place)
    _mark(axes, panel, place)
    label = re.sub(r" (?=\d|\[)", UNBROKEN, axis_label(panel.title, panel.unit.replace(" ", UNBROKEN)))
    axes.set_ylabel(_wrapped(label, place.height, place.size.font))
    return handles | _spans(axes, panel.spans)


def _wrapped(text: str, length: float, font: float) -> str:
    """Return a text in lines of about so many inches."""
    characters = max(1, int(length * 72 / (0.55 * font)))
    return "\n".join(textwrap.wrap(text, characters, break_long_words=False)).replace(UNBROKEN, " ")


def _levels(axes: Axes, panel: Panel, place: Place) -> None:
    """Draw the levels that are near the curves, and name those that are not."""
    low, high = axes.get_ylim()
    reach = FURTHER * (high - low)
    near = sorted(v for v in panel.levels if low - reach <= v.value <= high + reach)
    far = dict.fromkeys(printed(v.label) for v in panel.levels if v not in near)
    font = place.size.font - SMALLER
    if near:
        low, high = min(low, near[0].value), max(high, near[-1].value)
        line_height = 1.6 * font / 72 / place.height * (high - low)  # height of a name
        low, high = min(low, near[0].value - line_height), max(high, near[-1].value + line_height)
        axes.set_ylim(low, high)
    for i, level in enumerate(near):
        crowded = i + 1 < len(near) and near[i + 1].value - level.value < 2 * line_height
        axes.axhline(level.value, **line("level", place.size.lines) | {"label": "_level"})
        _text(axes, printed(level.label), (1, level.value), font, "top" if crowded else "bottom", data=True)
    if far:
        text = _wrapped(f"out of view: {', '.join(far)}", place.width, font)
        _text(axes, text, (1, 0), font, "bottom", data=False)


def _text(
    axes: Axes, text: str, at: tuple[float, float], font: float, side: Literal["top", "bottom"], *, data: bool
) -> None:
    """Write at the right border, at a height of the data or of the axes."""
    written = axes.annotate(
        text,
        at,
        (-2, 2 if side == "bottom" else -2),
        xycoords=axes.get_yaxis_transform() if data else "axes fraction",
        textcoords="offset points",
        ha="right",
        va=side,
        fontsize=font,
        color=ROLES["level"].light,
        bbox=GROUND,
    )
    written.set_in_layout(False)


def _spans(axes: Axes, spans: Sequence[Span]) -> dict[str, Artist]:
    """Shade the stretches of time, forces as a strip above the diagram, and return the shades by their names."""
    shades: dict[str, Artist] = {}
    for kind, label in dict.fromkeys((s.kind, s.label) for s in spans):
        stretches = [(s.start, s.end - s.start) for s in spans if (s.kind, s.label) == (kind, label)]
        shades[printed(label)] = axes.broken_barh(
            stretches, (1, STRIP) if kind == "force" else (0, 1), transform=axes.get_xaxis_transform(),
            color=ROLES[kind].light, alpha=1 if kind == "force" else SHADE, lw=0.3, zorder=0.5,
            clip_on=kind != "force",
        )  # fmt: skip
    return shades


def _unshaded(panel: Panel) -> list[Mark]:
    """Return the events that no stretch of time shows already."""
    shaded = {(span.start, span.label) for span in panel.spans}
    return [mark for mark in panel.marks if mark not in shaded]


def _mark(axes: Axes, panel: Panel, place: Place) -> None:
    for mark in _unshaded(panel):
        axes.axvline(mark.time, **line("mark", place.size.lines) | {"label": "_mark"})


def _name_marks(axes: Axes, panel: Panel, place: Place) -> None:
    """Write what happened above the diagram, higher where names would overlap."""
    font = place.size.font - SMALLER
    start, end = axes.get_xlim()
    free = [-math.inf] * ROWS_OF_EVENTS
    for mark in _unshaded(panel):
        wide = 0.65 * font * len(mark.label) / (72 * place.width) * (end - start)
        row = next((i for i, until in enumerate(free) if mark.time - wide / 2 > until), None)
        if row is None:
            continue
        free[row] = mark.time + wide / 2
        axes.annotate(
            printed(mark.label), (mark.time, 1 + STRIP), (0, 2 + 1.2 * font * row),
            xycoords=axes.get_xaxis_transform(), textcoords="offset points",
            ha="center", va="bottom", fontsize=font, color=ROLES["level"].light,
        )  # fmt: skip


def printed(label: str) -> str:
    """Return a label for matplotlib: symbols as mathematics, everything else as the text that it is."""
    text = "\n".join(textwrap.wrap(label, LONGEST)).replace("$", r"\$")
    for symbol, formula in SYMBOLS.items():
        text = re.sub(rf"(?<!\w){symbol}(?!\w)", lambda _, f=formula: f, text)  # type: ignore[misc]
    return f" {text}" if text.startswith("_") else text  # a leading _ would hide it from the legend
