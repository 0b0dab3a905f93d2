"""Arrays as text: what comes out is what went in, once each, and the same every time."""

from __future__ import annotations

import base64
import gzip

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from passiflex.reports.arrays import Arrays
from reports.pages import unpacked

SHAPES = hnp.array_shapes(min_dims=1, max_dims=2, min_side=0, max_side=9)


def blob(arrays: Arrays) -> bytes:
    return gzip.decompress(base64.b64decode(arrays.text(), validate=True))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(hnp.arrays(np.float64, SHAPES), st.sampled_from(["f32", "f64"])), max_size=5))
def test_every_array_comes_back(given_arrays: list) -> None:
    arrays = Arrays()
    places = [arrays.add(values, kind) for values, kind in given_arrays]
    packed = blob(arrays)
    for (values, kind), place in zip(given_arrays, places, strict=True):
        with np.errstate(over="ignore"):
            wanted = values.astype("<f4" if kind == "f32" else "<f8")
        wanted = np.where(np.isfinite(wanted), wanted, np.nan)
        np.testing.assert_array_equal(unpacked(packed, place), wanted)
        assert place["dtype"] == kind


def test_equal_arrays_lie_in_one_place() -> None:
    arrays = Arrays()
    first = arrays.add([1.0, 2.0, np.nan])
    assert arrays.add([1.0, 2.0, np.nan]) == first
    assert arrays.add([[1.0, 2.0, np.nan]]) == first | {"shape": [1, 3]}
    assert arrays.add([1.0, 2.0, np.nan], "f64")["offset"] == 12
    assert len(blob(arrays)) == 12 + 24


def test_first_bytes_lie_together() -> None:
    arrays = Arrays()
    arrays.add([1.0, 2.0])  # 3f800000 and 40000000, little-endian
    assert blob(arrays) == bytes([0, 0, 0, 0, 0x80, 0x00, 0x3F, 0x40])


@pytest.mark.parametrize("value", [np.inf, -np.inf, 1e300])
def test_what_is_not_a_number_of_its_kind_is_a_gap(value: float) -> None:
    arrays = Arrays()
    place = arrays.add([value, 1.0])
    np.testing.assert_array_equal(unpacked(blob(arrays), place), [np.nan, 1.0])


def test_no_arrays_are_an_empty_blob() -> None:
    assert blob(Arrays()) == b""


def test_the_text_carries_no_time() -> None:
    packed = base64.b64decode(Arrays().text())
    assert packed[4:8] == b"\0\0\0\0"  # MTIME of the gzip header
