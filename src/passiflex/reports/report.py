"""A run as one HTML file, to look at and to pass on."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Sequence
from pathlib import Path

from passiflex.diagrams import Viewed
from passiflex.errors import ArgumentError
from passiflex.files import OutputError, whole_file
from passiflex.reports.header import content
from passiflex.reports.page import page_text
from passiflex.reports.screen import open_in_browser
from passiflex.reports.viewer import read_viewer
from passiflex.simulation import Run

ENDINGS = (".html", ".htm")


def report_text(run: Run, others: Sequence[Run | Viewed] = (), notices: Sequence[str] = ()) -> str:
    """Return the report of a run: HTML that needs no other file and no network.

    The same runs give the same text.

    Parameters
    ----------
    others: Runs to compare it with; as `Viewed` with a label, otherwise under their names.
    notices: Sentences shown at the top, as `salvage` gives them.

    Raises
    ------
    ViewerError
        If the viewer of reports is not built.
    ArgumentError
        If it is no run, as the path of one.
    """
    if not isinstance(run, Run):
        raise ArgumentError(run, "a run, as simulate returns", "Run.load for a file")
    viewer = read_viewer()
    header, data = content(run, others, notices)
    return page_text(header["title"], header, data, viewer)


def write_report(
    run: Run, path: str | Path, others: Sequence[Run | Viewed] = (), notices: Sequence[str] = ()
) -> Path:
    """Write the report of a run, whole or not at all, and return its path; the rest as for `report_text`.

    Raises
    ------
    OutputError
        If the file cannot be written, or its name does not end as that of a page: a run is not written over.
    """
    path = Path(path)
    if path.suffix not in ENDINGS:
        needs = f"a file name that ends in {' or '.join(ENDINGS)}"
        raise OutputError("wrong name for a report", got=str(path), needs=needs)
    return _written(report_text(run, others, notices), path)


def show(
    run: Run,
    out: str | Path | None = None,
    others: Sequence[Run | Viewed] = (),
    notices: Sequence[str] = (),
) -> Path:
    """Write the report of a run, and return its path.

    Parameters
    ----------
    out: The file to write; None writes into a new folder among the temporary files, and opens the page in a
        browser where there is a screen.
    """
    if out is not None:
        return write_report(run, out, others, notices)
    text = report_text(run, others, notices)
    name = re.sub(r"[^A-Za-z0-9_.-]", "_", run.name)[:100].lstrip(".") or "run"
    path = _written(text, Path(tempfile.mkdtemp(prefix="passiflex-")) / f"{name}.html")
    open_in_browser(path)
    return path


def _written(text: str, path: Path) -> Path:
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return path
