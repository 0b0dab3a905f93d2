"""A campaign from its definition to a folder of results, on this machine or on a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import yaml

from passiflex.campaigns.campaign import MOST_SAMPLES, Campaign
from passiflex.campaigns.campaign_file import parse_campaign
from passiflex.campaigns.draws import draws
from passiflex.campaigns.evaluate import (
    REFUSED,
    RESPONSE,
    evaluate_samples,
    kept_measures,
    require_response,
    run_sample,
)
from passiflex.campaigns.possible import require_possible
from passiflex.campaigns.ranking import worst_first
from passiflex.campaigns.same_robot import marked, robot_digest
from passiflex.campaigns.samples import sample_scenario
from passiflex.chunks.cluster import Cluster
from passiflex.chunks.engines import Engine, InProcess, LocalProcesses
from passiflex.chunks.manifest import FolderError, load_manifest
from passiflex.chunks.run_chunks import Progress, run_chunks
from passiflex.chunks.store import Store, open_store
from passiflex.chunks.stored_rows import read_blocks, read_rows
from passiflex.errors import ArgumentError, NameUnknownError, PassiflexError, ValueRangeError
from passiflex.files import as_path
from passiflex.native import find_compiler
from passiflex.problems.problem import Problem, SampledProblem
from passiflex.simulation import Run, resolve
from passiflex.simulation.batch import lane_loop
from passiflex.stability.admissible import require_stable
from passiflex.texts.yaml_tree import read_back

RUNS = "runs"
"""Folder of the worst samples' full runs, within that of the results."""
STATISTICS, PAGE = "statistics.json", ("page.png", "page.pdf")
"""Files that the command makes of the rows, beside them."""


@dataclass(frozen=True)
class Results:
    """A finished campaign in its folder.

    Attributes
    ----------
    folder: Where.
    campaign: What was run.
    runs: Files of the full runs that were kept, the worst first.
    """

    folder: Path
    campaign: Campaign
    runs: tuple[Path, ...] = ()

    def rows(self, columns: Sequence[str] | None = None) -> pa.Table:
        """Return one row for each sample, in their order; some columns only if they are named."""
        return read_rows(self.folder, columns)

    def narrow_rows(self) -> pa.Table:
        """Return the rows without the responses, which are wide."""
        first = next(read_blocks(self.folder), None)
        return self.rows(first and [name for name in first.column_names if not name.startswith(RESPONSE)])

    def responses(self) -> Iterator[pa.Table]:
        """Yield verdicts and responses, some samples at a time; nothing if no responses are kept."""
        if self.campaign.keep.response is not None:
            yield from read_blocks(self.folder, ["verdict", *(f"{RESPONSE}{axis}" for axis in "xyz")])

    @classmethod
    def load(cls, folder: str | Path) -> Results:
        """Return the results of a folder, finished or not.

        Raises
        ------
        FolderError
            If it holds none.
        """
        folder = as_path(folder, "the folder of a campaign")
        campaign = parse_campaign(load_manifest(folder).campaign, source=str(folder))
        own = load_manifest(folder).runs  # folders of before do not say
        there = (folder / RUNS).glob("sample_*.nc")
        found, kept = cls(folder, campaign), {path for path in there if not own or path.name in own}
        if not kept or campaign.keep.by is None:
            return found
        ranked = [_run_file(folder, i) for i in worst(found, campaign.keep.by, campaign.samples)]
        return cls(folder, campaign, tuple(path for path in ranked if path in kept))


def run_campaign(
    campaign: Campaign,
    folder: str | Path,
    *,
    samples: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    on_progress: Callable[[Progress], None] = lambda progress: None,
) -> Results:
    """Run what a folder misses of a campaign; the rows do not depend on engine, workers or interruptions.

    Parameters
    ----------
    samples: Instead of the campaign's own number.
    workers: Processes of this machine, 0 for this one; one for each core if None.
    scheduler: Address of a `dask.distributed` scheduler, in place of `workers`.

    Raises
    ------
    PassiflexError
        Before the start for impossible robots, an unstable loop that is not insisted on, unknown metrics, a
        folder of something else, a scheduler that does not answer; later for a disk that is full.
    """
    if not isinstance(campaign, Campaign):
        raise ArgumentError(campaign, "a campaign", "load_campaign for a file")
    folder = as_path(folder, "the folder of a campaign")
    if samples is not None:
        if not 1 <= samples <= MOST_SAMPLES:
            raise ValueRangeError("number of samples", got=samples, needs=f"1 to {MOST_SAMPLES}")
        campaign = campaign.model_copy(update={"samples": samples})
    require_response(campaign)
    with _engine(workers, scheduler) as engine:  # first, as a scheduler that is not there is soon found out
        require_possible(campaign)
        draws(campaign, [0])  # refuses a sampling that cannot be held
        robot = _ready(campaign)
        prefix = campaign.sampling != "latin_hypercube"
        text, identity = marked(campaign.to_yaml(), robot), marked(_identity(campaign), robot)
        beside = (STATISTICS, *PAGE, f"{RUNS}/sample_*.nc")
        with open_store(
            folder, text, campaign.samples, extends=prefix, identity=identity, beside=beside
        ) as store:
            run_chunks(store, evaluate_samples, engine, on_progress)
            results = Results(folder, campaign)
            return Results(results.folder, campaign, _keep_worst(results, store))


def worst(results: Results, measure: str, count: int) -> list[int]:
    """Return the numbers of the samples that are worst by a measure, the worst first.

    As `worst_first` ranks them; refused ones are left out.

    Raises
    ------
    NameUnknownError
        If it is no measure, or none that the campaign keeps.
    """
    kept = kept_measures(results.campaign)
    if measure not in kept:
        raise NameUnknownError("metric", measure, kept)
    table = results.rows(["sample", "verdict", "failure", measure])
    rows = [i for i, verdict in enumerate(table["verdict"].to_pylist()) if verdict != REFUSED]
    run = table.take(rows)
    ranked = worst_first(measure, run[measure].to_pylist(), run["failure"].to_pylist())
    samples = run["sample"].to_pylist()
    return [samples[i] for i in ranked[:count]]


def _keep_worst(results: Results, store: Store) -> tuple[Path, ...]:
    """Write the full runs of the worst samples; those of an earlier end of this campaign go, and nobody else's."""
    keep = results.campaign.keep
    if keep.by is None:
        return ()
    paths = {i: _run_file(results.folder, i) for i in worst(results, keep.by, keep.worst)}
    own = set(store.manifest.runs)
    for i, path in paths.items():
        if path.exists() and path.name not in own and not _is_run_of(path, results.campaign, i):
            raise FolderError(
                f"{path} is none that this campaign wrote", try_="another folder, or move it away"
            )
    missing = {i: path for i, path in paths.items() if not path.exists()}
    written = {*own, *(path.name for path in missing.values())}
    store.own_runs(written)
    for i, path in missing.items():
        run_sample(results.campaign, i).save(path)
    others = written - {path.name for path in paths.values()}
    for name in others:
        (results.folder / RUNS / name).unlink(missing_ok=True)
    store.own_runs(written - others)
    return tuple(paths.values())


def _is_run_of(path: Path, campaign: Campaign, sample: int) -> bool:
    """Return whether a file is the run of a sample: one of before, when folders did not say which are theirs."""
    try:
        run = Run.load(path)
    except PassiflexError:
        return False
    wanted = resolve(sample_scenario(campaign, sample))
    return run.name == wanted.name and run.data.attrs.get("scenario") == wanted.text


def _run_file(folder: Path, sample: int) -> Path:
    return folder / RUNS / f"sample_{sample}.nc"


def _engine(workers: int | None, scheduler: str | None) -> Engine:
    if scheduler is not None and workers is not None:
        raise ValueRangeError("workers and scheduler", got=f"{workers}, {scheduler}", needs="one of the two")
    if scheduler is not None:
        return Cluster(scheduler)
    return InProcess() if workers == 0 else LocalProcesses(workers)


def _ready(campaign: Campaign) -> str:
    """Return the robot's digest, after refusing an unstable loop and compiling the lanes once for all workers."""
    base = resolve(campaign.scenario)
    if isinstance(base, SampledProblem):
        require_stable(base)
        if find_compiler() is not None:  # without one the samples run one by one
            first = _first(campaign)
            lane_loop(first if isinstance(first, SampledProblem) else base)
    return robot_digest(campaign)


def _first(campaign: Campaign) -> Problem | None:
    """Return the first sample, whose motors may rub where those of the base do not; None if it is impossible."""
    try:
        return resolve(sample_scenario(campaign, 0))
    except PassiflexError:
        return None


def _identity(campaign: Campaign) -> str:
    """Return the text of what rows depend on: all but how many there are, and of which a full run is kept."""
    data = read_back(campaign.to_yaml())
    for name in ("samples", "description"):
        data.pop(name, None)
    for name in ("worst", "by"):
        data.get("keep", {}).pop(name, None)
    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True)
