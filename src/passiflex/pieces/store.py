"""The folder of a campaign that runs: finished pieces land in it, and only the missing ones are run."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import final

import pyarrow as pa

from passiflex.errors import ValueRangeError
from passiflex.files import OutputError, require_writable, whole_file
from passiflex.pieces.folder_lock import locked
from passiflex.pieces.manifest import NAME, FolderError, Manifest, load_manifest, new_manifest
from passiflex.pieces.piece import Rows, verdicts_in
from passiflex.pieces.stored_rows import (
    ALL,
    PIECES,
    DamagedError,
    Stored,
    parts,
    piece_path,
    schema_of,
    settle,
    stored,
    write_all,
)
from passiflex.pieces.tables import unified

PIECE = 32
"""Samples of a piece."""
_HALF_WRITTEN = re.compile(r"\..+-[a-z0-9_]{8}(\.\w+)?")
"""Names of the temporary files of `whole_file`; other hidden files, such as a .gitignore, are the user's."""


@contextmanager
def open_store(
    folder: str | Path,
    campaign: str,
    samples: int,
    *,
    piece: int = PIECE,
    extends: bool = False,
    identity: str | None = None,
) -> Iterator[Store]:
    """Give the store of a campaign, alone in its folder, to start it or to go on with it.

    Files that killed processes left half-written are removed, and so are damaged pieces: they are missing.

    Parameters
    ----------
    campaign: The text that the work is given.
    samples: How many; they are numbered from 0.
    piece: How many samples a piece has. It may change from run to run.
    extends: Whether the first samples of a campaign of more are the samples of this one.
    identity: What must be the same to go on, if that is not the text itself: the resolved configuration
        without the number of samples.

    Raises
    ------
    FolderError
        If the folder holds another campaign.
    FolderInUseError
        If another process works in it.
    OutputError
        If it cannot be written.
    """
    if samples < 1 or piece < 1:
        raise ValueRangeError(
            "a campaign has samples, in pieces", got=f"{samples} in pieces of {piece}", needs="≥ 1"
        )
    folder = Path(folder)
    require_writable(folder)
    with locked(folder):
        identity = campaign if identity is None else identity
        if (folder / NAME).exists():
            before = load_manifest(folder)
            manifest = before.continued(campaign, identity, samples, extends)
        elif (folder / ALL).exists() or (folder / PIECES).exists():
            raise FolderError(
                f"{folder} holds rows of an unknown campaign", got=f"no {NAME}", try_="another folder"
            )
        else:
            before, manifest = None, new_manifest(campaign, identity, samples, piece)
        _sweep(folder)
        if manifest != before:
            manifest.save(folder)
        yield Store(folder, manifest, piece)


@final
class Store:
    """The folder of a campaign, held by one process.

    Attributes
    ----------
    folder, manifest: Where, and what.
    done: Number of finished samples.
    verdicts: How often each verdict occurs among them.
    damaged: Files of pieces that were found broken and removed.
    """

    def __init__(self, folder: Path, manifest: Manifest, piece: int):
        self.folder, self.manifest, self._piece = folder, manifest, piece
        self.done, self.verdicts = 0, Counter[str]()
        self.damaged: list[Path] = []
        self._schema: pa.Schema | None = None
        self._gaps: list[range] = []
        end = 0
        for file in stored(folder):
            if self._sound(file):
                self._gaps.append(range(end, file.samples.start))
                self.done += len(file.samples)
                end = file.samples.stop
        self._gaps.append(range(end, manifest.samples))

    @property
    def samples(self) -> int:
        """Return the number of samples of the campaign."""
        return self.manifest.samples

    def missing(self) -> Iterator[range]:
        """Yield the pieces that were not finished when the store was opened."""
        for gap in self._gaps:
            start = gap.start
            while start < gap.stop:
                stop = min(gap.stop, (start // self._piece + 1) * self._piece)
                yield range(start, stop)
                start = stop

    def add(self, samples: range, rows: Rows) -> None:
        """Write a finished piece, whole or not at all.

        Raises
        ------
        RowsError
            If its columns do not go with those of the other pieces.
        OutputError
            If it cannot be written; the pieces written before stay.
        """
        schema = unified([self._schema, rows.schema] if self._schema else [rows.schema])
        path = piece_path(self.folder, samples)
        with self._saying_what_is_kept():
            with whole_file(path) as temporary, temporary.open("wb") as file:
                file.write(rows.parquet)
                file.flush()
                os.fsync(file.fileno())
            settle(path.parent)
        self._schema = schema
        self.done += len(samples)
        self.verdicts.update(rows.verdicts)

    def finish(self) -> Path:
        """Write the rows of all pieces into one file, sorted by sample, and return its path."""
        if self.done != self.samples or self._schema is None:
            raise FolderError("the campaign is not complete", got=f"{self.done} of {self.samples} samples")
        with self._saying_what_is_kept():
            path = write_all(self.folder, unified(schema_of(file) for file in stored(self.folder)))
            folder = self.folder / PIECES
            if folder.exists() and not any(folder.iterdir()):
                folder.rmdir()
        return path

    @contextmanager
    def _saying_what_is_kept(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise self._unwritable(f"cannot write into {self.folder}", error.strerror or error) from error
        except OutputError as error:
            raise self._unwritable(error.what, error.got) from error

    def _unwritable(self, what: str, reason: object) -> OutputError:
        return OutputError(
            what,
            got=f"{reason}; {self.done} of {self.samples} samples are kept",
            try_="freeing disk space and the same again: only the missing ones are run",
        )

    def _sound(self, file: Stored) -> bool:
        """Return whether a file can be read to its end, and count what is in it; a broken piece is removed."""
        verdicts = Counter[str]()
        try:
            for part in parts(file):
                verdicts.update(verdicts_in(part))
            schema = schema_of(file)
        except DamagedError:
            if file.path.name == ALL:  # all the work, of which some can perhaps be saved: not ours to remove
                raise
            file.path.unlink()
            self.damaged.append(file.path)
            return False
        self._schema = unified([self._schema, schema] if self._schema else [schema])
        self.verdicts.update(verdicts)
        return True


def _sweep(folder: Path) -> None:
    """Remove what killed processes left half-written: rows, and what is made of them in the same folder."""
    for inner in (folder, folder / PIECES, folder / "runs"):
        for left in inner.glob(".*"):
            if _HALF_WRITTEN.fullmatch(left.name) and left.is_file():
                left.unlink(missing_ok=True)
