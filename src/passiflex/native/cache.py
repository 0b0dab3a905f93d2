"""Which libraries are loaded: those that this user made, and that are what was written, to the last bit."""

from __future__ import annotations

import ctypes
import os
import stat
from pathlib import Path

import platformdirs

from passiflex.errors import CompilerError
from passiflex.native.builder import is_sealed

_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


class DistrustError(CompilerError):
    """A folder of libraries is not this user's alone."""


class NoCacheError(CompilerError):
    """There is no place for a cache."""


def cache_folder() -> Path:
    """Return the folder of compiled libraries: `$PASSIFLEX_CACHE`, else the user's cache folder.

    Raises
    ------
    NoCacheError
        If the user has no home.
    """
    try:
        return Path(os.environ.get("PASSIFLEX_CACHE") or platformdirs.user_cache_dir("passiflex")).absolute()
    except (RuntimeError, KeyError) as error:
        raise NoCacheError("there is no cache folder", got=error) from error


def own_folder(folder: Path) -> Path:
    """Return the real path of a folder of libraries, after making sure whose it is.

    Nobody but this user may be able to put anything into it. A folder above it that all may write is no place
    for it, unless it has the sticky bit, as /tmp has.

    Raises
    ------
    OSError
        If it is not there.
    DistrustError
        If it is another user's, or others may write it.
    """
    real = folder.resolve(strict=True)
    about = real.stat()
    if about.st_uid != os.geteuid():
        raise DistrustError(f"{real} is not this user's", got=f"user {about.st_uid}")
    for place, forbidden in [(real, _OTHERS_WRITE), *((above, stat.S_IWOTH) for above in real.parents)]:
        mode = place.stat().st_mode
        if mode & forbidden and not (place != real and mode & stat.S_ISVTX):
            raise DistrustError(f"others can write {place}", got=f"mode {stat.S_IMODE(mode):o}")
    return real


def is_there(path: Path) -> bool:
    """Return whether anything has this name, be it a link that leads nowhere."""
    return os.path.lexists(path)


def loads(path: Path) -> bool:
    """Return whether `path` is a library that can be loaded; before anything of it runs, it is made sure of.

    Absent, empty, damaged and other users' files are none, nor are links, folders and pipes.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return False
    with open(handle, "rb") as file:
        about = os.fstat(handle)
        if not stat.S_ISREG(about.st_mode) or about.st_uid != os.geteuid() or about.st_mode & _OTHERS_WRITE:
            return False
        try:
            if not is_sealed(file.read()):
                return False
            ctypes.CDLL(str(path))
        except OSError:
            return False
    return True


def make_folder(folder: Path) -> Path:
    """Make a folder and those above it, which nobody but this user may ever write, whatever the umask; return it."""
    if not folder.is_dir():
        make_folder(folder.parent)
        try:
            folder.mkdir(mode=0o755)
        except FileExistsError:
            if not folder.is_dir():  # another process has made it meanwhile, or a file is in the way
                raise
    return folder
