"""Which of the package's files a file is: said where one is given in place of another."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from passiflex.texts.text_file import IN_YAML, UnreadableError, decoded, read_bytes
from passiflex.texts.yaml_tree import XML, RefusedText, Tree

KINDS = {
    "scenario": ("law", "passiflex simulate {} --out RUN.nc"),
    "campaign": ("scenario", "passiflex campaign {} --out FOLDER"),
    "robot file": ("urdf", "passiflex recommend {} --rate '1 kHz', or its path as the robot of a scenario"),
    "run": (None, "passiflex audit {0} or passiflex show {0}"),
    "URDF": (None, "a robot file (.yaml) that names it in its entry urdf"),
}
"""Kind of file → the entry that only its mapping has, and what to do with it."""

NETCDF = b"\x89HDF\r\n\x1a\n"
"""How a run begins."""


def of_another_kind(content: Mapping[str, Any], kind: str, path: str) -> str | None:
    """Return what to say of a mapping that is none of the kind that is wanted but another one; None if it is not."""
    other = _kind_of(content)
    return None if KINDS[kind][0] in content or other is None else _said(other, kind, path)


def another_file(path: Path, kind: str) -> str | None:
    """Return what to say of a file that is not of the kind that is wanted; None if it is, or of none, or not read."""
    if not os.path.isfile(path):
        return None
    try:
        with path.open("rb") as file:
            is_run = file.read(len(NETCDF)) == NETCDF
        text = "" if is_run else decoded(read_bytes(path), IN_YAML)
        other = "run" if is_run else "URDF" if XML.match(text) else _kind_of(Tree().read(text, ""))
    except (OSError, UnreadableError, RefusedText):
        return None
    return None if other in (None, kind) else _said(other, kind, str(path))


def _kind_of(content: Mapping[str, Any]) -> str | None:
    return next((kind for kind, (entry, _) in KINDS.items() if entry in content), None)


def _said(other: str, kind: str, path: str) -> str:
    return f"this is a {other}, not a {kind}; try {KINDS[other][1].format(path)}"
