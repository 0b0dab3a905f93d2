"""The sensitivity figure: one column for each quantity that is varied, one row for each conclusion."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from passiflex.plotting.style import LINES, figure_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Sweep(NamedTuple):
    """One varied quantity: labels of its values, and each measured number at each of them."""

    name: str
    labels: list[str]
    values: dict[str, list[float]]


LAWS = {"proposed": "o", "baseline": "s"}
STEP_ROWS = (
    ("overshoot", "overshoot [1]"),
    ("settling_time", "settling time, 2 % [s]"),
    ("rms_to_msd", "rms to the MSD [1]"),
)
CIRCLE_ROWS = (
    ("tank_energy_min", "lowest tank level [J]"),
    ("total_energy_rise", "largest rise of H₂ [J]"),
    ("margin", "energy margin [J]"),
)


def draw_sensitivity(steps: Sequence[Sweep], circles: Sequence[Sweep]) -> Figure:
    """Return the figure: Fig. 1's conclusions on the left, Fig. 2's on the right."""
    import matplotlib.pyplot as plt

    columns = len(steps) + len(circles)
    with figure_style():
        figure, grid = plt.subplots(3, columns, figsize=(2.1 * columns, 5.6), sharex="col", squeeze=False)
        for j, sweep in enumerate(steps):
            for i, (quantity, label) in enumerate(STEP_ROWS):
                for law, marker in LAWS.items():
                    _points(grid[i, j], sweep.values[f"{law} {quantity}"], LINES[law], marker)
                if j == 0:
                    grid[i, j].set_ylabel(label)
        for i, (quantity, _) in enumerate(STEP_ROWS):
            _from_zero(
                grid[i, : len(steps)],
                [v for s in steps for law in LAWS for v in s.values[f"{law} {quantity}"]],
            )
        for j, sweep in enumerate(circles, start=len(steps)):
            for i, (quantity, label) in enumerate(CIRCLE_ROWS):
                _points(grid[i, j], sweep.values[quantity], LINES["proposed"], "o")
                if j == len(steps):
                    grid[i, j].set_ylabel(label)
        for i, (quantity, _) in enumerate(CIRCLE_ROWS):
            _from_zero(grid[i, len(steps) :], [v for s in circles for v in s.values[quantity]])
        for j, sweep in enumerate([*steps, *circles]):
            grid[0, j].set_title(f"{'Fig. 1' if j < len(steps) else 'Fig. 2'}: {sweep.name}", fontsize=8)
            grid[-1, j].set_xticks(range(len(sweep.labels)), sweep.labels, rotation=0, fontsize=6)
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=2)
        figure.supxlabel(
            "a cross on the upper edge: not settled before the next event", fontsize=6, color="0.35"
        )
        return figure


def _from_zero(row: Iterable[Axes], values: list[float]) -> None:
    """Give all axes of a row the same scale, with zero in it."""
    finite = [v for v in values if np.isfinite(v)]
    top, bottom = max(finite, default=1.0), min([*finite, 0.0])
    for axes in row:
        axes.set_ylim(1.1 * bottom, 1.1 * top)


def _points(axes: Axes, values: list[float], line: dict[str, object], marker: str) -> None:
    numbers = np.array(values, dtype=float)
    finite = np.isfinite(numbers)
    places = np.arange(numbers.size)
    axes.plot(
        places[finite], numbers[finite], ls="", marker=marker, ms=4, color=line["color"], label=line["label"]
    )
    if not finite.all():
        missing = places[~finite]
        axes.plot(
            missing, np.ones(missing.size), ls="", marker="x", ms=5, color=line["color"],
            transform=axes.get_xaxis_transform(), clip_on=False,
        )  # fmt: skip
    axes.margins(x=0.15)
