"""Which samples are the worst: by the measure's bad end, diverged runs before all, also where they have no number."""

from __future__ import annotations

import math

import pytest

from passiflex.campaigns.ranking import worst_first

LEFT = "left the finite numbers"


@pytest.mark.parametrize(("measure", "expected"), [("margin", [3, 0, 2, 1]), ("overshoot", [3, 1, 2, 0])])
def test_the_bad_end_is_the_measures(measure: str, expected: list[int]) -> None:
    assert worst_first(measure, [0.1, 0.9, 0.5, 0.5], ["", "", "", LEFT]) == expected


def test_a_diverged_run_without_a_number_is_the_worst_and_another_is_left_out() -> None:
    assert worst_first("overshoot", [0.1, math.nan, None, math.nan, 0.2], ["", LEFT, "", "", ""]) == [1, 4, 0]


def test_of_equals_the_earlier_is_first() -> None:
    assert worst_first("margin", [1.0, 1.0, math.inf, -math.inf], [""] * 4) == [3, 0, 1, 2]
