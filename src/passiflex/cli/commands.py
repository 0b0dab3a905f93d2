"""The commands. Each says what it wrote and how long it took."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import cyclopts

from passiflex.cli.terminal import console, progress_lines, timed

if TYPE_CHECKING:
    from passiflex.passivity import Audit
    from passiflex.simulation import Run

WORTH_A_WORD = 1e-6
"""Energy [J] below which a bound is round-off."""
EXIT = {"passive": 0, "violated": 1, "inconclusive": 2}


def reproduce(
    *figures: str,
    out: Annotated[Path, cyclopts.Parameter(help="folder for figures, runs and summary.json")] = Path(
        "results"
    ),
    sensitivity: Annotated[
        bool, cyclopts.Parameter(negative="", help="sweep what the paper does not print")
    ] = False,
) -> int:
    """Reproduce the paper's figures, fig1, fig2, fig3 (all if none is named), or a study.

    The studies are contact, grip, hands, policy, polishing, walls (all on touch), sampled and uncertainty.

    Writes per figure a PNG, a PDF and the runs as netCDF, and one summary.json. With --sensitivity, one
    figure that shows how the conclusions move with what the paper does not print.
    """
    with timed():
        if sensitivity:
            from passiflex.studies.sensitivity import run_sensitivity

            _refuse_names(figures)
            with progress_lines() as report:
                written = {"sensitivity": run_sensitivity(out, report)}
        else:
            from passiflex.studies.reproduce import reproduce as run_reproduce

            with progress_lines() as report:
                written = run_reproduce(figures, out, report)
        for paths in written.values():
            for path in paths:
                console.print(f"wrote {path}")
    return 0


def simulate(
    scenario: Path,
    /,
    *,
    out: Annotated[Path, cyclopts.Parameter(help="netCDF file to write")],
    engine: Annotated[
        str, cyclopts.Parameter(help="who moves the robot of a sampled run: passiflex, or mujoco")
    ] = "passiflex",
) -> int:
    """Run a scenario file and write the run as one netCDF file; exit status 2 if the run ended early."""
    from passiflex.files import require_writable
    from passiflex.simulation import load_scenario

    with timed():
        with progress_lines() as report:
            _refuse_target(scenario, out)
            read = load_scenario(scenario)
            require_writable(out.parent)

            from passiflex.simulation import passed_limits, resolve, simulate_problem
            from passiflex.simulation.cautions import cautions

            problem = resolve(read)
            for caution in cautions(problem):
                console.print(f"note: {caution}")
            report(f"{read.name}: compiling and running")
            run = simulate_problem(problem, engine)
        if run.moved_elsewhere:
            console.print(f"moved by {run.engine}")
        if run.failure:
            console.print(f"the run ended early, at {run.time[-1]:g} s of {read.duration:g} s: {run.failure}")
        if run.sampled:
            _print_control(run)
        for passed in passed_limits(run):
            console.print(f"{passed}")
        console.print(f"wrote {run.save(out)}")
    return 2 if run.failure else 0


def audit(run: Path, /) -> int:
    """Audit a run: exit status 0 passive, 1 violated, 2 inconclusive or not usable."""
    from rich.table import Table

    from passiflex.passivity import audit as audit_run
    from passiflex.runs.passed_limit import passed_limits
    from passiflex.runs.run import Run
    from passiflex.runs.run_file import remarks

    read = Run.load(run)
    for remark in remarks(read.data):
        console.print(f"{run}: {remark}")
    result = audit_run(read)
    table = Table(
        "balance", "change of stored energy", "supplied", "dissipated", "largest residual", title=str(run)
    )
    for balance in result.balances:
        supplied = sum(v[-1] for v in balance.supplied.values())
        dissipated = sum(v[-1] for v in balance.dissipated.values())
        numbers = (balance.total[-1] - balance.total[0], supplied, dissipated)
        table.add_row(balance.name, *(f"{v:+.6g} J" for v in numbers), f"{balance.worst:.2e} J")
    console.print(table)
    console.print(f"verdict: {result.verdict}")
    decided = "least margin" if result.verdict == "passive" else "decided"
    console.print(f"{decided} at {result.time:g} s, most of it taken by: {result.term}")
    console.print(f"margin: {result.margin:.6g} J, integration error {result.integration_error:.1e} J")
    if read.as_read:
        console.print(
            "judged by what the robot says of itself, as good as its torque sensors and encoders are"
        )
    elif read.moved_elsewhere:
        console.print(f"moved by {read.engine}")
    if not result.every_step:
        console.print("judged by the rows of the file alone: what happened between them was not noted")
    if result.ledger_residual > max(10 * result.integration_error, WORTH_A_WORD):
        console.print(_unclosed(read, result))
    if result.books_error > max(10 * result.integration_error, WORTH_A_WORD):
        console.print(_wrong_books(read, result))
    if read.sampled:
        _print_control(read)
    for passed in passed_limits(read):
        console.print(f"{passed}")
    if result.verdict != "passive":
        console.print(f"remedy: {result.remedy}")
    return EXIT[result.verdict]


def robots() -> int:
    """List the robots of the catalogue, and where their numbers come from."""
    from rich.text import Text

    from passiflex.robots.catalogue import catalogue, read_description

    for name in catalogue():
        description = read_description(name)
        console.print(Text.assemble((name, "bold"), f": {description.chain.n} joints"))
        for quantity, source in description.sources.items():
            console.print(f"  {quantity}: {source}")
    return 0


def keys(
    place: Annotated[
        str, cyclopts.Parameter(help="as control.fallback or environment.plane; the file itself if left out")
    ] = "",
    /,
) -> int:
    """List what may be written at a place of a scenario file: keys, with their units, defaults and meanings."""
    from rich.table import Table

    from passiflex.scenarios.keys import keys_of, sections_at

    for name, section in sections_at(place).items():
        about = (section.__doc__ or "").partition("\n")[0]
        table = Table(title=f"{name}: {about}" if name else about, title_justify="left", expand=True)
        table.add_column("key", no_wrap=True)
        table.add_column("write", ratio=2)
        table.add_column("default", no_wrap=True)
        table.add_column("meaning", ratio=3)
        for row in keys_of(section):
            table.add_row(*row)
        console.print(table)
    return 0


def _unclosed(run: Run, result: Audit) -> str:
    """Return by how much the robot's balance does not close, and what that is of."""
    missed = f"{result.ledger_residual:.2e} J"
    if run.as_read:
        return f"by its readings the robot's balance misses {missed}: their resolution, delay, friction, model error"
    return f"what touches the robot gives or takes {missed} that it does not declare"


def _wrong_books(run: Run, result: Audit) -> str:
    """Return by how much the books of the law are wrong, and what they do not know."""
    from passiflex.problems.unbooked import NOTHING

    if run.sampled and run.has_tank:
        return f"the tank claims up to {result.books_error:.3g} J beyond what is there"
    why = f" ({result.unbooked})" if result.unbooked != NOTHING else ""
    return f"the law's own books are wrong by up to {result.books_error:.3g} J{why}"


def _print_control(run: Run) -> None:
    """Print what governor and fallback did."""
    governed, latched = run["governed_time"][-1], run["latched"] > 0
    if governed > 0:
        console.print(f"the governor held the reference back for {governed:.3g} s")
    noted = float(run["fallback_time"]) if "fallback_time" in run.data else math.inf
    if latched.any() or math.isfinite(noted):
        fell = noted if math.isfinite(noted) else run.time[latched.argmax()]
        console.print(f"the law fell back at {fell:.4g} s and held the pose it was in{_overdrawn(run)}")
    if run["faults"][-1] > 0:
        console.print(f"{run['faults'][-1]:.0f} measurements were not finite, and changed nothing")
    bound = float(run["measurement_bound"][-1]) if run.has_tank and "measurement_bound" in run.data else 0.0
    if bound > WORTH_A_WORD and run.time[-1] > 0:
        console.print(
            f"errors of the sensors: the tank may claim up to {bound:.3g} J too much by the end, "
            f"{bound / run.time[-1]:.2g} W on average; nothing was granted on it"
        )


def _overdrawn(run: Run) -> str:
    """Return how much less than nothing the tank of a run ever had."""
    least = float(run["tank_energy"].min()) if run.has_tank else 0.0
    return f"; its tank was overdrawn by {-least:.3g} J at most" if least < 0 else ""


def _refuse_target(scenario: Path, out: Path) -> None:
    from passiflex.files import OutputError

    if out.suffix != ".nc" or os.path.isdir(out) or out.resolve() == scenario.resolve():
        raise OutputError("--out is no netCDF file", got=str(out), needs="a file name that ends in .nc")


def _refuse_names(figures: tuple[str, ...]) -> None:
    from passiflex.errors import PassiflexError

    if figures:
        raise PassiflexError("--sensitivity takes no figure names", got=" ".join(figures))
