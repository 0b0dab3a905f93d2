"""Rows as Arrow tables, with types that do not depend on which rows came first, and as Parquet."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from passiflex.errors import PassiflexError

INDEX = "sample"
"""The column of the sample's number."""
LIST = pa.list_(pa.float64())
WRITING = {"compression": "zstd", "write_page_checksum": True}


class RowsError(PassiflexError):
    """Rows do not make a table: their columns or the kinds of their values differ."""


def table_of(rows: Sequence[Mapping[str, Any]], samples: Sequence[int]) -> pa.Table:
    """Return the rows of `samples`, in their order; the columns are in the order of the first row's.

    Raises
    ------
    RowsError
        If a sample has no row or other columns than the first one, or a value is none of float, int (of
        64 bits), bool, str, list of numbers, None; or the values of a column are of kinds that do not go together.
    """
    got = [row.get(INDEX) for row in rows]
    if got != list(samples):
        needs = str(list(samples))
        raise RowsError(f"rows of other samples than asked for, or without {INDEX!r}", got=got, needs=needs)
    names = list(rows[0]) if rows else [INDEX]
    for row in rows:
        if row.keys() != rows[0].keys():
            odd = sorted(row.keys() ^ rows[0].keys())
            raise RowsError(f"sample {row[INDEX]} has other columns than sample {got[0]}", got=", ".join(odd))
    columns = {name: _column(name, [_plain(row[name]) for row in rows]) for name in names}
    return pa.table(columns)


def unified(schemas: Iterable[pa.Schema]) -> pa.Schema:
    """Return the schema that holds the rows of all, in the first one's order of columns.

    A column that is empty in one takes its type from another; integers beside floats become floats.

    Raises
    ------
    RowsError
        If the columns differ, or their types do not go together.
    """
    first, *others = schemas
    types = {field.name: field.type for field in first}
    for schema in others:
        if set(schema.names) != types.keys():
            odd = sorted(types.keys() ^ set(schema.names))
            raise RowsError("chunks have different columns", got=", ".join(odd))
        for field in schema:
            types[field.name] = _wider(field.name, types[field.name], field.type)
    return pa.schema(list(types.items()))


def conformed(table: pa.Table, schema: pa.Schema) -> pa.Table:
    """Return the table in a schema that is `unified` from its own and others."""
    return table.select(schema.names).cast(schema, safe=False)


def encoded(table: pa.Table) -> bytes:
    """Return the table as a Parquet file with checksums."""
    buffer = io.BytesIO()
    pq.write_table(table, buffer, **WRITING)
    return buffer.getvalue()


def opened(path: Path) -> pq.ParquetFile:
    """Return a Parquet file whose checksums are verified as it is read."""
    return pq.ParquetFile(path, page_checksum_verification=True)


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _column(name: str, values: list[Any]) -> pa.Array:
    kind: pa.DataType = pa.null()
    for value in values:
        kind = _wider(name, kind, _type(name, value))
    if kind == pa.float64():
        values = [None if value is None else float(value) for value in values]
    elif kind == LIST:
        values = [None if value is None else [float(number) for number in value] for value in values]
    try:
        return pa.array(values, kind)
    except (OverflowError, pa.ArrowInvalid) as error:
        raise RowsError(f"column {name!r} has an integer that 64 bits do not hold", try_="text") from error


def _type(name: str, value: Any) -> pa.DataType:
    if value is None:
        return pa.null()
    if isinstance(value, bool):  # before int, of which it is one
        return pa.bool_()
    if isinstance(value, int):
        return pa.int64()
    if isinstance(value, float):
        return pa.float64()
    if isinstance(value, str):
        return pa.string()
    if isinstance(value, (list, tuple, np.ndarray)):
        try:
            [float(number) for number in value]
        except (TypeError, ValueError):
            pass
        else:
            return LIST
    raise RowsError(
        f"column {name!r} has a value that no row can hold",
        got=f"{type(value).__name__} {value!r}"[:80],
        needs="float, int, bool, str, a list of numbers, or None",
    )


def _wider(name: str, one: pa.DataType, other: pa.DataType) -> pa.DataType:
    if one == other or pa.types.is_null(other):
        return one
    if pa.types.is_null(one):
        return other
    if {one, other} == {pa.int64(), pa.float64()}:
        return pa.float64()
    raise RowsError(f"column {name!r} has values of two kinds", got=f"{one} and {other}")
