"""Layouts: numbers and symbols go in by name and come out in shape, and every wrong use says what is needed."""

from __future__ import annotations

from typing import Protocol

import casadi as cs
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from passiflex.errors import NameUnknownError, PassiflexError, SizeError, ValueRangeError
from passiflex.layout import Field, Layout

LAYOUT = Layout(
    (
        Field("mass", (), "kg", "m"),
        Field("force", (3,), "N"),
        Field("stiffness", (2, 3), "N/m", "K"),
        Field("inertia", (3, 2), "kg m^2"),
    )
)
VALUES = {
    "mass": np.asarray(1.0),
    "force": np.array([2.0, 3.0, 4.0]),
    "stiffness": np.arange(5.0, 11.0).reshape(2, 3),
    "inertia": np.arange(11.0, 17.0).reshape(3, 2),
}


def test_the_vector_holds_the_fields_in_order_and_matrices_row_by_row() -> None:
    np.testing.assert_array_equal(LAYOUT.pack(VALUES), np.arange(1.0, 17.0))
    assert LAYOUT.size == 16
    assert [f.size for f in LAYOUT] == [1, 3, 6, 6]
    assert LAYOUT.slices["stiffness"] == slice(4, 10)


def test_values_may_come_in_any_order_and_as_lists() -> None:
    written = {k: v.tolist() for k, v in reversed(VALUES.items())}
    np.testing.assert_array_equal(LAYOUT.pack(written), np.arange(1.0, 17.0))


@given(arrays(float, 16, elements=st.floats(-1e300, 1e300)))
def test_unpack_is_the_inverse_of_pack(vector: np.ndarray) -> None:
    named = LAYOUT.unpack(vector)
    assert {k: v.shape for k, v in named.items()} == {f.name: f.shape for f in LAYOUT}
    np.testing.assert_array_equal(LAYOUT.pack(named), vector)


def test_unpack_keeps_the_leading_axes() -> None:
    """Rows over time: every entry has time first, then its own shape; a scalar has time alone."""
    rows = np.arange(2 * 5 * 16.0).reshape(2, 5, 16)
    named = LAYOUT.unpack(rows)
    assert named["mass"].shape == (2, 5)
    assert named["stiffness"].shape == (2, 5, 2, 3)
    np.testing.assert_array_equal(named["stiffness"][1, 4], LAYOUT.unpack(rows[1, 4])["stiffness"])


def test_views_are_the_packed_values_in_shape() -> None:
    """The symbolic side agrees with the numeric one: entry (i, j) of a view is entry (i, j) of the value."""
    vector, named = LAYOUT.symbols("x")
    assert vector.shape == (16, 1)
    for name, value in VALUES.items():
        view = cs.Function("view", [vector], [getattr(named, name)])
        seen = np.array(view(LAYOUT.pack(VALUES)))
        np.testing.assert_array_equal(seen.reshape(value.shape), value)
        assert seen.shape == (value.shape if value.ndim == 2 else (value.size, 1))


def test_stack_is_the_inverse_of_view() -> None:
    vector, named = LAYOUT.symbols("x")
    again = LAYOUT.stack(vars(named))
    function = cs.Function("again", [vector], [again])
    np.testing.assert_array_equal(np.array(function(np.arange(16.0))).ravel(), np.arange(16.0))


def test_stack_takes_numbers_and_keeps_zeros_that_symbols_would_drop() -> None:
    """A structural zero stays an entry: the result is dense, in the layout's order."""
    stacked = LAYOUT.stack(VALUES | {"force": cs.SX(3, 1)})
    assert stacked.nnz() == stacked.numel() == 16
    expected = LAYOUT.pack(VALUES | {"force": np.zeros(3)})
    np.testing.assert_array_equal(np.array(cs.DM(stacked)).ravel(), expected)


def test_symbols_are_fresh() -> None:
    (first, _), (second, _) = LAYOUT.symbols("x"), LAYOUT.symbols("x")
    assert not cs.depends_on(first, second)


def test_layouts_add_up() -> None:
    both = LAYOUT + Layout((Field("tool_mass", (), "kg"), Field("tool_force", (3,), "N")))
    assert [f.name for f in both][4:] == ["tool_mass", "tool_force"]
    assert both.size == LAYOUT.size + 4
    assert both.slices["tool_mass"] == slice(LAYOUT.size, LAYOUT.size + 1)
    assert both.slices["tool_force"] == slice(LAYOUT.size + 1, LAYOUT.size + 4)


def without(name: str) -> dict[str, np.ndarray]:
    return {k: v for k, v in VALUES.items() if k != name}


KNOWN = "force, inertia, mass, stiffness"


@pytest.mark.parametrize(
    ("values", "kind", "message"),
    [
        (
            VALUES | {"stifness": 1},
            NameUnknownError,
            f"unknown parameter; got 'stifness'; needs one of {KNOWN}; try 'stiffness'",
        ),
        (VALUES | {"qqq": 1}, NameUnknownError, f"unknown parameter; got 'qqq'; needs one of {KNOWN}"),
        (without("mass"), SizeError, "parameter 'mass' is missing; needs shape () in kg"),
        (without("stiffness"), SizeError, "parameter 'stiffness' is missing; needs shape (2, 3) in N/m"),
        (
            VALUES | {"force": [1, 2]},
            SizeError,
            "parameter 'force' has the wrong shape; got (2,); needs (3,) in N",
        ),
        (
            VALUES | {"mass": [1]},
            SizeError,
            "parameter 'mass' has the wrong shape; got (1,); needs () in kg",
        ),
        (
            VALUES | {"stiffness": VALUES["stiffness"].T},
            SizeError,
            "parameter 'stiffness' has the wrong shape; got (3, 2); needs (2, 3) in N/m",
        ),
        (
            VALUES | {"force": [1, np.nan, 2]},
            ValueRangeError,
            "parameter 'force' is not finite; got [ 1. nan  2.]; needs finite numbers in N",
        ),
        (
            VALUES | {"mass": np.nan},
            ValueRangeError,
            "parameter 'mass' is not finite; got nan; needs finite numbers in kg",
        ),
    ],
)
def test_every_mistake_is_named(
    values: dict[str, np.ndarray], kind: type[PassiflexError], message: str
) -> None:
    with pytest.raises(kind) as error:
        LAYOUT.pack(values)
    assert str(error.value) == message


class Mass(Protocol):
    mass: cs.SX


class MassAndForce(Mass, Protocol):
    force: cs.SX


def test_a_layout_has_the_names_that_its_protocol_promises_and_no_others() -> None:
    both = (Field("mass", (), "kg"), Field("force", (3,), "N"))
    view: MassAndForce = Layout(both, MassAndForce).symbols("p")[1]
    assert view.force.numel() == 3
    for fields, promised, other in ((both, Mass, "force"), (both[:1], MassAndForce, "force")):
        with pytest.raises(ValueRangeError, match=other):
            Layout(fields, promised)
