"""Tables of numbers as text: a line of names, then lines of as many numbers, with commas between (CSV)."""

from __future__ import annotations

import base64
import binascii
import re
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.texts.quantity import shown
from passiflex.texts.text_file import IN_YAML, UnreadableError, decoded, read_bytes

MOST_BYTES = 20_000_000
"""Of the file of a table."""
PACKED = "zlib, base64: "
"""How the text of a table begins that was packed to be kept in a file of its own kind."""
LONG = 20_000
"""Characters from which a text is packed."""
MOST_PACKED = 3_500_000
"""Characters of a packed text: what holds it is read back as YAML."""
_DECIMAL_COMMAS = re.compile(r"\d,\d")
_NUMBERS = re.compile(r"[\s+\-.\deEinfaINFA,;]*\d[\s+\-.\deEinfaINFA,;]*")


class NumberTable(NamedTuple):
    """Names of the columns, the numbers (rows, columns), and on which line of the text each row stands, from 1."""

    names: tuple[str, ...]
    numbers: NDArray[np.float64]
    lines: NDArray[np.int64]


def read_table_text(path: Path) -> str:
    """Return the text of a table's file.

    Raises
    ------
    UnreadableError
        If it cannot be read, is no text or larger than 20 MB.
    """
    return decoded(read_bytes(path, MOST_BYTES), IN_YAML)


def packed(text: str) -> str:
    """Return a text as it is, or packed if it is long.

    Raises
    ------
    UnreadableError
        If it is too long even so.
    """
    if len(text) < LONG or text.startswith(PACKED):
        return text
    out = PACKED + base64.b64encode(zlib.compress(text.encode(), 6)).decode()
    if len(out) > MOST_PACKED:
        raise UnreadableError(
            f"{len(out) / 1e6:.1f} MB when packed, at most {MOST_PACKED / 1e6:g} MB can be kept beside a result; "
            "try fewer rows, or numbers of six digits"
        )
    return out


def unpacked(text: str) -> str:
    """Return the text that was packed.

    Raises
    ------
    UnreadableError
        If it is damaged, or unpacks to more than a table may have.
    """
    if not text.startswith(PACKED):
        return text
    try:
        data = zlib.decompressobj()
        out = data.decompress(base64.b64decode(text.removeprefix(PACKED), validate=True), MOST_BYTES)
        if data.unconsumed_tail or not data.eof:
            raise ValueError
        return out.decode()
    except (zlib.error, binascii.Error, ValueError):
        raise UnreadableError("the packed rows are damaged; give the table's file anew") from None


def written(names: Iterable[str], numbers: NDArray[np.float64]) -> str:
    """Return the text of a table, exact to the last bit."""
    lines = [",".join(names), *(",".join(map(repr, row)) for row in numbers.tolist())]
    return "\n".join(lines) + "\n"


def parsed(text: str) -> NumberTable:
    """Return the names and numbers of a text; lines that are empty or begin with # are passed over.

    Raises
    ------
    ValueError
        With line and remedy, for what is no such table.
    """
    lines = list(_content(text))
    if not lines:
        raise ValueError(
            "is empty; needs a line with the names of the columns, as t,x,y,z, and a line for each row"
        )
    first, head = lines[0]
    names = tuple(cell.strip().strip('"') for cell in head.split(","))
    _require_head(first, head, lines[1][1] if len(lines) > 1 else "")
    body = [line.split(",") for _, line in lines[1:]]
    where = np.array([number for number, _ in lines[1:]], dtype=np.int64)
    if not body:
        raise ValueError(f"line {first} names columns, and there is no row below")
    try:
        numbers = np.array(body, dtype=np.float64)
    except ValueError:
        numbers = None
    if numbers is None or numbers.shape[1:] != (len(names),) or not np.isfinite(numbers).all():
        raise ValueError(_first_mistake(names, lines[1:]))
    return NumberTable(names, numbers, where)


def _content(text: str) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(text.splitlines(), 1):
        if (bare := line.strip()) and not bare.startswith("#"):
            yield number, bare


def _require_head(number: int, head: str, row: str) -> None:
    for mark, word in ((";", "semicolons"), ("\t", "tabs")):
        if mark in head:
            commas = " and decimal commas" if _DECIMAL_COMMAS.search(row) else ""
            raise ValueError(
                f"line {number}: {word} between the columns{commas}; save it with commas between the columns "
                "and decimal points"
            )
    if "\0" in head:
        raise ValueError(f"line {number}: not a text; save the table as CSV")
    if _NUMBERS.fullmatch(head):
        raise ValueError(
            f"line {number}: expected the names of the columns, as t,x,y,z; got {shown(head)}; add a first line"
        )
    names = [cell.strip().strip('"') for cell in head.split(",")]
    for name in names:
        if names.count(name) > 1:
            what = f"column {name!r} is there twice" if name else "two columns without a name"
            raise ValueError(f"line {number}: {what}; remove one")


def _first_mistake(names: tuple[str, ...], lines: list[tuple[int, str]]) -> str:
    for number, line in lines:
        cells = [cell.strip() for cell in line.split(",")]
        if len(cells) != len(names):
            comma = "; with decimal commas? write 0.1, not 0,1" if len(cells) > len(names) else ""
            return f"line {number}: {len(cells)} cells, but {len(names)} columns have a name{comma}"
        for name, cell in zip(names, cells, strict=True):
            if not cell:
                return (
                    f"line {number}, column {name}: empty; fill it, or leave the whole row out: what was told "
                    "last then goes on"
                )
            try:
                value = float(cell)
            except ValueError:
                return f"line {number}, column {name}: expected a number; got {shown(cell)}"
            if not np.isfinite(value):
                return (
                    f"line {number}, column {name}: got {shown(cell)}, which is not finite; leave the row out: "
                    "what was told last then goes on"
                )
    return "cannot be read as numbers"
