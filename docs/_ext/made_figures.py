"""Figures of the pages, made by the package while the documentation is built, into `docs/generated`."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.util import logging

SOURCE = Path(__file__).parents[2] / "src" / "passiflex"
log = logging.getLogger(__name__)


def sampled(folder: Path) -> Path:
    """Return the figure of the study `sampled`."""
    from passiflex.studies.sampled import reproduce_sampled

    reproduce_sampled(folder)
    return folder / "sampled.png"


MAKERS: dict[str, Callable[[Path], Path]] = {"sampled.png": sampled}


def make(app: Sphinx) -> None:
    """Make every figure that is missing, or older than the package."""
    changed = max(path.stat().st_mtime for path in SOURCE.rglob("*") if path.suffix in (".py", ".c", ".yaml"))
    target = Path(app.srcdir) / "generated"
    target.mkdir(exist_ok=True)
    for name, maker in MAKERS.items():
        figure = target / name
        if figure.exists() and figure.stat().st_mtime > changed:
            continue
        log.info("making %s", name)
        with tempfile.TemporaryDirectory() as folder:
            shutil.copy(maker(Path(folder)), figure)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to Sphinx."""
    app.connect("builder-inited", make)
    return {"parallel_read_safe": True}
