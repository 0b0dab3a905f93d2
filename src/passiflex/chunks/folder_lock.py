"""One process at a time in a campaign's folder."""

from __future__ import annotations

import fcntl
import os
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from passiflex.errors import PassiflexError
from passiflex.files import OutputError

NAME = ".lock"
OWNER = b"process"
"""How the file begins."""


class FolderInUseError(PassiflexError):
    """Another process works in the folder."""


@contextmanager
def locked(folder: Path) -> Iterator[Callable[[], bool]]:
    """Hold the folder's lock; the operating system frees it when the process ends, however it ends.

    Gives a function that says whether it is still the lock of a folder of this name: both may be removed.

    The file stays: were it removed, two processes could hold locks on two files of that name.

    Raises
    ------
    FolderInUseError
        If another process holds it.
    OutputError
        If the file system has no locks or is full.
    """
    try:
        handle = os.open(folder / NAME, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise OutputError(f"cannot write into {folder}", got=error.strerror) from error
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.pread(handle, len(OWNER), 0) in (b"", OWNER):  # else the file is somebody's own
                os.ftruncate(handle, 0)
                os.pwrite(handle, OWNER + f" {os.getpid()} on {socket.gethostname()}".encode(), 0)
        except BlockingIOError:
            owner = os.pread(handle, 200, 0).decode(errors="replace") or "another process"
            raise FolderInUseError(
                f"a campaign is running in {folder}",
                got=f"the lock of {owner}",
                try_="another folder, or waiting",
            ) from None
        except OSError as error:
            raise OutputError(f"cannot lock {folder}", got=error.strerror) from error
        yield lambda: _is_at(handle, folder / NAME)
    finally:
        os.close(handle)


def _is_at(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except OSError:
        return False
