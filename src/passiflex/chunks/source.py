"""Which code computed a row: a digest of the package's source."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
WITHOUT_EFFECT = ("diagrams", "plotting", "reports", "exports", "studies", "cli")
"""Rooms that no row comes from: campaigns cannot import them."""


@cache
def source_digest() -> str:
    """Return a digest of the source that rows come from, by content: the same in a checkout and a wheel.

    A process computes it once, when it first needs it: what is edited later is not what it has imported.
    """
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*")):
        within = path.relative_to(PACKAGE)
        hidden = any(part.startswith((".", "__pycache__")) for part in within.parts)
        if hidden or within.parts[0] in WITHOUT_EFFECT or not path.is_file():
            continue
        digest.update(f"{within.as_posix()}\0{path.stat().st_size}\0".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
