"""The commands for a law on a robot: run, export-law."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import cyclopts

from passiflex.cli.terminal import console, progress_lines, timed


def run(
    scenario: Path,
    /,
    *,
    out: Annotated[Path, cyclopts.Parameter(help="netCDF file to write")],
    robot: Annotated[
        str,
        cyclopts.Parameter(help="twin: the scenario's own plant, with all that is around it, in real time"),
    ] = "twin",
    ramp: Annotated[
        float, cyclopts.Parameter(help="time in which jumps of the reference are gone over to, s")
    ] = 0.0,
    soft_start: Annotated[float, cyclopts.Parameter(help="time in which the stiffness comes, s")] = 1.0,
    fast: Annotated[bool, cyclopts.Parameter(negative="", help="a twin as fast as it goes")] = False,
) -> int:
    """Run a scenario on a robot and write all periods as one run; Ctrl-C lets the arm go softly, twice ends at once.

    Exit status 3 if it was stopped before its time.
    """
    import math

    from passiflex.errors import NameUnknownError
    from passiflex.files import require_writable
    from passiflex.onboard import ApproachSettings, Twin, WatchSettings, run_on
    from passiflex.scenarios.scenario_file import load_scenario

    with timed():
        if robot != "twin":
            raise NameUnknownError("robot", robot, ("twin",))
        read = load_scenario(scenario)
        require_writable(out.parent)
        with progress_lines() as report, _stopping() as stop:
            report(f"{read.name}: laying out the law and its twin")
            ran = run_on(
                Twin(read),
                read,
                watch=WatchSettings(frozen_after=math.inf, soft_start=soft_start),
                approach=ApproachSettings(ramp=ramp),
                weight_in_readings=False,
                paced=not fast,
                stop=stop,
                report=report,
            )
        if ran.stopped:
            console.print(f"stopped after {ran.run.time[-1]:.3g} s of {read.duration:g} s")
        if not fast:
            console.print(f"{ran.late} of {ran.periods} periods began late")
        console.print(f"wrote {ran.run.save(out)}")
    return 3 if ran.stopped else 0


@contextmanager
def _stopping() -> Iterator[Callable[[], bool]]:
    """Give a function that says whether Ctrl-C was pressed; the second time it ends the program."""
    asked: list[int] = []

    def pressed(number: int, frame: object) -> None:
        if asked:
            raise KeyboardInterrupt
        asked.append(number)

    before = signal.signal(signal.SIGINT, pressed)
    try:
        yield lambda: bool(asked)
    finally:
        signal.signal(signal.SIGINT, before)


def export_law(
    scenario: Path,
    /,
    *,
    out: Annotated[Path, cyclopts.Parameter(help="folder to write")],
    says: Annotated[
        str | None,
        cyclopts.Parameter(
            help="of q, theta, dq, dtheta, tau_a, F_e, applied; as 'q,dq,tau_a'; the scenario's own"
        ),
    ] = None,
) -> int:
    """Write the law of a scenario as C99: `make check` in the folder compares it with Python, step by step."""
    from passiflex.exports.law_export import export_law as export

    with timed():
        folder = export(scenario, out, says and [word.strip() for word in says.split(",")])
        console.print(f"wrote {folder}")
    return 0
