"""The paper's figures from signals: these functions draw, and compute nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.plotting.files import save_as as save_as
from passiflex.plotting.files import save_figure as save_figure
from passiflex.plotting.style import JOINT_ROLES, LINES, SIZES, figure_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
AXES = "XYZ"


class Series(NamedTuple):
    """A signal over time."""

    time: Array
    values: Array


class StepColumn(NamedTuple):
    """One column of Figs. 1 and 3: curves (N, 3) in m by the names of `LINES`."""

    title: str
    curves: Mapping[str, Series]


class CircleColumn(NamedTuple):
    """One column of Fig. 2: positions and reference (N, 3) m; energies (N,) J; joints (N, n) rad."""

    title: str
    time: Array
    position: Array
    reference: Array
    energies: Mapping[str, Array]
    joints: Array


def draw_steps(columns: Sequence[StepColumn], conditions: str) -> Figure:
    """Return Fig. 1 or Fig. 3: X, Y, Z of the end effector, one column for each gravity choice."""
    import matplotlib.pyplot as plt

    with figure_style():
        figure, grid = plt.subplots(
            3,
            len(columns),
            figsize=(SIZES["double"].width / 2 * len(columns), 5.4),
            sharex=True,
            squeeze=False,
        )
        for j, column in enumerate(columns):
            for i in range(3):
                axes = grid[i, j]
                for name, curve in column.curves.items():
                    axes.plot(curve.time, curve.values[:, i], **LINES[name])
                axes.set_ylabel(f"{AXES[i]} displacement [m]")
                _roomy(axes)
            grid[0, j].set_title(column.title)
            grid[-1, j].set_xlabel("time [s]")
        _finish(figure, grid[0, 0], conditions)
        return figure


def draw_circle(columns: Sequence[CircleColumn], conditions: str) -> Figure:
    """Return Fig. 2: Y and Z with their reference, energies, joint positions."""
    import matplotlib.pyplot as plt

    with figure_style():
        figure, grid = plt.subplots(
            4,
            len(columns),
            figsize=(SIZES["double"].width / 2 * len(columns), 6.8),
            sharex=True,
            squeeze=False,
        )
        for j, c in enumerate(columns):
            for row, axis in ((0, 1), (1, 2)):
                grid[row, j].plot(c.time, c.position[:, axis], **LINES["proposed"])
                grid[row, j].plot(c.time, c.reference[:, axis], **LINES["reference"])
                grid[row, j].set_ylabel(f"{AXES[axis]} [m]")
            for name, energy in c.energies.items():
                grid[2, j].plot(c.time, energy, **LINES[name])
            grid[2, j].set_ylabel("energy [J]")
            grid[2, j].legend(ncols=3, loc="lower center", fontsize=6, columnspacing=1.0)
            grid[2, j].set_ylim(
                -0.25 * float(np.max(c.energies["total"])), 1.1 * float(np.max(c.energies["total"]))
            )
            for k in range(c.joints.shape[1]):
                look = LINES[JOINT_ROLES[k % len(JOINT_ROLES)]] | {"label": f"q{k + 1}"}
                grid[3, j].plot(c.time, c.joints[:, k], **look)
            grid[3, j].set_ylabel("joint position [rad]")
            grid[3, j].legend(ncols=7, loc="lower center", fontsize=6, handlelength=1.7, columnspacing=0.6)
            _roomy(grid[3, j], below=0.2)
            grid[0, j].set_title(c.title)
            grid[-1, j].set_xlabel("time [s]")
        _finish(figure, grid[0, 0], conditions)
        return figure


def _roomy(axes: Axes, below: float = 0.05) -> None:
    low, high = axes.get_ylim()
    axes.set_ylim(low - below * (high - low), high)


def _finish(figure: Figure, first: Axes, conditions: str) -> None:
    handles, labels = first.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    figure.supxlabel(conditions, fontsize=6, color="0.35")
