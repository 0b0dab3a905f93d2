"""The figure of the study of unknown walls: peak force over stiffness, and the share of walls within limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.campaigns.intervals import Share
from passiflex.plotting.contact import LIMITS
from passiflex.plotting.style import figure_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

LOOKS = (("#d55e00", "o"), ("#0072b2", "s"))
"""Of the limits, in their order."""


class Decade(NamedTuple):
    """Some walls, and the shares of them within each limit."""

    name: str
    below: Sequence[Share]


def draw_walls(
    stiffness: Array,
    place: Array,
    peak: Array,
    decades: Sequence[Decade],
    limits: Sequence[float],
    conditions: str,
) -> Figure:
    """Return the figure.

    Parameters
    ----------
    stiffness, place, peak: Of each wall [N/m], [m] from the hand's start, [N].
    limits: Forces [N] in the order of the shares.
    """
    import matplotlib.pyplot as plt
    from matplotlib.ticker import FixedLocator, NullLocator

    with figure_style():
        figure, (each, shares) = plt.subplots(1, 2, figsize=(9.0, 3.9), width_ratios=(1.5, 1))
        points = each.scatter(stiffness, peak, c=-100 * place, s=10, cmap="viridis", linewidths=0)
        figure.colorbar(points, ax=each, label="wall before the hand's start [cm]")
        for limit, name in LIMITS.items():
            each.axhline(limit, color="0.4", lw=0.8, ls=":")
            each.annotate(f"{limit:g} N, {name}", (0.01, limit), (0, 2), xycoords=("axes fraction", "data"),
                          textcoords="offset points", fontsize=6, color="0.3")  # fmt: skip
        each.set(xscale="log", yscale="log", xlabel="stiffness of the wall [N/m]", ylabel="peak force [N]")
        each.yaxis.set_major_locator(FixedLocator((20, 50, 100, 200, 500, 1000)))
        each.yaxis.set_major_formatter("{x:g}")
        each.yaxis.set_minor_locator(NullLocator())
        each.set_title("each wall: its stiffness decides, then the speed there", fontsize=9)
        where = np.arange(len(decades))
        for k, (limit, (color, marker)) in enumerate(zip(limits, LOOKS, strict=True)):
            mine = [decade.below[k] for decade in decades]
            away = [[s.share - s.low for s in mine], [s.high - s.share for s in mine]]
            at = where + 0.12 * (2 * k - 1)
            shares.errorbar(at, [100 * s.share for s in mine], 100 * np.array(away), color=color, marker=marker, ms=5,
                            ls="", capsize=3, label=f"below {limit:g} N")  # fmt: skip
        shares.set_xticks(where, [decade.name.replace(" N/m", "") for decade in decades])
        shares.set_xlim(-0.5, len(decades) - 0.5)
        shares.set_ylim(-3, 103)
        shares.set_xlabel("stiffness of the wall [N/m]")
        shares.set_ylabel("share of the walls [%]")
        shares.set_title("how many of them feel little", fontsize=9)
        shares.legend(fontsize=7, loc="lower left")
        figure.supxlabel(conditions, fontsize=6, color="0.35")
        return figure
