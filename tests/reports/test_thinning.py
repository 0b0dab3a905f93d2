"""Thinning: few points, no peak lost, nothing out of order."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from passiflex.reports.thinning import CLOSE, MOST_FRAMES, MOST_POINTS, Bins, frame_rows

FINITE = st.floats(-1e6, 1e6)
SERIES = hnp.arrays(np.float64, st.integers(1, 60), elements=st.one_of(FINITE, st.just(np.nan)))


@settings(max_examples=200, deadline=None)
@given(SERIES, st.integers(2, 20))
def test_each_bin_keeps_its_least_and_its_greatest_in_order(values: np.ndarray, most: int) -> None:
    bins = Bins.of(values.size, most=most)
    shown = bins.values(values)
    assert shown.size == bins.times(np.arange(values.size, dtype=float)).size <= max(most, 1)
    if bins.width == 1:
        np.testing.assert_array_equal(shown, values)
        return
    for i, start in enumerate(range(0, values.size, bins.width)):
        rows, points = values[start : start + bins.width], shown[2 * i : 2 * i + 2]
        there = rows[~np.isnan(rows)]
        if there.size == 0:
            assert np.isnan(points).all()
            continue
        assert sorted(points) == [there.min(), there.max()] or (points == there).all()
        if there.min() < there.max():
            in_order = np.argmax(rows == there.min()) < np.argmax(rows == there.max())
            assert in_order == (points[0] < points[1])


@settings(max_examples=100, deadline=None)
@given(st.integers(1, 40_000), st.integers(2, 7000))
def test_instants_lie_in_their_bins_and_reach_from_end_to_end(rows: int, most: int) -> None:
    time = np.arange(rows) * 1e-3
    bins = Bins.of(rows, most=most)
    shown = bins.times(time)
    assert (shown[0], shown[-1]) == (time[0], time[-1])
    assert (np.diff(shown) > 0).all()
    if bins.width > 1:
        of_bin = np.floor_divide(np.rint(shown / 1e-3), bins.width)
        np.testing.assert_array_equal(of_bin, np.arange(shown.size) // 2)


@settings(max_examples=200, deadline=None)
@given(st.integers(1, 9000), st.lists(st.integers(0, 9000), max_size=4), st.integers(2, 300))
def test_near_a_moment_every_row_is_shown_and_elsewhere_no_peak_is_lost(
    rows: int, close: list[int], most: int
) -> None:
    bins = Bins.of(rows, [row for row in close if row < rows], most)
    time, values = np.arange(rows, dtype=float), np.sin(np.arange(rows) ** 2)
    times, shown = bins.times(time), bins.values(values)
    assert (
        times.size == shown.size <= most + len(close) * (2 * CLOSE + 1) + 2 * len(close) + 2
        or bins.width == 1
    )
    assert (np.diff(times) > 0).all()
    assert (times[0], times[-1]) == (0, rows - 1)
    assert (shown.min(), shown.max()) == (values.min(), values.max())
    for row in close:
        near = np.arange(max(row - CLOSE, 0), min(row + CLOSE + 1, rows))
        if row < rows:
            np.testing.assert_array_equal(shown[np.searchsorted(times, near)], values[near])
            assert np.isin(near, times).all()


@pytest.mark.parametrize(("rows", "width"), [(1, 1), (6001, 1), (6002, 3), (30001, 11), (300_001, 101)])
def test_a_series_of_a_usual_run_is_whole(rows: int, width: int) -> None:
    assert Bins.of(rows).width == width
    assert -(-rows // width) * 2 <= MOST_POINTS or width == 1


@settings(max_examples=100, deadline=None)
@given(st.integers(1, 100_000))
def test_frames_are_few_and_reach_from_end_to_end(rows: int) -> None:
    chosen = frame_rows(rows)
    assert chosen.size <= MOST_FRAMES
    assert (chosen[0], chosen[-1]) == (0, rows - 1)
    steps = np.diff(chosen)
    assert (steps > 0).all()
    assert np.unique(steps[:-1]).size <= 1
    assert chosen.size == rows or chosen.size > MOST_FRAMES / 2 - 1
