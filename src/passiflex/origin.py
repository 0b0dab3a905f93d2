"""Which package wrote a result: its version, and the commit of its source."""

from __future__ import annotations

import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path


def package_version() -> str:
    """Return the installed version."""
    try:
        return version("passiflex")
    except PackageNotFoundError:
        return "unknown"


@cache
def source_commit() -> str:
    """Return the git commit of the source, with `+` if it was changed since; "unknown" outside a checkout."""
    folder = Path(__file__).parent

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(folder), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()

    try:
        git(
            "ls-files", "--error-unmatch", __file__
        )  # an installed copy may lie inside somebody else's checkout
        changed = "+" if git("status", "--porcelain", "--", str(folder)) else ""
        return git("rev-parse", "HEAD") + changed
    except (OSError, subprocess.SubprocessError):
        return "unknown"
