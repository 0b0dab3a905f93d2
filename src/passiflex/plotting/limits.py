"""The limit map as a figure: what is stable over K_e and B_e, over K_x and D_x, and over the rate."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from passiflex.limits.confirmation import Confirmation
from passiflex.limits.limit_map import LimitMap
from passiflex.limits.planes import Plane
from passiflex.plotting.style import JOINTS, axis_label, figure_style
from passiflex.stability.admissible import INERTIA_RATIOS
from passiflex.stability.clock_words import delay_words

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.contour import QuadContourSet
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

LEVELS = (1.0, 1.003, 1.01, 1.03, 1.1, 1.3, 2.0, 5.0)
"""Of the radius per period; everything below the first is stable, and white."""
DASHES = ("-", "--", "-.", ":", (0, (1, 1)))
OWN: dict[str, Any] = {
    "ls": "", "marker": "*", "ms": 9, "mfc": "#ffd60a", "mec": "black", "mew": 0.7, "zorder": 6,
}  # fmt: skip
SETTLED: dict[str, Any] = {
    "ls": "", "marker": "o", "ms": 4.5, "mfc": "black", "mec": "white", "mew": 0.6, "zorder": 5, "clip_on": False,
}  # fmt: skip
GREW: dict[str, Any] = SETTLED | {"mfc": "white", "mec": "black", "mew": 1.0}
DIFFERS: dict[str, Any] = {
    "ls": "",
    "marker": "x",
    "ms": 8,
    "mec": "#d00000",
    "mew": 1.6,
    "zorder": 7,
    "clip_on": False,
}


def draw_limits(found: LimitMap) -> Figure:
    """Return the figure; the rigid law, which shapes nothing, has no first panel."""
    import matplotlib.pyplot as plt

    panels = 2 if found.shaping is None else 3
    with figure_style():
        figure, grid = plt.subplots(1, panels, figsize=(3.5 * panels + 0.6, 4.0), squeeze=False)
        impedance, over_rate = grid[0, -2:]
        if found.shaping is not None and found.least_inertia is not None:
            _shaping(grid[0, 0], found, found.shaping, found.least_inertia)
        filled = _impedance(impedance, found)
        _over_rate(over_rate, found)
        bar = figure.colorbar(filled, ax=impedance, pad=0.02, aspect=30)
        bar.set_ticks(LEVELS, labels=[f"{v:g}" for v in LEVELS])
        bar.ax.set_title(axis_label("spectral\nradius", "1"), fontsize=6)
        unique: dict[str, Artist] = {}
        for axes in grid[0]:
            handles, labels = axes.get_legend_handles_labels()
            unique |= dict(zip(labels, handles, strict=True))
        figure.legend(list(unique.values()), list(unique), loc="outside upper center", ncols=4)
        text = f"{found.name}, {found.robot}: {found.admissible.borders}"
        figure.supxlabel("\n".join(textwrap.wrap(text, 55 * panels)), fontsize=7, color="0.25")
        return figure


def _shaping(axes: Axes, found: LimitMap, plane: Plane, least: Array) -> None:
    _radius(axes, plane)
    bottom = plane.vertical[0]
    border = _gaps(least[found.own_delay], bottom)
    axes.fill_between(plane.horizontal, border, plane.vertical[-1], color="white", lw=0, zorder=1.5)
    for line, border in _by_delay(found, least, bottom):
        axes.plot(plane.horizontal, border, **line)
    if found.own_shaping is not None:
        own = np.unique(np.round(found.own_shaping, 6), axis=1)
        axes.plot(*own, **OWN, label="the scenario's gains")
    _confirmed(axes, found, "shaping")
    _logarithmic(axes, plane)
    axes.set_xlabel(axis_label("$K_e/K$", "1"))
    axes.set_ylabel(axis_label("$B_e/B$", "1"))
    axes.set_title("shaped stiffness and inertia")


def _impedance(axes: Axes, found: LimitMap) -> QuadContourSet:
    plane = found.impedance
    filled = _radius(axes, plane)
    line = _line(found, found.own_delay)
    low, high = (np.clip(border, plane.vertical[0], plane.vertical[-1]) for border in found.damping)
    axes.fill_between(plane.horizontal, low, high, color="white", lw=0, zorder=1.5)
    for border in found.damping:
        shown = np.where((border > 0) & np.isfinite(border), border, np.nan)
        axes.plot(plane.horizontal, shown, **line | {"label": None})
    axes.plot(1, 1, **OWN, label="the scenario's gains")
    _confirmed(axes, found, "impedance")
    _logarithmic(axes, plane)
    axes.set_xlabel(axis_label("$K_x$, multiple of the scenario's", "1"))
    axes.set_ylabel(axis_label("$D_x$, multiple of the scenario's", "1"))
    axes.set_title("Cartesian stiffness and damping")
    return filled


def _over_rate(axes: Axes, found: LimitMap) -> None:
    kilohertz = found.rates / 1e3
    if found.least_inertia_by_rate is not None:
        for line, border in _by_delay(found, found.least_inertia_by_rate, INERTIA_RATIOS[0]):
            axes.plot(kilohertz, border, **line)
        axes.set_ylabel(axis_label("least stable $B_e/B$ with $K_e = K$", "1"))
        axes.set_title("rate and shaped inertia")
    else:
        for i, radius in enumerate(found.radius_by_rate):
            axes.plot(kilohertz, radius, **_line(found, i))
        axes.axhline(1, color="0.4", lw=0.8)
        axes.set_ylabel(axis_label("spectral radius per period", "1"))
        axes.set_title("rate")
    axes.axvline(found.admissible.rate / 1e3, color="0.4", lw=0.8, ls=":", label="the scenario's rate")
    _confirmed(axes, found, "rate", 1e-3)
    axes.set_xscale("log")
    if found.least_inertia_by_rate is not None:
        axes.set_yscale("log")
        axes.set_ylim(INERTIA_RATIOS[0], 2)
        axes.yaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xlim(kilohertz[0], kilohertz[-1])
    axes.set_xlabel("control rate [kHz]")


def _radius(axes: Axes, plane: Plane) -> QuadContourSet:
    """Draw the radius: white where stable, darker the faster it grows."""
    import matplotlib as mpl
    from matplotlib.colors import BoundaryNorm, ListedColormap

    shades = mpl.colormaps["cividis"](np.linspace(0.95, 0.15, len(LEVELS)))
    colours = ListedColormap(shades[:-1]).with_extremes(under="white", over=shades[-1])
    return axes.contourf(
        plane.horizontal,
        plane.vertical,
        plane.radius.T,
        levels=LEVELS,
        cmap=colours,
        norm=BoundaryNorm(LEVELS, len(LEVELS) - 1),
        extend="both",
        alpha=0.75,
    )


def _by_delay(found: LimitMap, borders: Array, bottom: float) -> Iterator[tuple[dict[str, Any], Array]]:
    """Yield line style and border of each delay."""
    for i, border in enumerate(borders):
        yield _line(found, i), _gaps(border, bottom)


def _gaps(border: Array, bottom: float) -> Array:
    """Return a border to draw: a gap where nothing is stable, along the bottom where everything is."""
    return np.where(np.isfinite(border), np.maximum(border, bottom), np.nan)


def _line(found: LimitMap, i: int) -> dict[str, Any]:
    return {
        "color": JOINTS[i],
        "ls": DASHES[i],
        "lw": 2.2 if i == found.own_delay else 1.2,
        "marker": ".",
        "ms": 3,
        "label": delay_words(float(found.delays[i])),
        "zorder": 3,
    }


def _confirmed(axes: Axes, found: LimitMap, plane: str, unit: float = 1.0) -> None:
    here = [c for c in found.confirmations if c.plane == plane]
    kinds: tuple[tuple[list[Confirmation], dict[str, Any], str], ...] = (
        ([c for c in here if c.settles], SETTLED, "simulation: settles"),
        ([c for c in here if not c.settles], GREW, "simulation: grows"),
        ([c for c in here if not c.agrees], DIFFERS, "differs from the theory"),
    )
    for chosen, marker, label in kinds:
        if chosen:  # an empty line that is not clipped would take part in the layout
            places = [unit * c.horizontal for c in chosen], [c.vertical for c in chosen]
            axes.plot(*places, **marker, label=label)


def _logarithmic(axes: Axes, plane: Plane) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xlim(plane.horizontal[0], plane.horizontal[-1])
    axes.set_ylim(plane.vertical[0], plane.vertical[-1])
