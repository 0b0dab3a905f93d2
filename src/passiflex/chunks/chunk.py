"""A chunk of a campaign: some consecutive samples, evaluated together wherever a worker is."""

from __future__ import annotations

import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import pyarrow as pa

from passiflex.chunks.source import source_digest
from passiflex.chunks.tables import encoded, table_of

Work = Callable[[str, Sequence[int]], list[dict[str, Any]]]
"""Campaign's text and the numbers of samples → one flat row for each, with the same columns for all."""
VERDICT = "verdict"
"""The column that progress counts, where there is one."""


class Rows(NamedTuple):
    """The rows of a chunk, as they travel from the worker: ready to be written.

    Attributes
    ----------
    parquet: The file.
    schema: Of the file.
    verdicts: How often each verdict occurs.
    source: Digest of the source that computed them.
    """

    parquet: bytes
    schema: pa.Schema
    verdicts: dict[str, int]
    source: str


class Failed(NamedTuple):
    """A chunk that raised. Text, because an exception need not survive the way between processes."""

    error: str
    traceback: str


def evaluate(work: Work, text: str, samples: range) -> Rows | Failed:
    """Return the rows of some samples; this runs in the worker."""
    try:
        table = table_of(work(text, samples), samples)
        return Rows(encoded(table), table.schema, verdicts_in(table), source_digest())
    except Exception as error:  # whatever the work raises must not end the worker
        return Failed(f"{type(error).__name__}: {error}", traceback.format_exc())


def verdicts_in(table: pa.Table) -> Counter[str]:
    """Return how often each verdict occurs."""
    if VERDICT not in table.schema.names:
        return Counter()
    counts = table[VERDICT].value_counts().to_pylist()
    return Counter({str(count["values"]): count["counts"] for count in counts})
