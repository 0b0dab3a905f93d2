"""The figure of a run draws the diagrams of the run: every curve, level, stretch and event, and nothing else."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import same_color, to_hex
from matplotlib.figure import Figure

from diagrams.seen import EVERYWHERE, altered, continuous, held_back, made_up, rigid, without
from passiflex.diagrams import Viewed, panels
from passiflex.errors import NameUnknownError, RunFileError
from passiflex.plotting.files import save_as
from passiflex.plotting.run import ROWS_OF_EVENTS, SLIDE_HEIGHT, draw_run, printed
from passiflex.plotting.style import ROLES, SIZES
from passiflex.simulation import Run

ONE = Viewed(held_back(), "it", np.zeros((held_back().time.size, 3)))
OTHERS = (Viewed(rigid(), "rigid"), Viewed(continuous(), "continuous"))


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    yield
    plt.close("all")


def used(figure: Figure) -> list[Axes]:
    return [axes for axes in figure.axes if axes.axison]


def drawn(axes: Axes) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    return {
        str(line.get_label()): (np.asarray(line.get_xdata()), np.asarray(line.get_ydata()))
        for line in axes.lines
        if not str(line.get_label()).startswith("_")
    }


def texts(axes: Axes) -> list[str]:
    return [text.get_text().replace("\n", " ") for text in axes.texts]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", EVERYWHERE)
def test_every_curve_is_drawn_as_it_is_in_its_own_look(kind: str, size: str) -> None:
    figure = draw_run(kind, ONE, OTHERS, size)
    found = panels(kind, ONE, OTHERS)
    for axes, panel in zip(used(figure), found, strict=True):
        lines = drawn(axes)
        assert list(lines) == [printed(curve.label) for curve in panel.curves]
        for curve, line in zip(panel.curves, axes.lines, strict=False):
            np.testing.assert_array_equal(lines[printed(curve.label)][0], curve.time)
            np.testing.assert_array_equal(lines[printed(curve.label)][1], curve.values)
            assert same_color(line.get_color(), ROLES[curve.role].light)
        label = axes.get_ylabel().replace("\n", " ")
        assert label == f"{panel.title} [{panel.unit}]"
    assert figure.get_size_inches()[0] == SIZES[size].width
    assert size != "slide" or figure.get_size_inches()[1] == SLIDE_HEIGHT


def test_the_legend_names_every_curve_and_every_shade_once() -> None:
    figure = draw_run("tracking", ONE, OTHERS)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "reference $x_d$", "reference in force", "it", "rigid", "continuous", "ideal MSD, ζ = 0.7",
        "force 2 N", "drag", "reference held back",
    ]  # fmt: skip


def test_time_is_shared_and_named_below_each_column() -> None:
    """Of four diagrams the last column may be shorter than the others."""
    for size, columns in (("column", 1), ("double", 1), ("slide", 2)):
        axes = used(draw_run("tracking", ONE, (), size))
        assert [a.get_xlabel() for a in axes] == [""] * (4 - columns) + ["time [s]"] * columns
        assert {a.get_xlim() for a in axes} == {(0.0, 1.0)}
    axes = used(draw_run("tracking", Viewed(made_up(), "it"), (), "slide"))
    assert [bool(a.get_xlabel()) for a in axes] == [False, False, True, True, True]


def test_stretches_of_time_are_shaded_where_they_are() -> None:
    figure = draw_run("energy", ONE)
    for axes, panel in zip(used(figure), panels("energy", ONE), strict=True):
        boxes = [c for c in axes.collections if isinstance(c, PolyCollection)]
        found = [(path.get_extents().x0, path.get_extents().x1) for box in boxes for path in box.get_paths()]
        expected = sorted((s.start, s.end) for s in panel.spans)
        np.testing.assert_allclose(sorted(found), expected, rtol=0, atol=1e-12)
        shown = {to_hex(box.get_facecolor()[0]) for box in boxes}
        assert shown == {ROLES[span.kind].light for span in panel.spans}
    assert {span.kind for span in panels("energy", ONE)[0].spans} == {"governor", "force"}


def test_events_are_lines_named_above_the_first_row_unless_a_shade_says_the_same() -> None:
    figure = draw_run("tracking", ONE)
    first, second = used(figure)[:2]
    assert texts(first) == ["step 0.05 m", "circle"]
    assert texts(second) == []
    for axes in (first, second):
        marks = [line.get_xdata()[0] for line in axes.lines if line.get_label() == "_mark"]
        assert marks == [0.2, 0.6]


def test_names_of_events_that_would_overlap_stand_above_each_other() -> None:
    steps = "".join(f"- {{at: {0.5 + i / 1000}, kind: step, by: [0, 0, 0.1]}}\n" for i in range(5))
    text = continuous().data.attrs["scenario"]
    start, end = text.index("reference:"), text.index("forces:")
    run = altered(continuous(), scenario=text[:start] + "reference:\n" + steps + text[end:])
    first = used(draw_run("energy", Viewed(run, "it")))[0]
    named = [t for t in first.texts if t.get_text() == "step 0.1 m"]
    assert len(named) == ROWS_OF_EVENTS
    heights = [t.xyann[1] for t in named]
    assert len(set(heights)) == ROWS_OF_EVENTS
    assert sum(line.get_label() == "_mark" for line in first.lines) == 5


def test_levels_near_the_curves_are_lines_and_those_far_away_are_named() -> None:
    limits = np.array([2.0, 500.0, 2, 2, 2, 2, 2])
    axes = used(draw_run("torque", Viewed(made_up(torque_limit=limits), "it")))
    levels = [line.get_ydata()[0] for line in axes[1].lines if line.get_label() == "_level"]
    assert levels == [-2.0, 2.0]
    assert texts(axes[1]) == ["limit −2 N m", "limit +2 N m"]
    low, high = axes[1].get_ylim()
    assert low < -2 < 2 < high
    assert not any(line.get_label() == "_level" for line in axes[2].lines)
    assert texts(axes[2]) == ["out of view: limit +500 N m, limit −500 N m"]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", EVERYWHERE)
@pytest.mark.parametrize("one", [ONE, Viewed(made_up(), "it")], ids=["real", "made up"])
def test_no_text_lies_over_another(one: Viewed, kind: str, size: str) -> None:
    """Labels of axes, names of levels and events, and the legend; for three joints and for seven."""
    figure = draw_run(kind, one, (Viewed(made_up(), "a run with a longer name"),), size)
    figure.canvas.draw()
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    shown = [t for axes in used(figure) for t in (axes.xaxis.label, axes.yaxis.label, *axes.texts)]
    boxes = [t.get_window_extent(renderer) for t in shown if t.get_text()]
    boxes.append(figure.legends[0].get_window_extent(renderer))
    over = [(i, j) for i in range(len(boxes)) for j in range(i) if boxes[i].overlaps(boxes[j])]
    assert over == []
    whole = figure.bbox
    assert all(whole.x0 <= b.x0 and b.x1 <= whole.x1 and whole.y0 <= b.y0 and b.y1 <= whole.y1 for b in boxes)


def test_a_gap_stays_a_gap() -> None:
    run = altered(continuous())
    run.data["position"][10:20] = np.nan
    axes = used(draw_run("tracking", Viewed(run, "it")))[2]
    assert np.isnan(drawn(axes)["it"][1]).sum() == 10


def test_other_names_are_refused() -> None:
    with pytest.raises(NameUnknownError, match="unknown size; got 'big'"):
        draw_run("energy", ONE, (), "big")
    with pytest.raises(NameUnknownError, match="unknown kind of diagram; got 'power'"):
        draw_run("power", ONE)


def test_a_run_without_the_signals_is_refused() -> None:
    bare = without(made_up(), "tau_m", "tau_a")
    with pytest.raises(RunFileError, match="it has no signals to draw for torque"):
        draw_run("torque", Viewed(bare, "it"))


@pytest.mark.parametrize("label", ["<b>$x$</b>", "$\\frac{1}{", "_hidden", "max_delay x_d", "%s {0}", "ζ ß"])
def test_a_label_is_shown_as_the_text_that_it_is(label: str, tmp_path: Path) -> None:
    """No mathematics, no formats, nothing that hides it; only the symbols of the package are set as such."""
    figure = draw_run("tracking", Viewed(continuous(), label))
    written = re.sub(r"<!--.*?-->", "", save_as(figure, tmp_path / "a.svg").read_text(), flags=re.DOTALL)
    assert label.split("x_d")[0].strip().replace("<", "&lt;").replace(">", "&gt;") in written


def test_one_row_can_be_drawn() -> None:
    row = Run(made_up().data.isel(time=[0]))
    for kind in EVERYWHERE:
        draw_run(kind, Viewed(row, "it")).canvas.draw()


def test_a_long_label_stands_in_several_lines_inside_the_figure() -> None:
    figure = draw_run("tracking", Viewed(continuous(), "n" * 100), (), "column")
    figure.canvas.draw()
    box = figure.legends[0].get_window_extent(figure.canvas.get_renderer())  # type: ignore[attr-defined]
    assert figure.bbox.x0 <= box.x0
    assert box.x1 <= figure.bbox.x1
    assert printed("n" * 100).splitlines() == ["n" * 60, "n" * 40]
