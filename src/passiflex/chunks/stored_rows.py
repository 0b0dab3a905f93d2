"""The rows of a campaign's folder: files of chunks while it runs, one file of all samples afterwards."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from passiflex.chunks.manifest import FolderError, load_manifest
from passiflex.chunks.tables import INDEX, WRITING, conformed, opened, unified
from passiflex.errors import NameUnknownError
from passiflex.files import whole_file

ALL = "samples.parquet"
CHUNKS = "pieces"
"""Where they lie in the folder of a campaign."""
GROUP = 8192
"""Most samples of a row group of the file of all: what is in memory while it is written, and what a reader skips."""
GROUP_BYTES = 2**24
"""A row group ends with the row that fills so many bytes, as `_widths` counts them, if that comes first."""
_CHUNK = re.compile(r"(\d{9})-(\d{9})\.parquet")


class Stored(NamedTuple):
    """A file of rows, and the samples it holds."""

    path: Path
    samples: range


class DamagedError(FolderError):
    """A file of rows is cut short, or not what its name says."""


def chunk_path(folder: Path, samples: range) -> Path:
    """Return where a chunk is written."""
    return folder / CHUNKS / f"{samples.start:09d}-{samples.stop:09d}.parquet"


def stored(folder: Path) -> list[Stored]:
    """Return the files that hold each finished sample once, in the order of samples."""
    waiting = sorted(chunks(folder), key=lambda chunk: chunk.samples.start)
    path = folder / ALL  # looked for after the chunks, which are removed only when it is there
    found: list[Stored] = []
    with suppress(FileNotFoundError), _noticing_damage(path), opened(path) as file:
        found.append(Stored(path, range(file.metadata.num_rows)))
    end = found[0].samples.stop if found else 0
    for chunk in waiting:
        if chunk.samples.start >= end:  # else it was left behind when all had been written into one file
            found.append(chunk)
            end = chunk.samples.stop
    return found


def chunks(folder: Path) -> list[Stored]:
    """Return the files of chunks, in any order."""
    found = []
    for path in (folder / CHUNKS).glob("*.parquet"):
        if (match := _CHUNK.fullmatch(path.name)) and match[1] < match[2]:
            found.append(Stored(path, range(int(match[1]), int(match[2]))))
    return found


def parts(file: Stored, columns: Sequence[str] | None = None) -> Iterator[pa.Table]:
    """Yield the rows of a file, a row group at a time; of some columns if they are named, and INDEX.

    Raises
    ------
    DamagedError
        If a checksum or the samples are wrong.
    """
    start = file.samples.start
    with _noticing_damage(file.path), opened(file.path) as parquet:
        for group in range(parquet.num_row_groups):
            table = parquet.read_row_group(group, None if columns is None else [INDEX, *columns])
            if table[INDEX].to_pylist() != list(range(start, start + table.num_rows)):
                raise ValueError("other samples than there should be")
            start += table.num_rows
            yield table
        if start != file.samples.stop:
            raise ValueError("other samples than there should be")


def schema_of(file: Stored) -> pa.Schema:
    """Return the schema of a file."""
    with _noticing_damage(file.path):
        return pq.read_schema(file.path)


def read_rows(folder: str | Path, columns: Sequence[str] | None = None) -> pa.Table:
    """Return the rows of all finished samples in their order, of a campaign that is complete or not, or runs.

    Parameters
    ----------
    columns: Only these, in this order; the others are not read, nor is damage in them noticed. Before the
        first chunk is finished nobody knows the columns: any name gives an empty one.

    Raises
    ------
    FolderError
        If the folder holds no campaign, or a file of it is damaged.
    NameUnknownError
        For a column that there is not.
    """
    folder = Path(folder)
    load_manifest(folder)
    while True:
        files = stored(folder)
        try:
            schema = _asked_for(files, columns)
            blocks = [conformed(part, schema) for file in files for part in parts(file, columns)]
            return pa.concat_tables([schema.empty_table(), *blocks])
        except (FileNotFoundError, DamagedError) as error:
            _require_change(folder, files, error)  # all were written into one file: once more


def read_blocks(folder: str | Path, columns: Sequence[str] | None = None) -> Iterator[pa.Table]:
    """Yield what `read_rows` returns in blocks of rows, of which one is in memory at a time.

    A block is a chunk, or as much of the file of all as GROUP and GROUP_BYTES say. When a campaign completes
    meanwhile, the samples after those already given follow from the file of all, and the type of a column may
    then be wider than before: `tables.unified` has the one for all.

    Raises
    ------
    FolderError, NameUnknownError
        As `read_rows`.
    """
    folder = Path(folder)
    load_manifest(folder)
    given = 0
    while True:
        files = stored(folder)
        try:
            schema = _asked_for(files, columns)
            for file in files:
                for part in parts(file, columns) if file.samples.stop > given else ():
                    rows = part.slice(int(np.searchsorted(part[INDEX].to_numpy(), given)))
                    if rows.num_rows:
                        given = rows[INDEX][-1].as_py() + 1
                        yield conformed(rows, schema)
            return
        except (FileNotFoundError, DamagedError) as error:
            _require_change(folder, files, error)


def write_all(folder: Path, schema: pa.Schema, samples: int) -> Path:
    """Write the rows of all files into one, and remove the others once it has been read back.

    Its bytes depend on the rows alone: it is written anew, in row groups that end where the widths of the rows
    say, from the first sample on. What is in memory is one of them and a part of a file.

    Raises
    ------
    DamagedError
        If a file is damaged, the new one included.
    """
    path = folder / ALL
    files = stored(folder)
    if any(file.path != path for file in files):
        with whole_file(path, parents=False) as temporary:
            with temporary.open("wb") as out:
                with pq.ParquetWriter(out, schema, **WRITING) as writer:
                    for group in _groups(files, schema):
                        writer.write_table(group, row_group_size=group.num_rows)
                out.flush()
                os.fsync(out.fileno())
            for _ in parts(Stored(temporary, range(samples))):
                pass  # it raises for what is not as it should be
        settle(folder)
    for chunk in chunks(folder):
        chunk.path.unlink(missing_ok=True)
    return path


def gaps(files: Sequence[Stored], samples: int) -> Iterator[range]:
    """Yield the samples that are in none of the files, which are in their order."""
    end = 0
    for file in files:
        if file.samples.start > end:
            yield range(end, file.samples.start)
        end = file.samples.stop
    if end < samples:
        yield range(end, samples)


def settle(folder: Path) -> None:
    """Make the names in a folder survive a loss of power."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _require_change(folder: Path, files: list[Stored], error: Exception) -> None:
    """Raise what went wrong with the files of a folder, unless it holds others by now."""
    if stored(folder) != files:
        return
    if isinstance(error, FileNotFoundError):
        raise FolderError(f"rows are gone from {folder}", got=f"no {error.filename}") from error
    raise error


def _asked_for(files: list[Stored], columns: Sequence[str] | None) -> pa.Schema:
    """Return the schema of the rows of all files, of some columns if they are named."""
    if not files:
        names = [INDEX] if columns is None else columns
        return pa.schema([(name, pa.int64() if name == INDEX else pa.null()) for name in names])
    schema = unified(schema_of(file) for file in files)
    if columns is None:
        return schema
    for name in columns:
        if name not in schema.names:
            raise NameUnknownError("column", name, schema.names)
    return pa.schema([schema.field(name) for name in columns])


def _groups(files: list[Stored], schema: pa.Schema) -> Iterator[pa.Table]:
    """Yield the rows in groups that do not depend on how they are spread over files."""
    waiting: list[pa.Table] = []
    count, size = 0, 0
    for file in files:
        for part in parts(file):
            rows = conformed(part, schema)
            widths = _widths(rows)
            start = 0
            while start < rows.num_rows:
                sizes = size + np.cumsum(widths[start : start + GROUP - count])
                taken = min(int(np.searchsorted(sizes, GROUP_BYTES)) + 1, len(sizes))
                waiting.append(rows.slice(start, taken))
                start, count, size = start + taken, count + taken, int(sizes[taken - 1])
                if count == GROUP or size >= GROUP_BYTES:
                    yield pa.concat_tables(waiting).combine_chunks()
                    waiting, count, size = [], 0, 0
    if count:
        yield pa.concat_tables(waiting).combine_chunks()


def _widths(rows: pa.Table) -> NDArray[np.int64]:
    """Return about how many bytes each row takes: 8 for a value or a number of a list, 1 for a byte of text."""
    widths = np.full(rows.num_rows, 8 * rows.num_columns, dtype=np.int64)
    for column in rows.columns:
        if pa.types.is_list(column.type):
            widths += 8 * pc.list_value_length(column).fill_null(0).to_numpy()
        elif pa.types.is_string(column.type):
            widths += pc.binary_length(column).fill_null(0).to_numpy()
    return widths


@contextmanager
def _noticing_damage(path: Path) -> Iterator[None]:
    """Turn what the Parquet reader raises for a broken file into one kind of error."""
    try:
        yield
    except FileNotFoundError:
        raise
    except (pa.ArrowException, ValueError, KeyError, OSError) as error:
        remedy = (
            "removing it: all samples are run again" if path.name == ALL else "running the campaign again"
        )
        raise DamagedError(f"{path} is damaged", got=str(error).partition("\n")[0], try_=remedy) from error
