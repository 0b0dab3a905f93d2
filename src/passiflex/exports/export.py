"""One function to export a run: the file's ending says which program it is for."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

from passiflex.errors import NameUnknownError, ValueRangeError
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
GROUP = "passiflex.exports"
"""Entry points of other packages: the name is an ending, as `.mat`, the object what writes a run to a path."""


def formats() -> dict[str, Callable[[Run, Path], None]]:
    """Return what writes each kind of file: ours, and those of other packages that are installed."""
    others = {f".{e.name.removeprefix('.')}": e for e in entry_points(group=GROUP)}
    return {ending: _loaded(e) for ending, e in others.items()} | FORMATS


def _loaded(point: EntryPoint) -> Callable[[Run, Path], None]:
    """Return what an entry point names, imported when a run is written."""

    def write(run: Run, path: Path) -> None:
        try:
            found = point.load()
        except (ImportError, AttributeError) as error:
            what = f"the entry point {point.name!r} of {GROUP} names nothing"
            raise ValueRangeError(
                what, got=f"{point.value}: {error}", needs="a function of run and path"
            ) from None
        found(run, path)

    return write


def export_run(run: Run, path: str | Path) -> Path:
    """Write a run for another program, the whole file or none, and return its path.

    `.csv` is a table of all signals over time; `.rrd` a Rerun recording with the moving arm; `.mcap` ROS 2
    messages, which Foxglove and PlotJuggler open. Other packages may bring further endings (`GROUP`).

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
    known = formats()
    write = known.get(path.suffix)
    if write is None:
        raise NameUnknownError("ending of an export", path.suffix, known)
    with whole_file(path) as temporary:
        write(run, temporary)
    return path
