"""The package's docstrings, for Sphinx: sections of `name: text` lines, indented formulas, plain text."""

from __future__ import annotations

import re
from typing import Any

from pydantic import BaseModel
from sphinx.application import Sphinx

ENTRY = re.compile(r"(\w[\w, ]*): (.*)")
CODE = re.compile(r"(`[^`]+`)")
ARRAY = re.compile(r"~?numpy\.ndarray\[tuple\[~?typing\.Any, \.\.\.\], ~?numpy\.dtype\[~?numpy\.float64\]\]")
EMPHASIS = re.compile(r"(?<!\w)(\*\w[\w ]*\*)(?!\w)")


def plain(text: str) -> str:
    """Return text in which only `code` and *emphasis* are marked up."""
    out = []
    for i, part in enumerate(CODE.split(text)):
        if i % 2:
            out.append(f"`{part}`")
            continue
        for j, piece in enumerate(EMPHASIS.split(part)):
            out.append(piece if j % 2 else re.sub(r"([\\*|]|_(?!\w))", r"\\\1", piece))
    return "".join(out)


def restructured(lines: list[str]) -> list[str]:
    """Return a docstring as reStructuredText."""
    out: list[str] = []
    section, formula = "", False
    for i, line in enumerate(lines):
        indented = line.startswith("    ")
        if re.fullmatch("-{3,}", line):
            continue
        if i + 1 < len(lines) and line and re.fullmatch("-{3,}", lines[i + 1]):
            section = line
            out += [f".. rubric:: {line}", ""]
        elif section:
            entry = ENTRY.fullmatch(line)
            if entry and section in ("Parameters", "Attributes"):
                out += [f"``{entry[1]}``", f"    {plain(entry[2])}"]
            elif section == "Raises" and line and not indented:
                out.append(f"``{line}``")
            else:
                out.append(line if not line else f"{'    ' * indented}{plain(line.strip())}")
        elif indented and not formula and not (out and out[-1]):
            formula = True
            out += ["::", "", line]
        else:
            if line and not indented:
                if formula and out[-1]:
                    out.append("")
                formula = False
            out.append(line if formula else plain(line))
    return [*out, ""]


def process(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Rewrite one docstring in place."""
    lines[:] = restructured(list(lines))


def sign(app: Sphinx, what: str, name: str, obj: Any, options: Any, signature: str, returns: str) -> Any:
    """Shorten a signature; that of a scenario's sections is left out, as their tables say more."""
    if isinstance(obj, type) and issubclass(obj, BaseModel):
        return "", ""
    short = [t and ARRAY.sub("~numpy.ndarray", t).replace("<factory>", "...") for t in (signature, returns)]
    return tuple(short)


def skip(app: Sphinx, what: str, name: str, obj: Any, skipped: bool, options: Any) -> bool | None:
    """Leave out what a room only imports, and the positions of a named tuple's fields."""
    foreign = not str(getattr(obj, "__module__", None) or "passiflex").startswith("passiflex")
    return True if foreign or type(obj).__name__ == "_tuplegetter" else None


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the three."""
    app.connect("autodoc-process-docstring", process)
    app.connect("autodoc-process-signature", sign)
    app.connect("autodoc-skip-member", skip)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
