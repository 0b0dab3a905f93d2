"""The figure of the study of polishing: tank, way, press and lag, and what is left when the tank is empty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from passiflex.plotting.style import figure_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

COLORS = ("#0072b2", "#009e73", "#d55e00")
"""Of the forces."""
LINES, MARKERS = ("-", "--", ":"), ("o", "s", "^")
"""Of the frictions."""


class Glided(Protocol):
    """What is drawn of a measurement and of a closed form alike."""

    @property
    def force(self) -> float:
        """Return the press [N]."""

    @property
    def lag(self) -> float:
        """Return the lag [m]."""


class Measured(Glided, Protocol):
    """What is drawn of a measurement besides."""

    @property
    def waviness(self) -> float:
        """Return the deviation of the press [N]."""

    @property
    def way(self) -> float:
        """Return how far the hand went [m]."""


class Polished(NamedTuple):
    """One press on one dome: wanted [N], friction, tank [J] over time [s], what was measured and what was foreseen."""

    wanted: float
    friction: float
    time: Array
    tank: Array
    found: Measured
    foreseen: Glided


def draw_polishing(
    polished: Sequence[Polished], pressed: Mapping[str, tuple[Array, Array]], paid: Array, conditions: str
) -> Figure:
    """Return the figure.

    Parameters
    ----------
    pressed: Force along the normal [N] over time [s], by how the hand is pressed.
    paid: Friction's share of the press [N] and the way [m] that the tank pays for it, (2, N).
    """
    import matplotlib.pyplot as plt
    from matplotlib.ticker import FixedLocator, NullLocator

    forces, frictions = (
        sorted(set(part)) for part in zip(*((p.wanted, p.friction) for p in polished), strict=True)
    )
    color = dict(zip(forces, COLORS, strict=False))
    line, marker = (dict(zip(frictions, looks, strict=False)) for looks in (LINES, MARKERS))
    with figure_style():
        figure, axes = plt.subplots(2, 3, figsize=(9.6, 5.4))
        level, way, after, press, lag, words = axes.flat
        for p in polished:
            level.plot(p.time, p.tank, color=color[p.wanted], ls=line[p.friction], lw=1)
            way.plot(p.friction * p.found.force, p.found.way, marker[p.friction], color=color[p.wanted], ms=5)
            here = p.friction + 0.012 * (forces.index(p.wanted) - 1)
            press.errorbar(
                here,
                p.found.force,
                p.found.waviness,
                fmt=marker[p.friction],
                color=color[p.wanted],
                ms=4,
                capsize=2,
            )
            lag.plot(here, 1e3 * p.found.lag, marker[p.friction], color=color[p.wanted], ms=4)
            for panel, value in ((press, p.foreseen.force), (lag, 1e3 * p.foreseen.lag)):
                panel.plot(here, value, "k_", ms=11)
        for force in forces:
            press.axhline(force, color="0.6", lw=0.8, ls=":")
        way.plot(*paid, color="k", lw=0.8)
        _labels(level, "friction empties the tank", "time [s]", "tank level [J]")
        level.set_ylim(0, None)
        _labels(way, "5 J pay for 4.9 J / (μ f) of way", "friction μ f [N]", "way along the dome [m]")
        for scale, axis, ticks in (("x", way.xaxis, (1, 2, 5, 10)), ("y", way.yaxis, (0.5, 1, 2, 5))):
            way.set(**{f"{scale}scale": "log"})
            axis.set_major_locator(FixedLocator(ticks))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_locator(NullLocator())
        for panel, name in ((press, "press along the normal [N]"), (lag, "lag behind the reference [mm]")):
            _labels(panel, "", "friction coefficient μ", name)
            panel.set_xticks(frictions)
            panel.set_xlim(frictions[0] - 0.1, frictions[-1] + 0.1)
        press.set_title("a little less than wanted", fontsize=9)
        lag.set_title("friction and damping hold the hand back", fontsize=9)
        lag.set_ylim(0, None)
        for (name, (time, force)), look in zip(pressed.items(), ("k", "#cc79a7"), strict=True):
            after.plot(time, force, color=look, lw=1, label=name)
        _labels(after, "the tank is empty: a depth presses on", "time [s]", "press [N]")
        after.legend(fontsize=7, loc="lower left")
        _key(words, color, line, marker)
        figure.supxlabel(conditions, fontsize=6, color="0.35")
        return figure


def _labels(axes: Axes, title: str, x: str, y: str) -> None:
    axes.set_title(title, fontsize=9)
    axes.set_xlabel(x)
    axes.set_ylabel(y)


def _key(
    axes: Axes, color: Mapping[float, str], line: Mapping[float, str], marker: Mapping[float, str]
) -> None:
    """Write what the looks mean in place of a panel."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=c, lw=2, label=f"wanted press {force:g} N") for force, c in color.items()]
    handles += [
        Line2D([], [], color="0.3", ls=line[mu], marker=marker[mu], ms=4, label=f"friction μ = {mu:g}")
        for mu in line
    ]
    handles.append(Line2D([], [], color="k", ls="", marker="_", ms=11, label="closed form"))
    axes.axis("off")
    axes.legend(handles=handles, loc="center", fontsize=8, frameon=False)
