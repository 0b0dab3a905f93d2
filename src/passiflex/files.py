"""Whole files or none: results are written under a temporary name and then moved; what is read back is bounded."""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

from passiflex.errors import ArgumentError, PassiflexError

_LONGEST_STEM = 40
"""Characters of a file's name that its temporary has in its own, which may not be too long."""


class OutputError(PassiflexError):
    """A result cannot be written."""


def as_path(given: object, of: str) -> Path:
    """Return the path that was given.

    Raises
    ------
    ArgumentError
        If it is none; `of` says of what it should be one.
    """
    if isinstance(given, str | os.PathLike) and isinstance(name := os.fspath(given), str) and name.strip():
        return Path(name)
    raise ArgumentError(given, f"the path of {of}")


@contextmanager
def whole_file(path: Path, *, parents: bool = True) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to, and move it there if the block succeeds.

    A link is written through. A new file has the mode of the umask, one that was there keeps its own.

    Parameters
    ----------
    parents: Whether the folder is made if it is missing.

    Raises
    ------
    OutputError
        If the folder cannot be made or written, the disk is full, or `path` is there and no regular file.
    """
    path = Path(path)
    temporary = None
    try:
        target = Path(os.path.realpath(path)) if path.is_symlink() else path
        if parents:
            target.parent.mkdir(parents=True, exist_ok=True)
        mode = _mode_of(target)
        temporary = _new_file(target)
        yield temporary
        if mode is not None:
            temporary.chmod(mode)
        os.replace(temporary, target)
    except OSError as error:
        raise OutputError(
            f"cannot write {path}", got=error.strerror or error, try_="another folder, or freeing disk space"
        ) from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def is_half_written(path: Path) -> bool:
    """Return whether a file is what a killed process left of `whole_file`: its name then ends with its own digest."""
    begin, _, digest = path.stem.rpartition("-")
    return path.name.startswith(".") and len(digest) == 8 and digest == _digest(begin + path.suffix)


def read_regular(path: Path, most: int) -> bytes:
    """Return what a file holds.

    Raises
    ------
    OSError
        If it cannot be read.
    ValueError
        If it is no regular file, as a device or pipe, or larger than `most` bytes.
    """
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    with open(handle, "rb") as file:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise ValueError("no regular file")
        data = file.read(most + 1)
    if len(data) > most:
        raise ValueError(f"larger than {most / 1e6:g} MB")
    return data


def read_json(text: str) -> Any:
    """Return what a JSON text says.

    Raises
    ------
    ValueError
        If it is none, has a name twice in one mapping or a number that is none, or is nested too deeply.
    """
    try:
        return json.loads(text, object_pairs_hook=_named_once, parse_constant=_no_number)
    except RecursionError:
        raise ValueError("nested too deeply") from None


def _named_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    named: dict[str, Any] = {}
    for name, value in pairs:
        if name in named:
            raise ValueError(f"{name[:40]!r} is there twice")
        named[name] = value
    return named


def _no_number(word: str) -> NoReturn:
    raise ValueError(f"{word} is no number")


def require_writable(folder: Path) -> None:
    """Make `folder`, and raise OutputError unless files can be written there: better before the work than after."""
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(
            f"cannot write into {folder}", got=error.strerror or error, try_="another folder"
        ) from error


def _mode_of(target: Path) -> int | None:
    """Return the mode of a file that is there; a device, pipe or folder is not to be replaced."""
    try:
        mode = target.stat().st_mode
    except FileNotFoundError:
        return None
    if not stat.S_ISREG(mode):
        raise OSError(f"{'a folder' if stat.S_ISDIR(mode) else 'no regular file'} is there")
    return stat.S_IMODE(mode) & 0o777


def _new_file(target: Path) -> Path:
    """Return a new, empty file beside `target`; its name says that it is nothing else."""
    while True:
        begin = f".{target.stem[:_LONGEST_STEM]}-{secrets.token_hex(4)}"
        path = target.with_name(f"{begin}-{_digest(begin + target.suffix)}{target.suffix}")
        try:
            os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        except FileExistsError:
            continue
        return path


def _digest(name: str) -> str:
    return hashlib.blake2b(os.fsencode(name), digest_size=4, person=b"passiflex").hexdigest()
