"""The text of a file that somebody else made: a regular file of bearable size, in the encoding that it says."""

from __future__ import annotations

import codecs
import errno
import os
import re
import stat
from pathlib import Path

MAX_BYTES = 1_000_000
"""Of a YAML file."""
IN_YAML = re.compile(rb"#[^\n]{0,200}?-\*-[^\n]{0,200}?coding:\s*([\w.-]{1,40})[^\n]{0,200}?-\*-")
IN_XML = re.compile(rb"\s*<\?xml[^>]{0,200}?\sencoding\s*=\s*[\"']([A-Za-z][\w.-]{0,40})[\"']")
"""Where the first bytes of a document name its encoding."""

YAMLS = (".yaml", ".yml")
URDFS = (".urdf", ".xacro", ".xml", ".sdf")
"""How the files of robots end."""

_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_UNMARKED = (
    (re.compile(rb"[^\0]\0\0\0"), "utf-32-le"),
    (re.compile(rb"\0\0\0[^\0]"), "utf-32-be"),
    (re.compile(rb"[^\0]\0"), "utf-16-le"),
    (re.compile(rb"\0[^\0]"), "utf-16-be"),
)
_WIDE = re.compile(r"(?:utf|ucs|iso-10646-ucs)[-_]?(?:16|32|2|4)(?:[-_]?[lb]e)?|unicode", re.IGNORECASE)
_NO_CHARACTER_SETS = ("idna", "punycode", "raw_unicode_escape", "unicode_escape", "utf_7")
_ASCII = bytes(range(0x20, 0x7F))


class UnreadableError(Exception):
    """There is no text to be had; the message says why, and whoever reads says of what."""


def is_path(name: str | Path) -> bool:
    """Return whether a robot is named by its file: by a path, or by what ends as such files do."""
    path = Path(name)
    return isinstance(name, Path) or path.suffix.lower() in (*YAMLS, *URDFS) or len(path.parts) > 1


def read_bytes(path: Path, most: int = MAX_BYTES) -> bytes:
    """Return what a regular file holds; nothing else is opened, no device and no pipe.

    Raises
    ------
    UnreadableError
        If there is no such file, or it has more than `most` bytes.
    """
    try:
        about = path.stat()
        if stat.S_ISDIR(about.st_mode):
            raise UnreadableError(os.strerror(errno.EISDIR))
        if not stat.S_ISREG(about.st_mode):
            raise UnreadableError("not a regular file")
        if not about.st_size:  # so are files of the kernel, whose reading may have no end
            return b""
        with path.open("rb") as file:
            data = file.read(most + 1)
    except (OSError, ValueError) as error:  # a name with a NUL is a ValueError
        raise UnreadableError(getattr(error, "strerror", None) or str(error)) from None
    if len(data) > most:
        raise UnreadableError(f"larger than {most / 1e6:g} MB")
    return data


def decoded(data: bytes, declared: re.Pattern[bytes]) -> str:
    """Return the text by its byte order mark, else by the encoding that its first bytes declare, else as UTF-8.

    Raises
    ------
    UnreadableError
        If the encoding is unknown, or the bytes are not in it.
    """
    encoding = _encoding(data, declared)
    try:
        return data.decode(encoding).removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        name = encoding.removesuffix("-le").removesuffix("-be")
        raise UnreadableError(f"not {name.upper() if name.startswith('utf') else name} text") from error


def _encoding(data: bytes, declared: re.Pattern[bytes]) -> str:
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return encoding
    for pattern, encoding in _UNMARKED:
        if pattern.match(data):
            return encoding
    found = declared.match(data)
    if not found:
        return "utf-8"
    name = found[1].decode("ascii", "replace")
    if _WIDE.fullmatch(name):
        return "utf-8"  # it was one of these before somebody saved it again: its declaration is plain ASCII
    try:
        if (
            codecs.lookup(name).name.replace("-", "_") in _NO_CHARACTER_SETS
            or _ASCII.decode(name) != _ASCII.decode()
        ):
            raise LookupError
    except (LookupError, UnicodeError, ValueError):
        raise UnreadableError(f"unknown encoding {name!r}; save it as UTF-8") from None
    return name
