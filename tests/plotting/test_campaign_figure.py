"""The page of a campaign draws the numbers that it is given: shares, distributions, band, bars, points."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.colors import same_color, to_hex
from matplotlib.figure import Figure

from campaigns.small_campaigns import STIFFNESS, campaign, choice, uniform
from passiflex.campaigns.evaluate import evaluate_samples
from passiflex.campaigns.intervals import Share
from passiflex.campaigns.page import Band, Bars, Ecdf, Page, Scatter, page
from passiflex.campaigns.statistics import statistics
from passiflex.chunks.tables import table_of
from passiflex.plotting.campaign import A4, DIFFERENT, LESS, MORE, VERDICTS, draw_campaign
from passiflex.plotting.figures import Series, save_figure

VALUES, SHARES = np.array([1.0, 2.0, 4.0]), np.array([0.25, 0.5, 0.75])
TIME = np.array([0.0, 0.1, 0.2])
QUANTILES = np.arange(15.0).reshape(5, 3)
ROOTS = np.array([0.9, 0.2, np.nan])
SIGNED = np.array([True, True, False])
VERDICT_OF = np.array(["passive", "violated", "passive", "inconclusive"])


def made(**changes: Any) -> Page:
    told: dict[str, Any] = {
        "title": "some campaign",
        "conditions": "under these conditions",
        "shares": (Share("passive", 3, 4, 0.75, 0.2, 0.99), Share("fell_back", 0, 4, 0.0, 0.0, 0.6)),
        "distributions": (
            Ecdf("settling_time", "s", VALUES, SHARES, 0.25),
            Ecdf("overshoot", "1", VALUES, SHARES, 0),
        ),
        "band": Band(TIME, QUANTILES),
        "columns": ("delay", "joint stiffness, joint 2", "inner loop"),
        "bars": (
            Bars("margin", np.array([-0.8, 0.1, 0.5]), SIGNED, np.array([True, False, True]), ROOTS),
            Bars("overshoot", np.array([0.3, np.nan, 0.1]), SIGNED, np.array([True, False, False]), np.full(3, np.nan)),
        ),
        "chance": 0.05,
        "scatter": Scatter("delay [s]", (), np.arange(4.0), "margin", np.arange(4.0) ** 2, VERDICT_OF),
    }  # fmt: skip
    return Page(**told | changes)


EMPTY: dict[str, Any] = {
    "shares": (), "distributions": (), "band": None, "columns": (), "bars": (), "scatter": None
}  # fmt: skip


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    yield
    plt.close("all")


def axes_of(figure: Figure, title: str) -> Axes:
    return next(axes for axes in figure.axes if axes.get_title() == title)


def texts(axes: Axes) -> list[str]:
    return [text.get_text() for text in axes.texts]


def test_the_page_is_a4_and_says_what_it_is_of() -> None:
    figure = draw_campaign(made())
    assert tuple(figure.get_size_inches()) == A4
    assert figure.get_suptitle() == "some campaign"
    assert figure.subfigs[-1].get_supxlabel() == "under these conditions"
    assert "p ≤ 0.05 after Holm" in figure.subfigs[2].get_supxlabel()


def test_shares_stand_in_their_intervals() -> None:
    axes = axes_of(draw_campaign(made()), "shares, and their intervals")
    intervals, points = axes.lines[::2], axes.lines[1::2]
    assert [list(map(float, line.get_xdata())) for line in intervals] == [[0.2, 0.99], [0.0, 0.6]]
    assert [point.get_xdata()[0] for point in points] == [0.75, 0.0]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["passive", "fell back"]
    assert texts(axes) == ["3 of 4", "0 of 4"]


def test_distributions_are_drawn_as_they_are_and_say_what_is_missing() -> None:
    figure = draw_campaign(made())
    settling, overshoot = figure.subfigs[1].axes
    np.testing.assert_array_equal(settling.lines[0].get_xydata(), np.column_stack([VALUES, SHARES]))
    assert settling.get_xlabel() == "settling time [s]\n25 % not finite"
    assert overshoot.get_xlabel() == "overshoot [1]"


def test_the_band_lies_between_its_quantiles_with_the_callers_lines() -> None:
    goal = Series(TIME, np.array([0.0, 0.1, 0.1]))
    axes = axes_of(draw_campaign(made(), {"reference": goal}), "responses")
    median, reference = axes.lines
    np.testing.assert_array_equal(median.get_ydata(), QUANTILES[2])
    np.testing.assert_array_equal(reference.get_ydata(), goal.values)
    for band, (low, high) in zip(axes.collections, ((0, 4), (1, 3)), strict=True):
        corners = band.get_paths()[0].vertices
        for i, t in enumerate(TIME):
            at = np.asarray(corners)[np.asarray(corners)[:, 0] == t, 1]
            assert (at.min(), at.max()) == (QUANTILES[low, i], QUANTILES[high, i])


def test_bars_have_length_sign_and_whether_it_is_chance() -> None:
    margin, overshoot = draw_campaign(made()).subfigs[2].axes
    assert [bar.get_width() for bar in margin.patches] == [0.8, 0.1, 0.5]  # type: ignore[attr-defined]
    for bar, color, filled in zip(margin.patches, (LESS, MORE, DIFFERENT), (True, False, True), strict=True):
        assert same_color(bar.get_edgecolor(), color)
        assert same_color(bar.get_facecolor(), color if filled else "white")
    assert texts(margin) == ["−", "+", ""]
    assert texts(overshoot) == ["+", "constant", ""]
    assert [label.get_text() for label in margin.get_yticklabels()] == list(made().columns)


def test_points_have_the_colour_and_the_shape_of_their_verdict() -> None:
    figure = draw_campaign(made())
    axes = axes_of(figure, "the most important parameter")
    assert len({style["color"] for style in VERDICTS.values()}) == 3
    assert len({style["marker"] for style in VERDICTS.values()}) == 3
    clouds = [c for c in axes.collections if isinstance(c, PathCollection)]
    for cloud, (verdict, style) in zip(clouds, VERDICTS.items(), strict=True):
        chosen = verdict == VERDICT_OF
        points = np.column_stack([np.arange(4.0), np.arange(4.0) ** 2])[chosen]
        np.testing.assert_array_equal(cloud.get_offsets(), points)
        assert to_hex(cloud.get_facecolor()[0]) == style["color"]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("delay [s]", "margin [J]")


def test_words_are_written_below_their_points() -> None:
    scatter = Scatter("loop", ("plain", "matched"), np.zeros(4), "margin", np.ones(4), VERDICT_OF)
    axes = axes_of(draw_campaign(made(scatter=scatter)), "the most important parameter")
    assert [label.get_text() for label in axes.get_xticklabels()] == ["plain", "matched"]


def test_no_label_lies_on_another_or_off_the_page() -> None:
    columns = tuple(f"deviations.joint_stiffness, joint {i}" for i in range(14))
    bars = tuple(
        Bars(m, np.linspace(1, 0.1, 14), np.ones(14, bool), np.ones(14, bool), np.ones(14))
        for m in ("margin", "overshoot", "torque_share")
    )
    figure = draw_campaign(made(columns=columns, bars=bars))
    figure.draw_without_rendering()
    page_box = figure.bbox
    boxes = [label.get_window_extent() for label in figure.subfigs[2].axes[0].get_yticklabels()]
    assert all(not a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    everything = [text.get_window_extent() for axes in figure.axes for text in (axes.title, axes.xaxis.label)]
    assert all(box.x0 >= 0 and box.x1 <= page_box.x1 for box in boxes + everything)


@pytest.mark.parametrize("which", [made(), made(**EMPTY)])
def test_it_can_be_written(which: Page, tmp_path: Path) -> None:
    for path in save_figure(draw_campaign(which), tmp_path / "page"):
        assert path.stat().st_size > 10_000


def test_the_page_of_real_rows() -> None:
    """What is drawn of a campaign is what its rows say."""
    of = campaign(
        parameters={STIFFNESS: uniform(-0.2, 0.2, per="joint"), "tank.initial": uniform(1, 3),
                    "control.inner_loop": choice("plain", "matched")},
        samples=12,
        keep={"response": 0.05},
    )  # fmt: skip
    rows = table_of(evaluate_samples(of.to_yaml(), range(12)), range(12))
    shown = page(of, rows, statistics(of, rows, metrics=["margin", "overshoot"]))
    assert shown.band is not None
    np.testing.assert_array_equal(shown.band.time, np.arange(13) * 0.05)
    z = np.array(rows["displacement_z"].to_pylist())  # the step is along z
    median = np.median(z, axis=0)
    np.testing.assert_allclose(shown.band.quantiles[2], median, rtol=0, atol=1e-6 * np.abs(z).max())
    assert shown.columns[0] == "initial"  # what is in the tank is what may be given
    assert set(shown.columns[1:]) == {"joint stiffness, joint 1", "joint stiffness, joint 2", "inner loop"}
    assert shown.scatter is not None
    np.testing.assert_array_equal(shown.scatter.x, rows["tank.initial"].to_numpy())
    assert shown.scatter.parameter == "initial [J]"
    assert shown.distributions[0].metric == "margin"
    assert shown.distributions[0].shares[-1] == 1
