"""The commands for many runs: campaign, replay, search."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import cyclopts

from passiflex.cli.terminal import campaign_bar, console, progress_lines, timed

if TYPE_CHECKING:
    from passiflex.campaigns import Results


def campaign(
    campaign: Path,
    /,
    *,
    out: Annotated[Path, cyclopts.Parameter(help="folder of the results; an interrupted campaign goes on")],
    samples: Annotated[int | None, cyclopts.Parameter(help="instead of the campaign's own number")] = None,
    workers: Annotated[
        int | None,
        cyclopts.Parameter(help="processes, 0 for none beside this; one per core"),
    ] = None,
    scheduler: Annotated[
        str | None, cyclopts.Parameter(help="address of a dask scheduler, as tcp://host:8786")
    ] = None,
) -> int:
    """Run a scenario for many robots, as a campaign file says, and sum up what came of it.

    Writes samples.parquet, statistics.json and one page of figures, and the full runs of the worst samples
    if the campaign keeps them.
    """
    from passiflex.campaigns import load_campaign, run_campaign

    with timed():
        read = load_campaign(campaign)
        with campaign_bar() as on_progress:
            results = run_campaign(
                read,
                out,
                samples=samples,
                workers=workers,
                scheduler=scheduler,
                on_progress=on_progress,
            )
        _sum_up(results)
    return 0


def replay(
    folder: Path,
    /,
    *,
    sample: Annotated[int, cyclopts.Parameter(help="number of the sample, from 0")],
    out: Annotated[
        Path | None, cyclopts.Parameter(help="netCDF file to write; sample_K.nc beside the results")
    ] = None,
) -> int:
    """Make the full run of one sample of a campaign; exit status 2 if the run ended early."""
    from passiflex.campaigns import replay as replay_sample
    from passiflex.files import OutputError

    with timed():
        out = folder / f"sample_{sample}.nc" if out is None else out
        if out.suffix != ".nc" or os.path.isdir(out):
            raise OutputError("--out is no netCDF file", got=str(out), needs="a file name that ends in .nc")
        with progress_lines() as report:
            report(f"{folder}: sample {sample}")
            run = replay_sample(folder, sample)
        if run.failure:
            console.print(f"the run ended early: {run.failure}")
        console.print(f"wrote {run.save(out)}")
    return 2 if run.failure else 0


def search(
    campaign: Path,
    /,
    *,
    out: Annotated[Path, cyclopts.Parameter(help="folder for the found scenarios")],
    measure: Annotated[str, cyclopts.Parameter(help="metric to make as bad as it gets")] = "margin",
    evaluations: Annotated[int, cyclopts.Parameter(help="how many runs it may take")] = 400,
    keep: Annotated[int, cyclopts.Parameter(help="how many of the worst to write")] = 5,
    seed: Annotated[int, cyclopts.Parameter(help="seed of the search")] = 0,
) -> int:
    """Look for the worst case within the bounds of a campaign's parameters; what is found can be simulated."""
    from passiflex.campaigns import load_campaign
    from passiflex.campaigns.found import require_place
    from passiflex.campaigns.search import search as search_worst
    from passiflex.cli.campaign_tables import found_table

    with timed():
        read = load_campaign(campaign)
        require_place(out, keep)
        with progress_lines() as report:
            found = search_worst(read, measure, evaluations=evaluations, keep=keep, seed=seed, report=report)
        console.print(found_table(found))
        for path in found.save(out):
            console.print(f"wrote {path}")
    return 0


def _sum_up(results: Results) -> None:
    """Write the statistics and the page of figures beside the rows, then print them: a closed pipe loses nothing."""
    from passiflex.campaigns.page import ideal_along, page
    from passiflex.campaigns.run_campaign import PAGE, STATISTICS
    from passiflex.campaigns.statistics import statistics
    from passiflex.cli.campaign_tables import statistics_tables
    from passiflex.files import whole_file
    from passiflex.plotting.campaign import draw_campaign
    from passiflex.plotting.figures import Series, save_figure

    folder = results.folder
    rows = results.narrow_rows()
    found = statistics(results.campaign, rows)
    with whole_file(folder / STATISTICS) as temporary:
        temporary.write_text(json.dumps(found.to_dict(), indent=2, allow_nan=False) + "\n", encoding="utf-8")
    ideal = ideal_along(results.campaign)
    drawing = draw_campaign(
        page(results.campaign, rows, found, results.responses()), {"msd": Series(*ideal)} if ideal else {}
    )
    written = [folder / "samples.parquet", folder / STATISTICS]
    written += [*save_figure(drawing, (folder / PAGE[0]).with_suffix("")), *results.runs]
    for table in statistics_tables(found):
        console.print(table)
    for path in written:
        console.print(f"wrote {path}")
