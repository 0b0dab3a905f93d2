"""The table of looks: lines that stand together can be told apart, on both grounds, also with fewer colours."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import combinations

import matplotlib as mpl
import pytest
from matplotlib.colors import same_color

from diagrams.seen import continuous, held_back, made_up, rigid, touching
from passiflex.diagrams import KINDS, Viewed, panels
from passiflex.errors import NameUnknownError
from passiflex.plotting.style import (
    BLUE,
    JOINTS,
    LINES,
    ROLES,
    SIZES,
    axis_label,
    figure_style,
    line,
    size_of,
)
from plotting.vision import contrast, distance, lab

DARK = "#14171c"
APART = 18.0
"""Least distance in CIELAB of two lines that have the same dash."""
READABLE = 2.8
"""Least contrast of a line with its ground."""
GROUND_OF = {"light": "#ffffff", "dark": DARK}
PAPER = (
    ("proposed", "msd", "msd_natural", "baseline", "baseline_motor_aware", "reference"),
    ("proposed", "reference"),
    ("total", "robot", "tank"),
    ("tank", "true"),
)


def together() -> Iterator[tuple[str, ...]]:
    """Yield the roles of every diagram of every kind of run, four runs compared, and those of the paper's figures."""
    yield from PAPER
    runs = (continuous(), rigid(), held_back(), made_up(joints=8), touching())
    others = tuple(Viewed(run, str(i)) for i, run in enumerate((rigid(), *runs)))
    for run in runs:
        ideal = run["position"]
        for kind in KINDS:
            for compared in ((), others[:4]):
                for panel in panels(kind, Viewed(run, "it", ideal), compared):
                    yield tuple(curve.role for curve in panel.curves)


@pytest.mark.parametrize("ground", GROUND_OF)
def test_lines_that_stand_together_differ_in_colour_or_dash_to_anybody(ground: str) -> None:
    alike = {
        (first, second, round(distance(getattr(ROLES[first], ground), getattr(ROLES[second], ground)), 1))
        for roles in together()
        for first, second in combinations(roles, 2)
        if ROLES[first].dash == ROLES[second].dash
        and distance(getattr(ROLES[first], ground), getattr(ROLES[second], ground)) < APART
    }
    assert alike == set()


def test_every_role_that_is_used_is_in_the_table() -> None:
    used = {role for roles in together() for role in roles}
    assert used <= set(ROLES)
    assert {"proposed", "baseline", "other 1", "other 1 total", "joint 8", "granted", "friction"} <= used


@pytest.mark.parametrize("ground", GROUND_OF)
def test_lines_can_be_read_on_their_ground(ground: str) -> None:
    faint = {
        role: round(contrast(getattr(look, ground), GROUND_OF[ground]), 2)
        for role, look in ROLES.items()
        if look.width
        and role != "inconclusive"
        and contrast(getattr(look, ground), GROUND_OF[ground]) < READABLE
    }
    assert faint == {}


def test_the_tests_own_eyes() -> None:
    """Known values: L* of grey, contrast of black and white, and red and green that look alike without one cone."""
    assert lab("#777777", "all cones") == pytest.approx([50.03, 0, 0], abs=0.05)
    assert contrast("#000000", "#ffffff") == pytest.approx(21)
    assert distance("#a84000", "#6a6a00") < 25 < distance("#0072b2", "#d55e00")


def test_colours_are_written_in_full_and_dashes_in_pairs() -> None:
    for role, look in ROLES.items():
        assert re.fullmatch("#[0-9a-f]{6}", look.light), role
        assert re.fullmatch("#[0-9a-f]{6}", look.dark), role
        assert len(look.dash) % 2 == 0, role
        assert look.label, role


def test_the_papers_lines() -> None:
    """Fig. 1: blue, black dash-dot, magenta. Fig. 2: orange, dashed blue, dash-dotted magenta."""
    for first, second in (("proposed", "robot"), ("baseline", "tank")):
        assert same_color(LINES[first]["color"], LINES[second]["color"])
    assert ROLES["msd"].light == "#000000"
    assert [len(ROLES[role].dash) for role in ("proposed", "baseline", "total")] == [0, 0, 0]
    assert [len(ROLES[role].dash) for role in ("msd", "robot", "tank")] == [4, 2, 4]
    assert ROLES["proposed"].light == BLUE
    assert [ROLES[f"joint {i}"].light for i in range(1, 9)] == JOINTS


def test_a_line_is_as_wide_and_its_dashes_as_long_as_the_table_says() -> None:
    """Matplotlib counts dashes in widths of the line."""
    look = line("tank", 2.0)
    assert look["lw"] == 2 * ROLES["tank"].width
    assert [part * ROLES["tank"].width for part in look["ls"][1]] == pytest.approx(ROLES["tank"].dash)
    assert line("total")["ls"] == "-"


def test_sizes_are_those_of_papers_and_slides() -> None:
    assert [SIZES[name].width for name in ("column", "double", "slide")] == [3.5, 7.16, 10.0]
    for name, size in SIZES.items():
        with figure_style(name):
            assert mpl.rcParams["font.size"] == size.font
            assert mpl.rcParams["svg.fonttype"] == "none"
            assert mpl.rcParams["pdf.fonttype"] == 42
    assert SIZES["slide"].font > SIZES["double"].font > SIZES["column"].font


def test_another_size_is_refused_with_the_names_of_the_sizes() -> None:
    with pytest.raises(
        NameUnknownError, match="unknown size; got 'poster'; needs one of column, double, slide"
    ):
        size_of("poster")


def test_a_label_ends_in_its_unit() -> None:
    assert axis_label("energy", "J") == "energy [J]"
