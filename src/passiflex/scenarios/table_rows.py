"""The rows of a table in a scenario: read from its file at once, and kept as text, so that no run opens it again."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from passiflex.texts.number_table import packed, read_table_text
from passiflex.texts.quantity import shown
from passiflex.texts.section import Mistakes
from passiflex.texts.text_file import UnreadableError


def with_rows(written: dict[str, Any]) -> dict[str, Any]:
    """Return what was written for a table, `table` or `rows`, with `rows`, packed if long, and their `source`.

    Raises
    ------
    Mistakes
        For a file that cannot be read, or where there is neither.
    """
    data = dict(written)
    name, source = data.pop("table", None) or None, "rows"
    rows: Any = data.get("rows")
    if name is None and rows is None:
        raise Mistakes((("table",), "missing: path of a CSV file"))
    if name is not None and (not isinstance(name, str | os.PathLike) or not str(name).strip()):
        raise Mistakes((("table",), f"expected the path of a CSV file; got {shown(name)}"))
    if name is None and not isinstance(rows, str):
        raise Mistakes((("rows",), f"expected the text of a table; got {shown(rows)}"))
    try:
        if name is not None:
            data["source"] = source = Path(name).name
            rows = read_table_text(Path(name))
        data["rows"] = packed(rows)
    except UnreadableError as error:
        raise Mistakes((("table",), f"{source} cannot be read: {error}")) from None
    return data


def in_file(source: str, mistake: str) -> str:
    """Return a mistake of the rows with the name of their file."""
    return f"{source or 'rows'}{', ' if mistake.startswith('line') else ': '}{mistake}"
