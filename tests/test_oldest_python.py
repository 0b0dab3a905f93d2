"""Nothing is used that a later patch release brought; what came with a minor release, `make check` finds.

Patch releases bring hardly anything, and only with repairs of security: this is all of it since 3.11.0, by the
"Changed in version" notes of the standard library.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = [
    path
    for folder in ("src", "tests", "benchmarks", "docs")
    for path in sorted((ROOT / folder).rglob("*.py"))
    if "_build" not in path.parts
] + [ROOT / "hatch_build.py"]

KEYWORDS = {
    "filter": {"extract", "extractall", "unpack_archive"},  # 3.11.4
    "strict": {"getaddresses", "parseaddr"},  # 3.11.10
}
"""Keyword → the calls that do not have it in the oldest release."""
NAMES = {
    "data_filter", "tar_filter", "fully_trusted_filter", "extraction_filter", "FilterError",  # tarfile, 3.11.4
    "GetReparseDeferralEnabled", "SetReparseDeferralEnabled",  # xml.parsers.expat, 3.11.9
}  # fmt: skip
"""Attributes that the oldest release has not."""


def too_new(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and name of what the oldest patch release lacks."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            for keyword in node.keywords:
                if called in KEYWORDS.get(keyword.arg or "", ()):
                    yield node.lineno, f"{called}({keyword.arg}=)"
        elif isinstance(node, ast.Attribute) and node.attr in NAMES:
            yield node.lineno, node.attr


def test_it_is_found() -> None:
    assert list(
        too_new("import tarfile\nwith tarfile.open(p) as t:\n    t.extractall(q, filter='data')")
    ) == [(3, "extractall(filter=)")]
    assert list(too_new("tarfile.data_filter")) == [(1, "data_filter")]


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_nothing_is_too_new(path: Path) -> None:
    assert list(too_new(path.read_text(encoding="utf-8"))) == []
