"""The figure of the study of a load: height of the hand, level of the tank, and the weight that is read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.plotting.style import figure_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

LOOKS = (("#d55e00", "-"), ("#0072b2", "-"), ("#cc79a7", "--"))
"""Of the ways, in their order."""


class Lifted(NamedTuple):
    """One way to hold a load: height of the hand [m], tank [J] over time [s]; mass that is read [kg], and when."""

    way: str
    time: Array
    height: Array
    tank: Array
    read_at: Array
    read: Array


def draw_grip(
    lifted: Sequence[Lifted], reference: tuple[Array, Array], sag: float, mass: float, conditions: str
) -> Figure:
    """Return the figure, with the reference's height [m] over time [s], the foreseen sag [m] and the true mass [kg]."""
    import matplotlib.pyplot as plt

    with figure_style():
        figure, axes = plt.subplots(1, 3, figsize=(9.6, 3.4), sharex=True)
        height, tank, read = axes
        height.plot(reference[0], 1e3 * reference[1], color="0.6", lw=1, ls=":", label="reference")
        for one, (color, line) in zip(lifted, LOOKS, strict=False):
            height.plot(one.time, 1e3 * one.height, color=color, ls=line, lw=1.1, label=one.way)
            tank.plot(one.time, one.tank, color=color, ls=line, lw=1.1)
            read.plot(one.read_at, one.read, color=color, ls=line, lw=0.9)
        height.plot([1.2, 3], [-1e3 * sag] * 2, color="k", lw=0.8)
        height.annotate(f"m g (1/K + joints) = {1e3 * sag:.1f} mm", (1.2, -1e3 * sag), (0, -14), fontsize=7,
                        textcoords="offset points", color="0.2")  # fmt: skip
        height.set_ylim(-85, None)
        read.axhline(mass, color="k", lw=0.8)
        tank.set_ylim(0, None)
        for panel, title, unit in (
            (height, "a load that is not known sags", "height of the hand [mm]"),
            (tank, "lifting takes m g h from the tank", "tank level [J]"),
            (read, "the observer reads the weight", "mass that it reads [kg]"),
        ):
            panel.set_title(title, fontsize=9)
            panel.set_ylabel(unit)
            panel.set_xlabel("time [s]")
        figure.legend(*height.get_legend_handles_labels(), loc="outside upper center", ncols=4, fontsize=7)
        figure.supxlabel(conditions, fontsize=6, color="0.35")
        return figure
