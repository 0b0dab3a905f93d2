"""The figure of the study of touch: peak force, energy given to a wall, and the force over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.plotting.style import figure_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

COLORS = ("#d55e00", "#e69f00", "#cc79a7", "#0072b2")
"""Of the laws, in their order."""
LIMITS = {280.0: "transient, ISO/TS 15066, hand", 140.0: "quasi-static"}
"""Forces [N] that a person's hand may be pressed with."""


class Approach(NamedTuple):
    """One hand that came to one wall.

    Attributes
    ----------
    law, engine: What moved it.
    stiffness, speed: Of wall and hand [N/m, m/s].
    peak, given: Force [N] and energy [J] that the wall felt.
    curve: Time and force, where they are shown.
    """

    law: str
    engine: str
    stiffness: float
    speed: float
    peak: float
    given: float
    curve: tuple[Array, Array] | None


def draw_approaches(approaches: Sequence[Approach], conditions: str) -> Figure:
    """Return the figure: a column for each speed, rows of peak force and energy; forces over time below."""
    import matplotlib.pyplot as plt

    laws, speeds = (
        list(dict.fromkeys(part)) for part in zip(*((a.law, a.speed) for a in approaches), strict=True)
    )
    first = approaches[0].engine
    with figure_style():
        figure = plt.figure(figsize=(2.6 * len(speeds), 6.6))
        grid = figure.add_gridspec(3, len(speeds))
        for j, speed in enumerate(speeds):
            for i, (name, unit) in enumerate(
                (("peak", "peak force [N]"), ("given", "energy given to the wall [J]"))
            ):
                axes = figure.add_subplot(grid[i, j])
                for law, color in zip(laws, COLORS, strict=False):
                    mine = [a for a in approaches if a.law == law and a.speed == speed]
                    for engine in dict.fromkeys(a.engine for a in mine):
                        rows = [a for a in mine if a.engine == engine]
                        style = (
                            {"ls": "-", "marker": "o", "ms": 3, "label": law}
                            if engine == first
                            else {"ls": "", "marker": "x", "ms": 6, "label": f"the same in {engine}"}
                        )
                        axes.plot(
                            [a.stiffness for a in rows],
                            [getattr(a, name) for a in rows],
                            color=color,
                            **style,
                        )
                axes.set_xscale("log")
                axes.set_yscale("log")
                if name == "peak":
                    axes.set_title(f"{speed:g} m/s", fontsize=9)
                    for force, _ in LIMITS.items():
                        axes.axhline(force, color="0.4", lw=0.8, ls=":")
                else:
                    axes.set_xlabel("stiffness of the wall [N/m]")
                if j == 0:
                    axes.set_ylabel(unit)
        axes = figure.add_subplot(grid[2, :])
        for law, color in zip(laws, COLORS, strict=False):
            for a in approaches:
                if a.law == law and a.curve is not None:
                    axes.plot(*a.curve, color=color, lw=0.9)
                    axes.set_title(f"force on a wall of {a.stiffness:.0e} N/m at {a.speed:g} m/s", fontsize=8)
        for force, name in LIMITS.items():
            axes.axhline(force, color="0.4", lw=0.8, ls=":")
            axes.annotate(f"{force:g} N, {name}", (0.01, force), xycoords=("axes fraction", "data"), fontsize=6,
                          va="bottom", color="0.3")  # fmt: skip
        axes.set_yscale("symlog", linthresh=10)
        axes.set_ylim(0, None)
        axes.set_xlim(
            min(float(a.curve[0][np.argmax(a.curve[1] > 0)]) for a in approaches if a.curve) - 0.2, None
        )
        axes.set_xlabel("time since the move began [s]")
        axes.set_ylabel("force [N]")
        handles, labels = figure.axes[0].get_legend_handles_labels()
        unique = dict(zip(labels, handles, strict=True))
        figure.legend(list(unique.values()), list(unique), loc="outside upper center", ncols=2, fontsize=7)
        figure.supxlabel(conditions, fontsize=6, color="0.35")
        return figure
