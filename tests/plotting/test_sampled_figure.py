"""The figure of the sampled study draws the panels that it is given."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from passiflex.plotting.sampled import CLAIMED, LARGE, TRUE, SampledPanel, draw_sampled
from passiflex.plotting.style import LINES

TIME = np.linspace(0, 1, 11)
NOTHING = np.zeros(TIME.size, dtype=bool)


def panel(seed: int, **changes: object) -> SampledPanel:
    rng = np.random.default_rng(seed)
    return SampledPanel(
        title=f"panel {seed}",
        verdict="passive",
        time=TIME,
        motion=rng.uniform(-0.1, 0.1, TIME.size),
        goal=rng.uniform(-0.1, 0.1, TIME.size),
        goal_name="msd",
        claimed=rng.uniform(0, 2, TIME.size),
        true=rng.uniform(0, 2, TIME.size),
        governed=NOTHING,
        latched=NOTHING,
    )._replace(**changes)


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    yield
    plt.close("all")


def drawn(figure: Figure, place: int) -> dict[str, np.ndarray]:
    return {str(line.get_label()): np.asarray(line.get_ydata()) for line in figure.axes[place].lines}


def labels(figure: Figure) -> list[str]:
    (legend,) = figure.legends
    return [text.get_text() for text in legend.get_texts()]


def test_every_panel_shows_its_motion_above_its_energies() -> None:
    """Two rows for each task, a column for each way; a shorter task leaves its last places empty."""
    first = [panel(0), panel(1, goal_name="reference")]
    second = [panel(2, verdict="violated, 3 J too much")]
    figure = draw_sampled([first, second], "the conditions")
    assert len(figure.axes) == 8
    for place, shown in ((0, first[0]), (1, first[1]), (4, second[0])):
        motion, energy = figure.axes[place], figure.axes[place + 2]
        np.testing.assert_array_equal(drawn(figure, place)["robot"], shown.motion)
        np.testing.assert_array_equal(drawn(figure, place)[LINES[shown.goal_name]["label"]], shown.goal)
        np.testing.assert_array_equal(drawn(figure, place + 2)[CLAIMED["label"]], shown.claimed)
        np.testing.assert_array_equal(drawn(figure, place + 2)[TRUE["label"]], shown.true)
        assert motion.get_title() == shown.title
        assert energy.get_title() == shown.verdict
        assert energy.get_xlabel() == "time [s]"
        assert {motion.get_yscale(), energy.get_yscale()} == {"linear"}
    assert [figure.axes[place].axison for place in (5, 7)] == [False, False]
    for row, label in enumerate(["Z displacement [m]", "energy [J]"] * 2):
        assert figure.axes[2 * row].get_ylabel() == label
    assert figure.get_supxlabel() == "the conditions"
    assert sorted(labels(figure)) == sorted(
        {"robot", LINES["msd"]["label"], LINES["reference"]["label"], CLAIMED["label"], TRUE["label"]}
    )


def test_what_was_held_back_and_what_fell_back_is_shaded() -> None:
    governed, latched = TIME < 0.35, TIME > 0.55
    figure = draw_sampled([[panel(0, governed=governed, latched=latched), panel(1)]], "")
    for place in (0, 2):
        spans = {
            str(area.get_label()): area.get_paths()[0].get_extents().intervalx
            for area in figure.axes[place].collections
        }
        assert spans["reference held back"] == pytest.approx([0, 0.3])
        assert spans["fallen back"] == pytest.approx([0.6, 1])
        assert not figure.axes[place + 1].collections
    assert {"reference held back", "fallen back"} <= set(labels(figure))


@pytest.mark.parametrize("sign", [1, -1])
def test_energies_that_fit_no_linear_scale_are_drawn_on_a_logarithmic_one(sign: int) -> None:
    """Of both signs, with 0 between them; the motion keeps its own scale."""
    huge = np.linspace(0, sign * 3e6, TIME.size)
    figure = draw_sampled([[panel(0, true=huge), panel(1)]], "")
    energy, other = figure.axes[2], figure.axes[3]
    assert energy.get_yscale() == "symlog"
    assert {other.get_yscale(), figure.axes[0].get_yscale()} == {"linear"}
    ticks = np.asarray(energy.get_yticks())
    assert 0 in ticks
    assert np.abs(ticks).max() == 1e7
    np.testing.assert_allclose(np.sort(ticks), np.sort(-ticks))
    low, high = energy.get_ylim()
    assert low <= huge.min() <= huge.max() <= high


@pytest.mark.parametrize("largest", [LARGE, LARGE * 1.01])
def test_the_scale_changes_at_one_size(largest: float) -> None:
    claimed = np.full(TIME.size, largest)
    figure = draw_sampled([[panel(0, claimed=claimed)]], "")
    assert figure.axes[1].get_yscale() == ("linear" if largest == LARGE else "symlog")


def test_numbers_that_are_none_do_not_stop_the_drawing() -> None:
    """A run that left the finite numbers ends in them."""
    broken = np.where(TIME > 0.5, np.inf, 1.0)
    nothing = np.full(TIME.size, np.nan)
    figure = draw_sampled(
        [[panel(0, claimed=broken, true=nothing), panel(1, motion=np.append(0, TIME[1:] * 1e9))]], ""
    )
    figure.canvas.draw()
    assert figure.axes[2].get_yscale() == "linear"
    assert figure.axes[1].get_yscale() == "symlog"
