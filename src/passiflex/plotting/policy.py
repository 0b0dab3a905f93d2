"""The figure of the study of a policy: force and energy over time, peak force and deviation over the tank."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.plotting.contact import LIMITS
from passiflex.plotting.style import figure_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

GUARDED, FREE = "#0072b2", "#d55e00"
LOOKS = (("#009e73", "^"), ("#cc79a7", "s"), ("#000000", "o"))
"""Of what policies want, in their order."""
NEAR = 5.0
"""Deviation [%] that is to be had when nothing is wrong."""


class Guarded(NamedTuple):
    """A policy and a tank at the start [J], None for none: the largest peak force [N], and deviation, of some seeds."""

    wish: str
    tank: float | None
    peak: float
    deviation: float


def draw_policy(
    guarded: Sequence[Guarded], curves: Mapping[str, tuple[Array, Array, Array]], tank: float, conditions: str
) -> Figure:
    """Return the figure.

    Parameters
    ----------
    curves: Time [s], force on the wall [N] and energy given to the links [J], with the tank and then without.
    tank: Of the first of them [J].
    """
    import matplotlib.pyplot as plt
    from matplotlib.ticker import FixedLocator, NullLocator

    with figure_style():
        figure, axes = plt.subplots(2, 2, figsize=(9.0, 5.6))
        (force, energy), (peak, off) = axes
        for (name, (time, pressed, given)), color in zip(curves.items(), (GUARDED, FREE), strict=True):
            force.plot(time, pressed, color=color, lw=0.9, label=name, zorder=3 if color == GUARDED else 2)
            energy.plot(time, given, color=color, lw=1.1, label=name)
        energy.axhline(tank, color="0.3", lw=0.8, ls="--")
        energy.annotate(f"all that a tank of {tank:g} J has", (0.99, tank), (0, 3), xycoords=("axes fraction", "data"),
                        textcoords="offset points", fontsize=7, color="0.3", ha="right")  # fmt: skip
        sizes = sorted({g.tank for g in guarded if g.tank is not None})
        for wish, (color, marker) in zip(dict.fromkeys(g.wish for g in guarded), LOOKS, strict=True):
            mine = sorted(
                (g for g in guarded if g.wish == wish and g.tank is not None), key=lambda g: g.tank or 0.0
            )
            peak.plot([g.tank for g in mine], [g.peak for g in mine], color=color, marker=marker, ms=4, lw=1)
            free = [g.peak for g in guarded if g.wish == wish and g.tank is None]
            peak.plot([2 * sizes[-1]] * len(free), free, color=color, marker=marker, ms=4, mfc="w", ls="")
            off.plot([g.tank for g in mine], [100 * g.deviation for g in mine], color=color, marker=marker, ms=4, lw=1,
                     label=wish)  # fmt: skip
        off.axhline(NEAR, color="0.3", lw=0.8, ls="--")
        off.annotate(f"{NEAR:g} %", (0.98, NEAR), (0, 3), xycoords=("axes fraction", "data"), ha="right",
                     textcoords="offset points", fontsize=7, color="0.3")  # fmt: skip
        for panel in (force, peak):
            for limit, name in LIMITS.items():
                panel.axhline(limit, color="0.5", lw=0.8, ls=":")
                panel.annotate(f"{limit:g} N, {name}", (0.99, limit), (0, 2), xycoords=("axes fraction", "data"),
                               textcoords="offset points", fontsize=6, color="0.3", ha="right")  # fmt: skip
            panel.set_ylim(0, 320)
        for panel, ticks, labels in (
            (peak, [*sizes, 2 * sizes[-1]], [*(f"{s:g}" for s in sizes), "none"]),
            (off, sizes, [f"{s:g}" for s in sizes]),
        ):
            panel.set_xscale("log")
            panel.xaxis.set_major_locator(FixedLocator(ticks))
            panel.xaxis.set_minor_locator(NullLocator())
            panel.set_xticklabels(labels)
            panel.set_xlabel("tank at the start [J]")
        for panel, title, name in (
            (force, "targets 15 cm into the wall, stiffness switched at random", "force on the wall [N]"),
            (energy, "the tank bounds the energy", "given to the links [J]"),
            (peak, "and so the force", "peak force on the wall [N]"),
            (off, "what it costs: nothing where the tank is large enough", "off the law without a tank [%]"),
        ):
            panel.set_title(title, fontsize=9)
            panel.set_ylabel(name)
        off.set_ylim(0, None)
        off.legend(fontsize=7, title="targets", title_fontsize=7)
        for panel in (force, energy):
            panel.set_xlabel("time [s]")
        energy.legend(fontsize=7, loc="center right")
        figure.supxlabel(conditions, fontsize=6, color="0.35")
        return figure
