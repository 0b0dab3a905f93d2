"""The limit map's figure draws the map that it is given: borders, planes, the scenario's gains, what was simulated."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from passiflex.limits import Admissible, Confirmation, LimitMap
from passiflex.limits.own_margin import OwnMargin
from passiflex.limits.planes import Plane, StableRange
from passiflex.plotting.figures import save_figure
from passiflex.plotting.limits import draw_limits
from passiflex.stability.judgement import Judgement
from passiflex.stability.modes import Spectrum

RATIOS, INERTIAS = np.array([0.5, 1.0, 2.0]), np.array([0.01, 0.1, 1.0])
SCALES, DAMPINGS = np.array([0.1, 1.0, 10.0]), np.array([0.1, 1.0, 10.0, 100.0])
RATES = np.array([500.0, 1000.0, 2000.0])
LEAST = np.array([[0.02, 0.03, 0.001], [0.05, 0.1, np.inf], [0.2, np.inf, np.inf]])
BY_RATE = np.array([[0.05, 0.02, 0.01], [0.2, 0.1, 0.05], [0.4, 0.2, 0.001]])
POINTS = (
    Confirmation("impedance", 1.0, 1.0, 0.99, 0.1),
    Confirmation("shaping", 1.0, 0.085, 1.1, np.inf),
    Confirmation("shaping", 1.0, 0.115, 0.99, 0.5),
    Confirmation("rate", 2000.0, 0.04, 1.1, 0.7),
)

ANSWER = Admissible(
    Judgement(Spectrum(0.99, 1, 1, 1, 0), "law", 1000.0, 1e-3),
    None,
    1000.0,
    1e-3,
    1.0,
    0.3,
    0.1,
    1.5,
    0.1,
    300.0,
)


def found(**changes: Any) -> LimitMap:
    radius = np.geomspace(0.9, 6, 9).reshape(3, 3)
    told: dict[str, Any] = {
        "name": "test",
        "robot": "arm",
        "admissible": ANSWER,
        "shaping": Plane(RATIOS, INERTIAS, radius),
        "impedance": Plane(SCALES, DAMPINGS, np.geomspace(0.9, 6, 12).reshape(3, 4)),
        "delays": np.array([0.0, 1.0, 2.0]),
        "least_inertia": LEAST,
        "damping": StableRange(np.array([0.0, 0.2, np.nan]), np.array([5.0, np.inf, np.nan])),
        "rates": RATES,
        "least_inertia_by_rate": BY_RATE,
        "radius_by_rate": 1 - BY_RATE / 10,
        "own_shaping": np.array([[1.0, 1.0], [0.3, 0.5]]),
        "confirmations": POINTS,
        "margin": OwnMargin(0.2, ""),
    }
    return LimitMap(**told | changes)


def rigid() -> LimitMap:
    return found(
        shaping=None,
        least_inertia=None,
        least_inertia_by_rate=None,
        own_shaping=None,
        confirmations=(Confirmation("rate", 500.0, 0.98, 0.98, 0.3),),
    )


def panels(figure: Figure) -> list[Axes]:
    return [axes for axes in figure.axes if axes.get_title() not in ("", "spectral\nradius [1]")]


def line(axes: Axes, label: str) -> Line2D:
    (one,) = (line for line in axes.lines if line.get_label() == label)
    return one


def test_the_borders_are_those_of_the_map() -> None:
    """Where everything is stable they run along the bottom, where nothing is they have a gap."""
    figure = draw_limits(found())
    shaping, impedance, rates = panels(figure)
    for label, least, by_rate in zip(
        ("no delay", "1 period of delay", "2 periods of delay"), LEAST, BY_RATE, strict=True
    ):
        expected = np.where(np.isinf(least), np.nan, np.maximum(least, 0.01))
        np.testing.assert_array_equal(line(shaping, label).get_ydata(), expected)
        np.testing.assert_array_equal(line(shaping, label).get_xdata(), RATIOS)
        np.testing.assert_array_equal(line(rates, label).get_ydata(), by_rate)
        np.testing.assert_array_equal(line(rates, label).get_xdata(), RATES / 1e3)
    ends = [one.get_ydata() for one in impedance.lines[:2]]
    np.testing.assert_array_equal(ends, [[np.nan, 0.2, np.nan], [5.0, np.nan, np.nan]])
    plt.close(figure)


def test_the_own_delay_stands_out() -> None:
    figure = draw_limits(found())
    widths = [one.get_linewidth() for one in panels(figure)[0].lines[:3]]
    assert widths[1] > max(widths[0], widths[2])
    plt.close(figure)


def test_the_scenarios_gains_and_rate_are_marked() -> None:
    figure = draw_limits(found())
    shaping, impedance, rates = panels(figure)
    np.testing.assert_array_equal(line(shaping, "the scenario's gains").get_xydata(), [[1, 0.3], [1, 0.5]])
    np.testing.assert_array_equal(line(impedance, "the scenario's gains").get_xydata(), [[1, 1]])
    assert line(rates, "the scenario's rate").get_xdata() == [1.0, 1.0]
    plt.close(figure)


def test_filled_points_settled_open_ones_grew_and_what_differs_is_crossed() -> None:
    figure = draw_limits(found())
    shaping, impedance, rates = panels(figure)
    settled, grew = line(shaping, "simulation: settles"), line(shaping, "simulation: grows")
    np.testing.assert_array_equal(settled.get_xydata(), [[1, 0.115]])
    np.testing.assert_array_equal(grew.get_xydata(), [[1, 0.085]])
    assert (settled.get_markerfacecolor(), grew.get_markerfacecolor()) == ("black", "white")
    np.testing.assert_array_equal(line(impedance, "simulation: settles").get_xydata(), [[1, 1]])
    np.testing.assert_array_equal(line(rates, "differs from the theory").get_xydata(), [[2, 0.04]])
    plt.close(figure)


def test_the_legend_names_each_thing_once() -> None:
    figure = draw_limits(found())
    (legend,) = figure.legends
    names = [text.get_text() for text in legend.get_texts()]
    assert len(names) == len(set(names)) == 8
    assert figure.get_supxlabel().replace("\n", " ") == f"test, arm: {found().admissible.borders}"
    plt.close(figure)


def test_the_rigid_law_has_no_shaping_to_show() -> None:
    figure = draw_limits(rigid())
    impedance, rates = panels(figure)
    assert impedance.get_title() == "Cartesian stiffness and damping"
    for label, radii in zip(("no delay", "2 periods of delay"), rigid().radius_by_rate[[0, 2]], strict=True):
        np.testing.assert_array_equal(line(rates, label).get_ydata(), radii)
    np.testing.assert_array_equal(line(rates, "simulation: settles").get_xydata(), [[0.5, 0.98]])
    plt.close(figure)


@pytest.mark.parametrize("which", [found(confirmations=()), rigid()])
def test_it_can_be_written(which: LimitMap, tmp_path: Path) -> None:
    for path in save_figure(draw_limits(which), tmp_path / "limits"):
        assert path.stat().st_size > 10_000
