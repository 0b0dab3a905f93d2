"""The commands that look at runs: show, plot, export, which read damaged files too; and export-model, for a robot."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import cyclopts

from passiflex.cli.terminal import console, timed

if TYPE_CHECKING:
    from passiflex.runs.salvaged import Salvaged

Compared = Annotated[
    tuple[Path, ...],
    cyclopts.Parameter(
        name="--compare", help="further runs to show beside it", consume_multiple=True, negative=""
    ),
]

DRAWN = (".png", ".pdf", ".svg")


def show(
    run: Path,
    /,
    *,
    compare: Compared = (),
    out: Annotated[
        Path | None,
        cyclopts.Parameter(help="HTML file to write; without it RUN.html, opened if there is a screen"),
    ] = None,
) -> int:
    """Write a run as one HTML file that needs nothing else: the moving arm in 3D beside its signals.

    The first run has the controls; those of --compare stand beside it as ghosts and thin lines.
    """
    from passiflex.reports import open_in_browser, write_report

    with timed():
        target = _target(out, ".html", (".html", ".htm"), run, *compare)
        first, *others = _read(run, *compare)
        notices = list(first.notices)
        for path, other in zip(compare, others, strict=True):
            notices += [f"{path.name}: {notice}" for notice in other.notices]
        written = write_report(first.run, target, [other.run for other in others], notices)
        console.print(f"wrote {written}")
        if out is None and open_in_browser(written):
            console.print("opened it in the browser")
    return 0


def plot(
    run: Path,
    /,
    *,
    kind: Annotated[
        Literal["energy", "tracking", "torque", "port", "contact"],
        cyclopts.Parameter(help="what to draw over time"),
    ],
    compare: Compared = (),
    size: Annotated[
        Literal["column", "double", "slide"],
        cyclopts.Parameter(help="one or two columns of a paper, or a slide"),
    ] = "double",
    out: Annotated[
        Path | None, cyclopts.Parameter(help="file that ends in .png, .pdf or .svg; without it RUN_KIND.png")
    ] = None,
) -> int:
    """Draw the energies, the tracking, the torques, the powers at the ports or the contacts of a run."""
    from passiflex.diagrams import viewed
    from passiflex.plotting.figures import save_as
    from passiflex.plotting.run import draw_run

    with timed():
        target = _target(out, f"_{kind}.png", DRAWN, run, *compare)
        first, *others = viewed([read.run for read in _read(run, *compare)])
        console.print(f"wrote {save_as(draw_run(kind, first, others, size), target)}")
    return 0


def export(
    run: Path,
    /,
    *,
    to: Annotated[
        str,
        cyclopts.Parameter(
            help="rrd, Rerun; mcap, ROS 2 messages for Foxglove and PlotJuggler; csv, text; or what "
            "another package brings"
        ),
    ],
    out: Annotated[
        Path | None, cyclopts.Parameter(help="file to write; without it RUN.rrd, .mcap, .csv")
    ] = None,
) -> int:
    """Write a run for another program: Rerun, Foxglove, PlotJuggler, or anything that reads tables."""
    from passiflex.errors import NameUnknownError
    from passiflex.exports import export_run, formats

    with timed():
        if f".{to}" not in (known := formats()):
            raise NameUnknownError("kind of file", to, [ending.removeprefix(".") for ending in known])
        target = _target(out, f".{to}", (f".{to}",), run)
        (read,) = _read(run)
        console.print(f"wrote {export_run(read.run, target)}")
    return 0


def export_model(
    what: str,
    /,
    *,
    out: Annotated[Path, cyclopts.Parameter(help="MJCF file to write, that ends in .xml")],
) -> int:
    """Write a robot, or the robot of a scenario with what it carries and where it starts, as a model for MuJoCo."""
    from passiflex.exports.model_file import export_model as export
    from passiflex.files import require_writable
    from passiflex.robots.flexible import FlexibleJointRobot
    from passiflex.scenarios.scenario_file import is_scenario, load_scenario
    from passiflex.simulation import resolve

    with timed():
        require_writable(out.parent)
        if is_scenario(what):
            cut = export(resolve(load_scenario(what)), out)
        else:
            cut = export(FlexibleJointRobot.load(what), out)
        for line in cut:
            console.print(f"note: {line}")
        console.print(f"wrote {out}")
    return 0


def _read(*paths: Path) -> list[Salvaged]:
    """Return what can be read of each file, after a line on everything that is wrong with it."""
    from passiflex.runs.salvaged import salvage

    read = [salvage(path) for path in paths]
    for path, (_, notices) in zip(paths, read, strict=True):
        for notice in notices:
            console.print(f"{path}: {notice}")
    return read


def _target(out: Path | None, usual: str, endings: tuple[str, ...], run: Path, *others: Path) -> Path:
    """Return the file to write, by default the run's name with the `usual` end: refused before the work, not after."""
    from passiflex.files import OutputError, require_writable
    from passiflex.runs.run_file import require_file

    require_file(run)
    if out is None:
        out = run.with_name(run.stem + usual)
    if os.path.isdir(out):
        raise OutputError("the file to write is a folder", got=str(out))
    if out.suffix not in endings:
        raise OutputError(
            "wrong name for the file to write",
            got=str(out),
            needs=f"a file name that ends in {' or '.join(endings)}",
        )
    if out.resolve() in [path.resolve() for path in (run, *others)]:
        raise OutputError("the file to write is one of those that are read", got=str(out))
    require_writable(out.parent)
    return out
