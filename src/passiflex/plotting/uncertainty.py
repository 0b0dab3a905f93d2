"""The figure of the uncertainty study: bands of the response, shares, and how overshoot and margin spread."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from passiflex.campaigns.intervals import Share
from passiflex.campaigns.page import Band, Ecdf
from passiflex.plotting.campaign import draw_band
from passiflex.plotting.figures import Series
from passiflex.plotting.style import BLUE, JOINTS, LINES, axis_label, figure_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLES = ("-", "--", "-.", ":", "-", "--", "-.")
SHOWN = {
    "passive": "passive",
    "settled": "settled (2 %)",
    "fell_back": "fell back",
    "at_torque_limit": "torque at limit",
}


class UncertainColumn(NamedTuple):
    """One way of control: its response between two times [s], shares, and two distributions."""

    title: str
    begin: float
    end: float
    shares: tuple[Share, ...]
    band: Band | None
    ideal: Series
    overshoot: Ecdf
    margin: Ecdf


def draw_uncertainty(columns: Sequence[UncertainColumn], conditions: str) -> Figure:
    """Return the figure: a column of band and shares for each way, and the distributions of all ways below."""
    import matplotlib.pyplot as plt

    with figure_style():
        figure = plt.figure(figsize=(2.15 * len(columns), 7.2))
        above, below = figure.subfigures(2, 1, height_ratios=(1.5, 1.0)).tolist()  # type: ignore[union-attr]
        grid = above.subplots(2, len(columns), squeeze=False, height_ratios=(1.6, 1.2))
        for j, column in enumerate(columns):
            _response(grid[0, j], column)
            _shares(grid[1, j], column.shares, named=j == 0)
            grid[0, j].sharey(grid[0, 0])
            grid[0, j].tick_params(labelleft=j == 0)
        grid[0, 0].set_ylabel("Z displacement [m]")
        grid[0, 0].legend(loc="lower right")
        low = min((c.band.quantiles[0].min() for c in columns if c.band is not None), default=0.0)
        high = max((c.band.quantiles[-1].max() for c in columns if c.band is not None), default=1.0)
        grid[0, 0].set_ylim(max(low, -0.04) - 0.005, min(high, 0.15) + 0.005)
        left, right = below.subplots(1, 2)
        for axes, metric, label in (
            (left, "overshoot", axis_label("overshoot", "1")),
            (right, "margin", axis_label("margin", "J")),
        ):
            for j, column in enumerate(columns):
                ecdf: Ecdf = getattr(column, metric)
                style = {"color": JOINTS[j], "ls": STYLES[j], "lw": 1.3}
                axes.step(ecdf.values, ecdf.shares, where="post", label=column.title, **style)
            axes.set_xlabel(label)
            axes.set_ylim(0, 1.02)
        left.set_ylabel(axis_label("share of robots at or below", "1"))
        right.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        figure.supxlabel(conditions, fontsize=6.5, color="0.35")
        return figure


def _response(axes: Axes, column: UncertainColumn) -> None:
    axes.set_title(column.title.replace(", ", ",\n", 1), fontsize=8)
    if column.band is not None:
        draw_band(axes, column.band)
    axes.plot(column.ideal.time, column.ideal.values, **LINES["msd"] | {"lw": 0.9})
    axes.set_xlim(column.begin - 0.2, min(column.end, column.begin + 5.0))
    axes.set_xlabel("time [s]")


def _shares(axes: Axes, shares: Sequence[Share], *, named: bool) -> None:
    by_name = {share.name: share for share in shares}
    for row, name in enumerate(SHOWN):
        share = by_name.get(name)
        if share is not None:
            axes.barh(row, share.share, height=0.55, color=BLUE, alpha=0.45)
            axes.plot([share.low, share.high], [row, row], color="black", lw=1.2)
        text = "none to fall back to" if share is None else f"{share.share:.1%}"
        axes.text(0.98, row - 0.3, text, ha="right", va="bottom", fontsize=6.5)
    axes.set_yticks(range(len(SHOWN)), SHOWN.values() if named else [""] * len(SHOWN))
    axes.set_ylim(len(SHOWN) - 0.5, -0.75)
    axes.set_xlim(0, 1)
    axes.set_xticks([0, 0.5, 1], ["0", "50", "100"])
    axes.set_xlabel(axis_label("share of the robots", "%"))
