"""The figure of the uncertainty study shows what it is given."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np

from passiflex.campaigns.intervals import share_of
from passiflex.campaigns.page import Band, Ecdf
from passiflex.plotting.figures import Series
from passiflex.plotting.uncertainty import SHOWN, UncertainColumn, draw_uncertainty

TIME = np.linspace(9.0, 20.0, 50)


def column(title: str, *, falls_back: bool, band: bool = True) -> UncertainColumn:
    names = ["passive", "settled", *(["fell_back"] if falls_back else []), "at_torque_limit"]
    ecdf = Ecdf("overshoot", "1", np.array([0.1, 0.2]), np.array([0.5, 1.0]), 0.0)
    return UncertainColumn(
        title,
        10.0,
        20.0,
        tuple(share_of(name, 30, 40, 0.95) for name in names),
        Band(TIME, np.linspace(-0.01, 0.12, 5)[:, None] * np.ones(50)) if band else None,
        Series(TIME, 0.1 * (TIME > 10)),
        ecdf,
        ecdf._replace(metric="margin", unit="J"),
    )


def test_a_column_for_each_way_and_the_distributions_below() -> None:
    figure = draw_uncertainty([column("one", falls_back=True), column("two", falls_back=False)], "conditions")
    responses, shares = figure.axes[:2], figure.axes[2:4]
    assert [axes.get_title() for axes in responses] == ["one", "two"]
    assert [label.get_text() for label in shares[0].get_yticklabels()] == list(SHOWN.values())
    assert [len(axes.patches) for axes in shares] == [4, 3]
    assert [t.get_text() for t in shares[1].texts] == ["75.0%", "75.0%", "none to fall back to", "75.0%"]
    overshoot, margin = figure.axes[4:]
    assert [axes.get_xlabel() for axes in (overshoot, margin)] == ["overshoot [1]", "margin [J]"]
    assert len(overshoot.lines) == len(margin.lines) == 2
    np.testing.assert_array_equal(overshoot.lines[0].get_ydata(), [0.5, 1.0])
    plt.close(figure)


def test_a_way_of_which_no_robot_ran_has_no_band() -> None:
    figure = draw_uncertainty([column("none", falls_back=True, band=False)], "")
    assert not figure.axes[0].collections
    plt.close(figure)
