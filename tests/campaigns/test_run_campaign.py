"""Whole campaigns: the same rows whoever computes them and however often they stop; the worst runs; replay."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from functools import lru_cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from campaigns.small_campaigns import (
    CONTINUOUS,
    SAMPLED,
    STIFFNESS,
    UNSTABLE,
    campaign,
    choice,
    equal,
    same_rows,
    uniform,
)
from passiflex.campaigns import (
    Campaign,
    Results,
    load_campaign,
    replay,
    run_campaign,
    sample_scenario,
)
from passiflex.campaigns.evaluate import evaluate_samples
from passiflex.campaigns.run_campaign import worst
from passiflex.chunks.manifest import FolderError
from passiflex.chunks.run_chunks import Progress
from passiflex.chunks.store import open_store
from passiflex.chunks.worker import EngineError
from passiflex.errors import (
    NameUnknownError,
    PassiflexError,
    ScenarioError,
    UnstableLoopError,
    ValueRangeError,
)
from passiflex.files import OutputError
from passiflex.metrics.measures import measures
from passiflex.metrics.steps import step_window
from passiflex.simulation import Run, batch, resolve
from worlds import merged

module = import_module("passiflex.campaigns.run_campaign")  # the package has a function of that name
TESTS = Path(__file__).parents[1]
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join([str(TESTS.parent / "src"), str(TESTS)])}
WILD: dict[str, Any] = merged(
    UNSTABLE,
    {
        "control": {"allow_unstable": True},
        "tank": {"kind": "paper"},
        "law": {"shaped_stiffness": {"ratio": 1}},
    },
)
"""Unstable and not caught by a fallback; stiffer joints leave the finite numbers."""


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a few samples be several chunks: the size of a chunk has no part in the rows."""
    monkeypatch.setattr(module, "open_store", partial(open_store, chunk=4))


@lru_cache
def rows_of(text: str, samples: int) -> list[dict[str, Any]]:
    return evaluate_samples(text, range(samples))


def table(results: Results) -> list[dict[str, Any]]:
    return results.rows().to_pylist()


def right(results: Results) -> bool:
    """Return whether the folder's rows are those that all its samples have when they are asked for together."""
    return same_rows(table(results), rows_of(results.campaign.to_yaml(), results.campaign.samples))


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


MANY = campaign(samples=14, keep={"response": 0.1})


@pytest.fixture(scope="module")
def serial(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return run_campaign(MANY, tmp_path_factory.mktemp("serial") / "out", workers=0)


def test_the_rows_are_those_of_the_samples(serial: Results) -> None:
    assert right(serial)
    assert names(serial.folder) == [".lock", "manifest.json", "samples.parquet"]
    assert serial.campaign == MANY
    assert serial.runs == ()


@pytest.mark.parametrize("workers", [1, 2])
def test_the_same_file_whoever_computes_it(serial: Results, workers: int, tmp_path: Path) -> None:
    results = run_campaign(MANY, tmp_path / "out", workers=workers)
    ours, theirs = ((r.folder / "samples.parquet").read_bytes() for r in (results, serial))
    assert ours == theirs


def test_results_are_read_from_their_folder(serial: Results) -> None:
    again = Results.load(serial.folder)
    assert again == serial
    assert right(again)


def test_progress_counts_every_chunk(tmp_path: Path) -> None:
    seen: list[Progress] = []
    run_campaign(MANY, tmp_path / "out", workers=0, on_progress=seen.append)
    assert [(p.done, p.total) for p in seen] == [(4, 14), (8, 14), (12, 14), (14, 14)]
    assert seen[-1].verdicts == {"passive": 14}
    seen.clear()
    run_campaign(MANY, tmp_path / "out", workers=0, on_progress=seen.append)
    assert seen == []  # all is there


def test_another_number_of_samples_than_in_the_file(tmp_path: Path) -> None:
    results = run_campaign(MANY, tmp_path / "out", samples=3, workers=0)
    assert results.campaign.samples == 3
    assert [row["sample"] for row in table(results)] == [0, 1, 2]
    with pytest.raises(ValueRangeError, match="number of samples; got 0"):
        run_campaign(MANY, tmp_path / "none", samples=0, workers=0)
    assert not (tmp_path / "none").exists()


SLOW = """
import sys, time
from functools import partial
from importlib import import_module
from campaigns.small_campaigns import campaign
from passiflex.chunks.store import open_store
module = import_module("passiflex.campaigns.run_campaign")
module.open_store = partial(open_store, chunk=4)
many = campaign(samples=14, keep={"response": 0.1})
module.run_campaign(many, sys.argv[1], workers=0, on_progress=lambda p: time.sleep(60 * (p.done >= 8)))
"""


def test_a_campaign_that_was_killed_goes_on(serial: Results, tmp_path: Path) -> None:
    """Two chunks are there; the file in the end is the same."""
    folder = tmp_path / "out"
    with subprocess.Popen([sys.executable, "-c", SLOW, folder], env=ENVIRONMENT, cwd=tmp_path) as process:
        end = time.monotonic() + 60
        while len(list((folder / "pieces").glob("[0-9]*.parquet"))) < 2:
            assert process.poll() is None
            assert time.monotonic() < end
            time.sleep(0.02)
        process.send_signal(signal.SIGKILL)
    assert [row["sample"] for row in table(Results.load(folder))] == [*range(8)]
    seen: list[Progress] = []
    results = run_campaign(MANY, folder, workers=0, on_progress=seen.append)
    assert [p.done for p in seen] == [12, 14]
    assert (folder / "samples.parquet").read_bytes() == (serial.folder / "samples.parquet").read_bytes()
    assert right(results)


@pytest.mark.parametrize("sampling", ["random", "sobol"])
def test_more_samples_keep_the_first(sampling: str, tmp_path: Path) -> None:
    c = campaign(samples=4, sampling=sampling)
    first = table(run_campaign(c, tmp_path / "out", workers=0))
    results = run_campaign(c, tmp_path / "out", samples=9, workers=0)
    assert results.rows().num_rows == 9
    assert same_rows(table(results)[:4], first)
    assert right(results)
    whole = run_campaign(c, tmp_path / "other", samples=9, workers=0)
    ours, theirs = ((r.folder / "samples.parquet").read_bytes() for r in (results, whole))
    assert ours == theirs


def test_a_latin_hypercube_cannot_be_extended(tmp_path: Path) -> None:
    """Its strata depend on how many there are."""
    c = campaign(samples=4, sampling="latin_hypercube")
    first = table(run_campaign(c, tmp_path / "out", workers=0))
    with pytest.raises(FolderError, match="4 → 9, and this sampling cannot be extended"):
        run_campaign(c, tmp_path / "out", samples=9, workers=0)
    assert same_rows(table(Results.load(tmp_path / "out")), first)


def test_fewer_samples_or_another_campaign_are_refused(tmp_path: Path) -> None:
    c = campaign(samples=4)
    run_campaign(c, tmp_path / "out", workers=0)
    before = (tmp_path / "out" / "samples.parquet").read_bytes()
    with pytest.raises(FolderError, match="has more samples; got 3; needs 4 or more"):
        run_campaign(c, tmp_path / "out", samples=3, workers=0)
    with pytest.raises(FolderError, match=r"seed: 3.* there, .*seed: 4.* asked for"):
        run_campaign(campaign(samples=4, seed=4), tmp_path / "out", workers=0)
    assert (tmp_path / "out" / "samples.parquet").read_bytes() == before


BY = {"margin": "low", "torque_peak": "high"}


@pytest.mark.parametrize("by", BY)
def test_the_worst_are_kept_in_full(by: str, tmp_path: Path) -> None:
    """By the measure's own bad end; and when there are more samples, the worst of all."""
    c = campaign(samples=5, keep={"worst": 2, "by": by})
    for count in (5, 11):
        results = run_campaign(c, tmp_path / "out", samples=count, workers=0)
        values = {row["sample"]: row[by] for row in table(results)}
        order = sorted(values, key=values.__getitem__, reverse=BY[by] == "high")[:2]
        assert [path.name for path in results.runs] == [f"sample_{i}.nc" for i in order]
        assert set(results.runs) == set((tmp_path / "out" / "runs").iterdir())
        assert Results.load(tmp_path / "out").runs == results.runs
        assert worst(results, by, 2) == order
        for i, path in zip(order, results.runs, strict=True):
            assert has_numbers(Run.load(path), results, i)


def test_runs_that_the_campaign_did_not_write_stay(tmp_path: Path) -> None:
    c = campaign(samples=5, keep={"worst": 1, "by": "margin"})
    (first,) = run_campaign(c, tmp_path, workers=0).runs
    mine = [
        tmp_path / "runs" / name for name in ("sample_99.nc", "sample_a.nc", "notes.txt", "x_sample_1.nc")
    ]
    for path in mine:
        path.write_text("mine")
    manifest = tmp_path / "manifest.json"
    assert json.loads(manifest.read_text())["runs"] == [first.name]
    (second,) = run_campaign(c, tmp_path, samples=11, workers=0).runs
    assert second != first
    assert set((tmp_path / "runs").iterdir()) == {second, *mine}
    assert all(path.read_text() == "mine" for path in mine)
    content = json.loads(manifest.read_text())
    del content["runs"]  # as before it said which they are
    manifest.write_text(json.dumps(content))
    (tmp_path / "runs" / first.name).write_text("of before")
    assert run_campaign(c, tmp_path, samples=11, workers=0).runs == (second,)
    assert (tmp_path / "runs" / first.name).read_text() == "of before"


def test_a_file_in_the_place_of_a_run_is_neither_taken_for_it_nor_written_over(tmp_path: Path) -> None:
    c = campaign(samples=5, keep={"worst": 1, "by": "margin"})
    (written,) = run_campaign(c, tmp_path / "there", workers=0).runs
    mine = tmp_path / "out" / "runs" / written.name
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    with pytest.raises(FolderError, match=r"is none that this campaign wrote; .*another folder"):
        run_campaign(c, tmp_path / "out", workers=0)
    assert mine.read_text() == "mine"


@pytest.mark.parametrize("name", ["statistics.json", "page.png", "page.pdf"])
def test_a_file_where_the_page_goes_is_refused_before_the_work(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("mine")
    with pytest.raises(FolderError, match=rf"{name} is none that this campaign wrote; try another folder"):
        run_campaign(campaign(samples=5), tmp_path, workers=0)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {name: "mine"}


def has_numbers(run: Run, results: Results, sample: int) -> bool:
    """Return whether a run gives the row of a sample, to the last bit."""
    scenario = sample_scenario(results.campaign, sample)
    found = measures(resolve(scenario), step_window(scenario), run)
    row = table(results)[sample]
    assert run.name == scenario.name == f"small_{sample}"
    return all(equal(found[name], row[name]) for name in found)


def test_the_runs_of_a_campaign_that_keeps_none_are_none(tmp_path: Path) -> None:
    results = run_campaign(campaign(keep={"worst": 0, "by": "margin"}), tmp_path / "out", workers=0)
    assert results.runs == Results.load(tmp_path / "out").runs == ()
    assert not (tmp_path / "out" / "runs").exists()


def test_diverged_runs_are_the_worst_and_refused_ones_none(tmp_path: Path) -> None:
    """Whatever number they left behind; and they can be kept and loaded like others."""
    parameters = {
        "law.shaped_inertia.ratio": choice(0.2, 1),
        "control.delay": choice(0.28, 0.005),
        "control.jitter": choice(0.03, 0),
        STIFFNESS: uniform(-0.1, 0.1),
    }
    base = merged(WILD, {"law": {"shaped_inertia": {"ratio": 1}}})
    c = campaign(base, samples=16, parameters=parameters, keep={"worst": 5, "by": "tracking_rms"})
    results = run_campaign(c, tmp_path / "out", workers=0)
    rows = {row["sample"]: row for row in table(results)}
    refused = {i for i, row in rows.items() if row["verdict"] == "refused"}
    fallen = {i for i, row in rows.items() if "finite" in row["failure"]}
    assert refused
    assert fallen
    assert refused | fallen < rows.keys()
    order = worst(results, "tracking_rms", 16)
    assert set(order) == rows.keys() - refused
    assert set(order[: len(fallen)]) == fallen
    assert [path.name for path in results.runs] == [f"sample_{i}.nc" for i in order[:5]]
    for i, path in zip(order, results.runs, strict=False):
        run = Run.load(path)
        assert run.failure == rows[i]["failure"]
        assert has_numbers(run, results, i)


@pytest.mark.parametrize("scenario", [SAMPLED, CONTINUOUS, WILD], ids=["sampled", "continuous", "wild"])
def test_a_replay_is_the_run_of_the_row(scenario: dict[str, Any], tmp_path: Path) -> None:
    results = run_campaign(campaign(scenario, samples=3), tmp_path / "out", workers=0)
    run = replay(tmp_path / "out", 2)
    assert has_numbers(run, results, 2)
    assert has_numbers(Run.load(run.save(tmp_path / "again.nc")), results, 2)


def test_what_cannot_be_replayed(tmp_path: Path) -> None:
    run_campaign(campaign(samples=3), tmp_path / "out", workers=0)
    for sample in (3, -1):
        with pytest.raises(ValueRangeError, match=r"samples of campaign 'small'; got .* from 0 to 2"):
            replay(tmp_path / "out", sample)
    with pytest.raises(FolderError, match="holds no campaign"):
        replay(tmp_path, 0)


def refused(error: type[PassiflexError], match: str, c: Campaign, folder: Path, **options: Any) -> None:
    """Refused at once, and nothing is written."""
    begin = time.monotonic()
    with pytest.raises(error, match=match):
        run_campaign(c, folder, **({"workers": 0} | options))
    assert time.monotonic() - begin < 10
    assert not folder.exists()


def test_an_unstable_loop_is_refused_before_the_start(tmp_path: Path) -> None:
    remedy = r"remedy: B_e of .*; or control\.allow_unstable"
    refused(UnstableLoopError, remedy, campaign(UNSTABLE), tmp_path / "out")


def test_an_unstable_loop_that_is_insisted_on_runs(tmp_path: Path) -> None:
    insistent = campaign(merged(UNSTABLE, {"control": {"allow_unstable": True}}), samples=2)
    assert {row["verdict"] for row in table(run_campaign(insistent, tmp_path / "out", workers=0))} == {
        "violated"
    }


def test_samples_beyond_the_border_of_stability_run(tmp_path: Path) -> None:
    """How many of them fail is what the campaign is to show."""
    c = campaign(parameters={"law.shaped_inertia.ratio": choice(0.2, 1)}, samples=4)
    found = table(run_campaign(c, tmp_path / "out", workers=0))
    assert {row["law.shaped_inertia.ratio"]: row["verdict"] for row in found} == {
        0.2: "violated",
        1.0: "passive",
    }


def test_an_impossible_robot_is_refused_before_the_start(tmp_path: Path) -> None:
    c = campaign(parameters={"posture.2": uniform(0.5, 5), STIFFNESS: uniform(-0.2, 0.2)})
    where = r"parameters\.'posture\.2'\.high: posture: joint 2 .* outside its limits; got 5 rad"
    refused(ScenarioError, where, c, tmp_path / "out")


@pytest.mark.parametrize(
    ("keep", "error", "match"),
    [
        ({"response": 0.015}, ValueRangeError, r"keep\.response; got 0\.015 s"),
    ],
)
def test_what_cannot_be_kept_is_refused_before_the_start(
    keep: dict[str, Any], error: type[PassiflexError], match: str, tmp_path: Path
) -> None:
    refused(error, match, campaign(keep=keep), tmp_path / "out")


@pytest.mark.parametrize(
    ("options", "error", "match"),
    [
        (
            {"workers": 1, "scheduler": "tcp://127.0.0.1:9"},
            ValueRangeError,
            "workers and scheduler; got 1, tcp:",
        ),
        ({"workers": -1}, ValueRangeError, "number of worker processes; got -1; needs ≥ 1"),
        (
            {"workers": None, "scheduler": "nonsense"},
            EngineError,
            "no address of a scheduler; got 'nonsense'",
        ),
    ],
)
def test_engines_that_are_not_there(
    options: dict[str, Any], error: type[PassiflexError], match: str, tmp_path: Path
) -> None:
    if options.get("scheduler"):
        pytest.importorskip("distributed")
    refused(error, match, campaign(), tmp_path / "out", **options)


def test_a_file_in_place_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(OutputError, match="cannot write into"):
        run_campaign(campaign(), tmp_path / "out", workers=0)
    assert (tmp_path / "out").read_text() == "mine"


def test_without_a_compiler(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Slowly, one by one, and to the same result but for rounding."""
    c = campaign(merged(SAMPLED, {"duration": 0.3, "forces": []}), samples=2)
    expected = evaluate_samples(c.to_yaml(), range(2))
    monkeypatch.setattr(module, "find_compiler", lambda: None)
    monkeypatch.setattr(batch, "find_compiler", lambda: None)
    monkeypatch.setattr(batch, "_lane_loops", {})
    monkeypatch.setattr(batch, "LaneLoop", None)
    found = table(run_campaign(c, tmp_path / "out", workers=0))
    for ours, theirs in zip(found, expected, strict=True):
        assert ours["verdict"] == theirs["verdict"]
        assert ours["margin"] == pytest.approx(theirs["margin"], rel=1e-6)


def test_worst_is_by_a_measure_that_is_kept(serial: Results, tmp_path: Path) -> None:
    with pytest.raises(NameUnknownError, match=r"unknown metric; got 'margins'.*try 'margin'"):
        worst(serial, "margins", 2)
    some = run_campaign(campaign(keep={"metrics": ["torque_peak"]}), tmp_path / "out", workers=0)
    with pytest.raises(NameUnknownError, match="got 'margin'; needs one of torque_peak"):
        worst(some, "margin", 2)
    assert len(worst(some, "torque_peak", 2)) == 2


def test_a_campaign_of_a_file(tmp_path: Path) -> None:
    """The scenario is in the folder: the files are not asked for again."""
    c = campaign(samples=2)
    (tmp_path / "s.yaml").write_text(c.scenario.to_yaml())
    text = c.to_yaml()
    head = "name: small\nscenario: s.yaml\nsamples: 2\nseed: 3\n"
    (tmp_path / "c.yaml").write_text(head + text[text.index("parameters:") :])
    results = run_campaign(load_campaign(tmp_path / "c.yaml"), tmp_path / "out", workers=0)
    (tmp_path / "s.yaml").unlink()
    assert same_rows(table(results), evaluate_samples(text, range(2)))
    assert has_numbers(replay(tmp_path / "out", 1), results, 1)


def test_what_no_row_depends_on_may_change(tmp_path: Path) -> None:
    """Description, and how many full runs are kept: the same rows, and the folder goes on."""
    out = tmp_path / "out"
    run_campaign(campaign(samples=4), out, workers=0)
    before = (out / "samples.parquet").read_bytes()
    more = campaign(samples=4, description="again", keep={"worst": 1, "by": "margin"})
    assert len(run_campaign(more, out, workers=0).runs) == 1
    assert (out / "samples.parquet").read_bytes() == before


def test_rows_come_with_and_without_the_responses(tmp_path: Path) -> None:
    """What is wide is read in blocks; without a response there is none."""
    results = run_campaign(campaign(samples=4, keep={"response": 0.1}), tmp_path / "out", workers=0)
    whole, narrow = results.rows(), results.narrow_rows()
    wide = {name for name in whole.column_names if name.startswith("displacement_")}
    assert len(wide) == 3
    assert same_rows(narrow.to_pylist(), whole.drop_columns(sorted(wide)).to_pylist())
    blocks = list(results.responses())
    assert sum(block.num_rows for block in blocks) == 4
    assert set(blocks[0].column_names) == {"verdict", *wide}
    assert list(run_campaign(campaign(samples=2), tmp_path / "none", workers=0).responses()) == []
