"""The figures draw the signals that they are given: each curve on its own axes, in its own style."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from passiflex.plotting.figures import CircleColumn, Series, StepColumn, draw_circle, draw_steps
from passiflex.plotting.sensitivity import CIRCLE_ROWS, LAWS, STEP_ROWS, Sweep, draw_sensitivity
from passiflex.plotting.style import LINES

TIME = np.linspace(0, 1, 5)


def signal(seed: int, *shape: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(TIME.size, *shape))


def lines(figure: Figure, place: int) -> dict[str, np.ndarray]:
    return {str(line.get_label()): np.asarray(line.get_ydata()) for line in figure.axes[place].lines}


def test_steps_show_x_y_z_of_every_curve() -> None:
    names = ("proposed", "msd", "baseline", "baseline_motor_aware", "msd_natural")
    curves = {name: Series(TIME, signal(i, 3)) for i, name in enumerate(names)}
    figure = draw_steps([StepColumn("one", curves), StepColumn("two", curves)], "conditions")
    for row, axis in enumerate("XYZ"):
        for column in range(2):
            place = 2 * row + column
            assert figure.axes[place].get_ylabel() == f"{axis} displacement [m]"
            for name in names:
                np.testing.assert_array_equal(
                    lines(figure, place)[LINES[name]["label"]], curves[name].values[:, row]
                )
    plt.close(figure)


def test_the_circle_shows_y_z_energies_and_joints() -> None:
    position, reference, joints = signal(1, 3), signal(2, 3), signal(3, 7)
    energies = {name: np.abs(signal(i)) for i, name in enumerate(("total", "robot", "tank"), start=4)}
    figure = draw_circle([CircleColumn("one", TIME, position, reference, energies, joints)], "conditions")
    for place, axis in ((0, 1), (1, 2)):
        np.testing.assert_array_equal(lines(figure, place)[LINES["proposed"]["label"]], position[:, axis])
        np.testing.assert_array_equal(lines(figure, place)[LINES["reference"]["label"]], reference[:, axis])
    for name, energy in energies.items():
        np.testing.assert_array_equal(lines(figure, 2)[LINES[name]["label"]], energy)
    for k in range(7):
        np.testing.assert_array_equal(lines(figure, 3)[f"q{k + 1}"], joints[:, k])
    plt.close(figure)


@pytest.mark.parametrize("margin", [1.5, -0.5])
def test_sensitivity_shows_every_point_also_below_zero(margin: float) -> None:
    """A violation is a negative margin; the axes must not hide it. What did not settle is a cross."""
    steps = {f"{law} {quantity}": [0.1, np.inf] for law in LAWS for quantity, _ in STEP_ROWS}
    circles = {quantity: [1.0, margin] for quantity, _ in CIRCLE_ROWS}
    figure = draw_sensitivity([Sweep("K", ["a", "b"], steps)], [Sweep("circle", ["a", "b"], circles)])
    last = figure.axes[5]
    low, high = last.get_ylim()
    assert low <= min(0, margin) < max(1.0, margin) <= high
    assert [line.get_marker() for line in figure.axes[0].lines] == ["o", "x", "s", "x"]
    plt.close(figure)
