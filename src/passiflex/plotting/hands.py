"""The figure of the study of a hand in the way: force over speed, and over the tank's energy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.plotting.contact import LIMITS
from passiflex.plotting.style import figure_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

LOOKS = (("#009e73", "^"), ("#0072b2", "o"), ("#d55e00", "s"))
"""Of the walls, in their order."""


class Pressed(NamedTuple):
    """What a wall felt [N], over the speed [m/s] of the hand or the energy [J] above the tank's floor."""

    wall: str
    over: float
    peak: float


def draw_hands(
    approached: Sequence[Pressed],
    impedance: Mapping[str, float],
    attacked: Sequence[Pressed],
    bound: Array,
    speed: float,
    conditions: str,
) -> Figure:
    """Return the figure.

    Parameters
    ----------
    approached: Peak forces over the speed of the hand.
    impedance: √(kΛ) of each wall [N s/m].
    attacked: Worst peak forces over the tank's energy, of one wall.
    bound: Energies [J] and the forces [N] that they cannot exceed on it, (2, N).
    speed: That public tests allow [m/s].
    """
    import matplotlib.pyplot as plt
    from matplotlib.ticker import FixedLocator, NullLocator

    with figure_style():
        figure, (over_speed, over_tank) = plt.subplots(1, 2, figsize=(9.0, 3.9))
        for wall, (color, marker) in zip(dict.fromkeys(p.wall for p in approached), LOOKS, strict=True):
            mine = [p for p in approached if p.wall == wall]
            speeds = np.array([p.over for p in mine])
            over_speed.plot(
                speeds, [p.peak for p in mine], color=color, marker=marker, ms=4, lw=1, label=wall
            )
            over_speed.plot(speeds, speeds * impedance[wall], color=color, lw=0.8, ls=":")
        over_speed.plot([], [], color="0.3", lw=0.8, ls=":", label="v √(kΛ)")
        over_speed.axvline(speed, color="0.4", lw=0.8, ls="--")
        over_speed.annotate(f"{speed:g} m/s", (speed, 0.02), (3, 0), xycoords=("data", "axes fraction"),
                            textcoords="offset points", fontsize=7, color="0.3")  # fmt: skip
        over_tank.plot(*bound, color="k", lw=0.8, label="√(2 k E)")
        over_tank.plot([p.over for p in attacked], [p.peak for p in attacked], color=LOOKS[1][0], marker="o", ms=5,
                       ls="", label="worst of four references")  # fmt: skip
        for panel, title, x in (
            (over_speed, "how fast may it come?", "speed of the hand at the wall [m/s]"),
            (
                over_tank,
                f"or: how much energy may it have? ({attacked[0].wall})",
                "tank above its floor, E [J]",
            ),
        ):
            _limits(panel)
            panel.set(xscale="log", yscale="log", xlabel=x, ylabel="peak force [N]")
            for axis, ticks in (
                (panel.xaxis, (0.02, 0.05, 0.1, 0.2, 0.5, 1)),
                (panel.yaxis, (20, 50, 100, 200, 500, 1000)),
            ):
                axis.set_major_locator(FixedLocator(ticks))
                axis.set_major_formatter("{x:g}")
                axis.set_minor_locator(NullLocator())
            panel.set_title(title, fontsize=9)
            panel.legend(fontsize=7, loc="upper left" if panel is over_speed else "lower right")
        over_speed.set_ylim(25, None)
        figure.supxlabel(conditions, fontsize=6, color="0.35")
        return figure


def _limits(axes: Axes) -> None:
    for limit, name in LIMITS.items():
        axes.axhline(limit, color="0.5", lw=0.8, ls=":")
        axes.annotate(f"{limit:g} N, {name}", (0.01, limit), (0, 2), xycoords=("axes fraction", "data"),
                      textcoords="offset points", fontsize=6, color="0.3")  # fmt: skip
