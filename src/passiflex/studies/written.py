"""What a study leaves behind: one figure, one page, the runs on it, one table, and its part of the summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from passiflex.diagrams import Viewed
from passiflex.files import whole_file
from passiflex.plotting.figures import save_figure
from passiflex.reports import write_report
from passiflex.simulation import Run
from passiflex.studies.summary import plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Written = tuple[list[Path], dict[str, Any]]
"""The files of a study, and its part of the summary."""


def write_study(
    name: str,
    folder: Path,
    figure: Figure,
    shown: Mapping[str, Run],
    table: Sequence[Sequence[str]],
    numbers: Mapping[str, Any],
) -> Written:
    """Write all of it into a folder.

    Parameters
    ----------
    shown: Runs by their titles; the page is on the first one, the others are beside it.
    table: Head and rows, in Markdown.
    numbers: For the summary, by the names of the cases.
    """
    first, *others = (Viewed(run, title) for title, run in shown.items())
    page = write_report(first.run, folder / f"{name}.html", others)
    runs = [run.save(folder / f"{run.name}.nc") for run in shown.values()]
    head, *rows = table
    lines = [f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows)]
    with whole_file(folder / f"{name}.md") as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    paths = [*save_figure(figure, folder / name), page, folder / f"{name}.md", *runs]
    return paths, {f"{name}_{case}": plain(dict(found)) for case, found in numbers.items()}
