"""One process at a time in a campaign's folder."""

from __future__ import annotations

import fcntl
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from passiflex.errors import PassiflexError
from passiflex.files import OutputError

NAME = ".lock"


class FolderInUseError(PassiflexError):
    """Another process works in the folder."""


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the folder's lock; the operating system frees it when the process ends, however it ends.

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
            os.ftruncate(handle, 0)
            os.pwrite(handle, f"process {os.getpid()} on {socket.gethostname()}".encode(), 0)
        except BlockingIOError:
            owner = os.pread(handle, 200, 0).decode(errors="replace") or "another process"
            raise FolderInUseError(
                f"a campaign is running in {folder}",
                got=f"the lock of {owner}",
                try_="another folder, or waiting",
            ) from None
        except OSError as error:
            raise OutputError(f"cannot lock {folder}", got=error.strerror) from error
        yield
    finally:
        os.close(handle)
