"""The types of columns are settled by all rows together."""

from __future__ import annotations

import io
import itertools
import math
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from passiflex.chunks.tables import RowsError, conformed, encoded, table_of, unified


def table(*values: Any) -> pa.Table:
    rows = [{"sample": number, "value": value} for number, value in enumerate(values)]
    return table_of(rows, range(len(rows)))


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ([None, None], pa.null()),
        ([None, 1], pa.int64()),
        ([1, 2.5], pa.float64()),
        ([2.5, 2], pa.float64()),
        ([np.float64(1), np.int64(1)], pa.float64()),
        ([True, None], pa.bool_()),
        ([np.bool_(False)], pa.bool_()),
        (["a", None], pa.string()),
        ([[1, 2.0], [], None], pa.list_(pa.float64())),
        ([(1, 2), np.array([1.0])], pa.list_(pa.float64())),
    ],
)
def test_a_column_has_the_narrowest_type_that_holds_it(values: list[Any], kind: pa.DataType) -> None:
    assert table(*values)["value"].type == kind


def test_nan_and_none_stay_two_things() -> None:
    column = table(1.0, math.nan, None)["value"]
    assert column.null_count == 1
    assert math.isnan(column[1].as_py())


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_the_type_does_not_depend_on_the_order(order: tuple[int, ...]) -> None:
    tables = [table(None), table(2), table(2.5)]
    schema = unified(tables[place].schema for place in order)
    assert schema.field("value").type == pa.float64()
    values = [conformed(one, schema)["value"].to_pylist() for one in tables]
    assert values == [[None], [2.0], [2.5]]


@pytest.mark.parametrize("values", [[None], [1], [2.5], [True], ["a"], [[1.0, math.inf]], [[]]])
def test_parquet_keeps_the_type(values: list[Any]) -> None:
    before = table(*values)
    after = pq.read_table(io.BytesIO(encoded(before)))
    assert after.schema.equals(before.schema)
    assert after.equals(before)
    assert unified([before.schema, after.schema]) == before.schema


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([True, 1], "column 'value' has values of two kinds; got bool and int64"),
        (["a", 1.0], "column 'value' has values of two kinds; got string and double"),
        ([{"a": 1}], "column 'value' has a value that no row can hold; got dict {'a': 1}; needs float"),
        ([["a"]], "column 'value' has a value that no row can hold; got list ['a']; needs float"),
        ([2**63], "column 'value' has an integer that 64 bits do not hold; try text"),
    ],
)
def test_values_that_do_not_go_together_are_refused(values: list[Any], message: str) -> None:
    with pytest.raises(RowsError) as error:
        table(*values)
    assert str(error.value).startswith(message)


def test_pieces_that_do_not_go_together_are_refused() -> None:
    with pytest.raises(RowsError, match="got string and bool"):
        unified([table("a").schema, table(True).schema])
    with pytest.raises(RowsError, match="chunks have different columns; got value"):
        unified([table("a").schema, pa.schema({"sample": pa.int64()})])


def test_rows_that_are_not_the_ones_asked_for_are_refused() -> None:
    with pytest.raises(RowsError, match=r"other samples than asked for.* got \[0\]; needs \[0, 1\]"):
        table_of([{"sample": 0}], range(2))
    with pytest.raises(RowsError, match="sample 1 has other columns than sample 0; got a, b"):
        table_of([{"sample": 0, "a": 1}, {"sample": 1, "b": 1}], range(2))
