"""Which of the package's files a YAML mapping is: said where one is given in place of another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

KINDS = {
    "scenario": ("law", "passiflex simulate {} --out RUN.nc"),
    "campaign": ("scenario", "passiflex campaign {} --out FOLDER"),
    "robot file": ("urdf", "passiflex recommend {} --rate '1 kHz', or its path as the robot of a scenario"),
}
"""Kind of file → an entry that only it has, and what to do with it."""


def of_another_kind(content: Mapping[str, Any], kind: str, path: str) -> str | None:
    """Return what to say of a mapping that is none of the kind that is wanted but another one; None if it is not."""
    if KINDS[kind][0] in content:
        return None
    for other, (entry, use) in KINDS.items():
        if entry in content:
            return f"this is a {other}, not a {kind}; try {use.format(path)}"
    return None
