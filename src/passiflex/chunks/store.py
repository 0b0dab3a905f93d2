"""The folder of a campaign that runs: finished chunks land in it, and only the missing ones are run."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import final

import pyarrow as pa

from passiflex.chunks.chunk import Rows, verdicts_in
from passiflex.chunks.folder_lock import locked
from passiflex.chunks.manifest import NAME, FolderError, Manifest, load_manifest, new_manifest
from passiflex.chunks.stored_rows import (
    ALL,
    CHUNKS,
    DamagedError,
    Stored,
    chunk_path,
    gaps,
    parts,
    schema_of,
    settle,
    stored,
    write_all,
)
from passiflex.chunks.tables import unified
from passiflex.errors import ValueRangeError
from passiflex.files import OutputError, is_half_written, require_writable, whole_file

CHUNK = 32
"""Samples of a chunk."""


@contextmanager
def open_store(
    folder: str | Path,
    campaign: str,
    samples: int,
    *,
    chunk: int = CHUNK,
    extends: bool = False,
    identity: str | None = None,
    beside: Collection[str] = (),
) -> Iterator[Store]:
    """Give the store of a campaign, alone in its folder, to start it or to go on with it.

    Files that killed processes left half-written are removed, and so are damaged chunks: they are missing.

    Parameters
    ----------
    campaign: The text that the work is given.
    samples: How many; they are numbered from 0.
    chunk: How many samples a chunk has. It may change from run to run.
    extends: Whether the first samples of a campaign of more are the samples of this one.
    identity: What must be the same to go on, if that is not the text itself: the resolved configuration
        without the number of samples.
    beside: Names of the files that will be made of the rows, from the folder; patterns as of `Path.glob`.

    Raises
    ------
    FolderError
        If the folder holds another campaign, or in a new one files of those names.
    FolderInUseError
        If another process works in it.
    OutputError
        If it cannot be written.
    """
    if samples < 1 or chunk < 1:
        raise ValueRangeError(
            "a campaign has samples, in chunks", got=f"{samples} in chunks of {chunk}", needs="≥ 1"
        )
    folder = Path(folder)
    require_writable(folder)
    _require_no_others(folder, beside)  # first, so that nothing of ours is left in a folder that is not
    with locked(folder) as is_ours:
        _require_no_others(folder, beside)
        identity = campaign if identity is None else identity
        before = load_manifest(folder) if (folder / NAME).exists() else None
        if before:
            manifest = before.continued(campaign, identity, samples, extends)
        else:
            manifest = new_manifest(campaign, identity, samples, chunk)
        _sweep(folder)
        if manifest != before:
            manifest.save(folder)
        yield Store(folder, manifest, chunk, is_ours)


@final
class Store:
    """The folder of a campaign, held by one process.

    Attributes
    ----------
    folder, manifest: Where, and what.
    done: Number of finished samples.
    verdicts: How often each verdict occurs among them.
    damaged: Files of chunks that were found broken and removed.
    """

    def __init__(self, folder: Path, manifest: Manifest, chunk: int, is_ours: Callable[[], bool]):
        self.folder, self.manifest, self._chunk, self._is_ours = folder, manifest, chunk, is_ours
        self.verdicts = Counter[str]()
        self.damaged: list[Path] = []
        self._schema: pa.Schema | None = None
        sound = [file for file in stored(folder) if self._sound(file)]
        self.done = sum(len(file.samples) for file in sound)
        self._gaps = list(gaps(sound, manifest.samples))

    @property
    def samples(self) -> int:
        """Return the number of samples of the campaign."""
        return self.manifest.samples

    def missing(self) -> Iterator[range]:
        """Yield the chunks that were not finished when the store was opened."""
        for gap in self._gaps:
            start = gap.start
            while start < gap.stop:
                stop = min(gap.stop, (start // self._chunk + 1) * self._chunk)
                yield range(start, stop)
                start = stop

    def add(self, samples: range, rows: Rows) -> None:
        """Write a finished chunk, whole or not at all.

        Raises
        ------
        RowsError
            If its columns do not go with those of the other chunks.
        OutputError
            If it cannot be written; the chunks written before stay.
        FolderError
            If the folder was removed meanwhile.
        """
        schema = unified([self._schema, rows.schema] if self._schema else [rows.schema])
        path = chunk_path(self.folder, samples)
        with self._saying_what_is_kept():
            self._require_folder()
            path.parent.mkdir(exist_ok=True)
            with whole_file(path, parents=False) as temporary, temporary.open("wb") as file:
                file.write(rows.parquet)
                file.flush()
                os.fsync(file.fileno())
            settle(path.parent)
        self._schema = schema
        self.done += len(samples)
        self.verdicts.update(rows.verdicts)

    def finish(self) -> Path:
        """Write the rows of all chunks into one file, sorted by sample, and return its path.

        Raises
        ------
        FolderError
            If samples are missing, as those whose chunks were removed meanwhile: no other chunk is touched then.
        OutputError
            If it cannot be written.
        """
        if self.done != self.samples:
            raise FolderError("the campaign is not complete", got=f"{self.done} of {self.samples} samples")
        with self._saying_what_is_kept():
            self._require_folder()
            files = stored(self.folder)
            if lost := sum(map(len, gaps(files, self.samples))):
                self.done -= lost
                raise self._gone()
            path = write_all(self.folder, unified(schema_of(file) for file in files), self.samples)
            with suppress(OSError):  # somebody else's files are in it
                (self.folder / CHUNKS).rmdir()
        return path

    def own_runs(self, names: Collection[str]) -> None:
        """Note the files of full runs that the campaign may remove again: before the first of them is written."""
        if sorted(names) != self.manifest.runs:
            self.manifest = self.manifest.model_copy(update={"runs": sorted(names)})
            self.manifest.save(self.folder)

    def _require_folder(self) -> None:
        """Raise FolderError if the folder was removed, or is another one by now; what is left in it stays usable."""
        ours = self._is_ours()
        if (ours or (self.folder / CHUNKS).exists()) and not (self.folder / NAME).exists():
            self.manifest.save(self.folder)  # without it nobody could go on with the chunks
        if not ours:
            raise self._gone()

    def _gone(self) -> FolderError:
        return FolderError(
            f"files of the campaign were removed from {self.folder} while it ran",
            got=f"{self.done} of {self.samples} samples at most",
            try_="the same again: only the missing ones are run",
        )

    @contextmanager
    def _saying_what_is_kept(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            if isinstance(error, FileNotFoundError):
                raise self._gone() from error
            raise self._unwritable(f"cannot write into {self.folder}", error.strerror or error) from error
        except OutputError as error:
            if isinstance(error.__cause__, FileNotFoundError):
                raise self._gone() from error
            raise self._unwritable(error.what, error.got) from error

    def _unwritable(self, what: str, reason: object) -> OutputError:
        return OutputError(
            what,
            got=f"{reason}; {self.done} of {self.samples} samples are kept",
            try_="freeing disk space and the same again: only the missing ones are run",
        )

    def _sound(self, file: Stored) -> bool:
        """Return whether a file can be read to its end, and count what is in it; a broken chunk is removed."""
        verdicts = Counter[str]()
        try:
            for part in parts(file):
                verdicts.update(verdicts_in(part))
            schema = schema_of(file)
        except DamagedError:
            if file.path.name == ALL:  # all the work, of which some can perhaps be saved: not ours to remove
                raise
            file.path.unlink(missing_ok=True)
            self.damaged.append(file.path)
            return False
        self._schema = unified([self._schema, schema] if self._schema else [schema])
        self.verdicts.update(verdicts)
        return True


def _require_no_others(folder: Path, beside: Collection[str]) -> None:
    """Raise FolderError if a folder without a campaign holds files that a campaign would take for its own."""
    if (folder / NAME).exists():
        return
    if (folder / ALL).exists() or (folder / CHUNKS).exists():
        raise FolderError(
            f"{folder} holds rows of an unknown campaign", got=f"no {NAME}", try_="another folder"
        )
    for name in beside:
        there = folder.glob(name) if "*" in name else filter(os.path.lexists, [folder / name])
        for path in there:
            what = f"{path} is none that this campaign wrote"
            raise FolderError(what, try_="another folder, or move it away")


def _sweep(folder: Path) -> None:
    """Remove what killed processes left half-written: rows, and what is made of them in the same folder."""
    for inner in (folder, folder / CHUNKS, folder / "runs"):
        for left in inner.glob(".*"):
            if is_half_written(left) and left.is_file():
                left.unlink(missing_ok=True)
