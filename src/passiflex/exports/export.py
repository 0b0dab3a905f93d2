"""One function to export a run: the file's ending says which program it is for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from passiflex.errors import NameUnknownError
from passiflex.exports.csv_file import write_csv
from passiflex.exports.mcap_file import write_mcap
from passiflex.exports.rrd_file import write_rrd
from passiflex.files import whole_file
from passiflex.runs.run import Run

FORMATS: dict[str, Callable[[Run, Path], None]] = {
    ".csv": write_csv,
    ".mcap": write_mcap,
    ".rrd": write_rrd,
}
"""Ending of a file → what writes it."""


def export_run(run: Run, path: str | Path) -> Path:
    """Write a run for another program, the whole file or none, and return its path.

    `.csv` is a table of all signals over time; `.rrd` a Rerun recording with the moving arm; `.mcap` ROS 2
    messages, which Foxglove and PlotJuggler open.

    Raises
    ------
    NameUnknownError
        If the path has another ending.
    MissingExtraError
        If the package that writes this kind of file is not installed.
    OutputError
        If the file cannot be written.
    """
    path = Path(path)
    write = FORMATS.get(path.suffix)
    if write is None:
        raise NameUnknownError("ending of an export", path.suffix, FORMATS)
    with whole_file(path) as temporary:
        write(run, temporary)
    return path
