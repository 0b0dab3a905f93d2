"""The figure of the sampled study: what the arm does, what the tank claims, and what is really there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.plotting.style import LINES, ROLES, SHADE, figure_style

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

CLAIMED: dict[str, Any] = LINES["tank"] | {"label": "tank level T, as claimed"}
TRUE: dict[str, Any] = LINES["true"]
LARGE = 30.0
"""Energies beyond this [J] are drawn on a logarithmic scale."""


class SampledPanel(NamedTuple):
    """One task run one way: motion and its goal [m], the tank's levels [J], and when what was held back."""

    title: str
    verdict: str
    time: Array
    motion: Array
    goal: Array
    goal_name: str
    claimed: Array
    true: Array
    governed: NDArray[np.bool_]
    latched: NDArray[np.bool_]


def draw_sampled(tasks: Sequence[Sequence[SampledPanel]], conditions: str) -> Figure:
    """Return the figure: two rows for each task, motion and energy; one column for each way of running it."""
    import matplotlib.pyplot as plt

    columns = max(len(panels) for panels in tasks)
    with figure_style():
        figure, grid = plt.subplots(
            2 * len(tasks), columns, figsize=(2.4 * columns, 2.0 * 2 * len(tasks)), squeeze=False
        )
        for t, panels in enumerate(tasks):
            for j in range(columns):
                above, below = grid[2 * t, j], grid[2 * t + 1, j]
                if j >= len(panels):
                    above.set_axis_off()
                    below.set_axis_off()
                    continue
                _motion(above, panels[j])
                _energy(below, panels[j])
            grid[2 * t, 0].set_ylabel("Z displacement [m]")
            grid[2 * t + 1, 0].set_ylabel("energy [J]")
        handles: dict[str, Artist] = {}
        for axes in grid.ravel():
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                handles.setdefault(label, handle)
        figure.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=4)
        figure.supxlabel(conditions, fontsize=6, color="0.35")
        return figure


def _motion(axes: Axes, panel: SampledPanel) -> None:
    axes.plot(panel.time, panel.motion, **LINES["proposed"] | {"label": "robot", "lw": 1.2})
    axes.plot(panel.time, panel.goal, **LINES[panel.goal_name])
    axes.set_title(panel.title, fontsize=8)
    _shade(axes, panel)
    _scale(axes, panel.motion, 1.0)


def _energy(axes: Axes, panel: SampledPanel) -> None:
    axes.plot(panel.time, panel.claimed, **CLAIMED)
    axes.plot(panel.time, panel.true, **TRUE)
    axes.axhline(0.0, color="0.5", lw=0.6)
    _shade(axes, panel)
    _scale(axes, np.concatenate([panel.claimed, panel.true]), LARGE)
    axes.set_title(panel.verdict, fontsize=7)
    axes.set_xlabel("time [s]")


def _shade(axes: Axes, panel: SampledPanel) -> None:
    """Mark when the governor held the reference back, and from when on the law had fallen back."""
    for flags, color, label in (
        (panel.governed, ROLES["governor"].light, ROLES["governor"].label),
        (panel.latched, ROLES["fallback"].light, ROLES["fallback"].label),
    ):
        if flags.any():
            axes.fill_between(
                panel.time, 0, 1, where=flags, color=color, alpha=SHADE, lw=0,
                transform=axes.get_xaxis_transform(), label=label,
            )  # fmt: skip


def _scale(axes: Axes, values: Array, large: float) -> None:
    """Draw on a logarithmic scale of both signs what does not fit on a linear one, with few ticks."""
    finite = np.abs(values[np.isfinite(values)])
    if not finite.size or finite.max() <= large:
        return
    axes.set_yscale("symlog", linthresh=large / 10)
    highest = int(np.ceil(np.log10(finite.max())))
    lowest = int(np.log10(large))
    decades = range(highest, lowest - 1, -max(1, (highest - lowest) // 2))
    axes.set_yticks([sign * 10.0**d for d in decades for sign in (-1, 1)] + [0.0])
    axes.minorticks_off()
