"""The rows of a campaign's folder: files of pieces while it runs, one file of all samples afterwards."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from passiflex.files import whole_file
from passiflex.pieces.manifest import FolderError, load_manifest
from passiflex.pieces.tables import INDEX, WRITING, conformed, opened, unified

ALL = "samples.parquet"
PIECES = "pieces"
GROUP = 8192
"""Samples of a row group of the file of all: what is in memory while it is written, and what a reader can skip."""
_PIECE = re.compile(r"(\d+)-(\d+)\.parquet")


class Stored(NamedTuple):
    """A file of rows, and the samples it holds."""

    path: Path
    samples: range


class DamagedError(FolderError):
    """A file of rows is cut short, or not what its name says."""


def piece_path(folder: Path, samples: range) -> Path:
    """Return where a piece is written."""
    return folder / PIECES / f"{samples.start:09d}-{samples.stop:09d}.parquet"


def stored(folder: Path) -> list[Stored]:
    """Return the files that hold each finished sample once, in the order of samples."""
    waiting = sorted(pieces(folder), key=lambda piece: piece.samples.start)
    path = folder / ALL  # looked for after the pieces, which are removed only when it is there
    found: list[Stored] = []
    if path.exists():
        with _noticing_damage(path), opened(path) as file:
            found.append(Stored(path, range(file.metadata.num_rows)))
    end = found[0].samples.stop if found else 0
    for piece in waiting:
        if piece.samples.start >= end:  # else it was left behind when all had been written into one file
            found.append(piece)
            end = piece.samples.stop
    return found


def pieces(folder: Path) -> list[Stored]:
    """Return the files of pieces, in any order."""
    found = []
    for path in (folder / PIECES).glob("*.parquet"):
        if match := _PIECE.fullmatch(path.name):
            found.append(Stored(path, range(int(match[1]), int(match[2]))))
    return found


def parts(file: Stored) -> Iterator[pa.Table]:
    """Yield the rows of a file, a row group at a time.

    Raises
    ------
    DamagedError
        If a checksum or the samples are wrong.
    """
    start = file.samples.start
    with _noticing_damage(file.path), opened(file.path) as parquet:
        for group in range(parquet.num_row_groups):
            table = parquet.read_row_group(group)
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


def read_rows(folder: str | Path) -> pa.Table:
    """Return the rows of all finished samples in their order, of a campaign that is complete or not, or runs.

    Raises
    ------
    FolderError
        If the folder holds no campaign, or a file of it is damaged.
    """
    folder = Path(folder)
    load_manifest(folder)
    while True:
        files = stored(folder)
        if not files:
            return pa.table({INDEX: pa.array([], pa.int64())})
        try:
            schema = unified(schema_of(file) for file in files)
            return pa.concat_tables([conformed(part, schema) for file in files for part in parts(file)])
        except (FileNotFoundError, DamagedError):
            if stored(folder) == files:
                raise
            # else all were written into one file meanwhile: once more


def write_all(folder: Path, schema: pa.Schema) -> Path:
    """Write the rows of all files into one, and remove the others.

    Its bytes depend on the rows alone: it is written anew in row groups of one size.
    """
    path = folder / ALL
    files = stored(folder)
    if any(file.path != path for file in files):
        with whole_file(path) as temporary, temporary.open("wb") as out:
            with pq.ParquetWriter(out, schema, **WRITING) as writer:
                for group in _groups(files, schema):
                    writer.write_table(group, row_group_size=GROUP)
            out.flush()
            os.fsync(out.fileno())
        settle(folder)
    for piece in pieces(folder):
        piece.path.unlink(missing_ok=True)
    return path


def settle(folder: Path) -> None:
    """Make the names in a folder survive a loss of power."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _groups(files: list[Stored], schema: pa.Schema) -> Iterator[pa.Table]:
    waiting, count = [], 0
    for file in files:
        for part in parts(file):
            waiting.append(conformed(part, schema))
            count += part.num_rows
            while count >= GROUP:
                rows = pa.concat_tables(waiting)
                yield rows.slice(0, GROUP).combine_chunks()
                waiting, count = [rows.slice(GROUP)], count - GROUP
    if count:
        yield pa.concat_tables(waiting).combine_chunks()


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
