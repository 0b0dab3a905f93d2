"""`passiflex campaign | replay`: what they print and write, going on, and what they refuse; exit status 2 for that."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import passiflex
from campaigns.small_campaigns import SAMPLED, UNSTABLE, campaign
from cli.shell import Result, Shell
from passiflex.campaigns import Results, sample_scenario
from passiflex.chunks.run_chunks import Progress
from passiflex.cli import campaign_commands, terminal
from passiflex.metrics.measures import measures
from passiflex.metrics.steps import step_window
from passiflex.simulation import Run, resolve
from worlds import merged


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    """Without the sum in words and figures, which is not what is tested here."""
    monkeypatch.setattr(campaign_commands, "_sum_up", lambda results: None)
    return Shell(monkeypatch, capsys)


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(campaign().to_yaml())
    return path


def refused(result: Result, message: str) -> None:
    """One line of words, and nothing else."""
    assert result.status == 2
    assert result.out == ""
    assert re.match(f"passiflex: {message}", result.err), result.err
    assert len(result.err.strip().splitlines()) == 1


def test_a_campaign_runs_and_goes_on(shell: Shell, small: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    ours = shell("campaign", small, "--samples", 4, "--workers", 0, "--out", out)
    assert (ours.status, ours.out) == (0, "")
    progress, took = ours.err.splitlines()
    assert re.fullmatch(r"4 of 4 samples, \S+/s, 0 s left: 4 passive", progress)
    assert re.fullmatch(r"took \d+\.\d s", took)
    before = (out / "samples.parquet").read_bytes()
    again = shell("campaign", small, "--samples", 4, "--workers", 0, "--out", out)
    assert again.status == 0
    (took,) = again.err.splitlines()
    assert float(took.split()[1]) < 5
    assert (out / "samples.parquet").read_bytes() == before
    more = shell("campaign", small, "--workers", 0, "--out", out)
    assert "6 of 6 samples" in more.err
    assert Results.load(out).rows().num_rows == 6


def test_a_replay_has_the_numbers_of_its_row(shell: Shell, small: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shell("campaign", small, "--workers", 0, "--out", out)
    result = shell("replay", out, "--sample", 2)
    assert result.status == 0
    assert result.out == f"wrote {out / 'sample_2.nc'}\n"
    first, took = result.err.splitlines()
    assert first == f"{out}: sample 2"
    assert took.startswith("took ")
    scenario, row = sample_scenario(campaign(), 2), Results.load(out).rows().to_pylist()[2]
    found = measures(resolve(scenario), step_window(scenario), Run.load(out / "sample_2.nc"))
    assert {name: row[name] for name in ("margin", "verdict", "rms_to_msd", "torque_peak")} == {
        name: found[name] for name in ("margin", "verdict", "rms_to_msd", "torque_peak")
    }
    elsewhere = shell("replay", out, "--sample", 0, "--out", tmp_path / "new" / "zero.nc")
    assert f"wrote {tmp_path / 'new' / 'zero.nc'}" in elsewhere.out
    assert Run.load(tmp_path / "new" / "zero.nc").name == "small_0"


def test_a_replay_that_ends_early_says_so_with_status_2(shell: Shell, tmp_path: Path) -> None:
    wild = merged(
        UNSTABLE,
        {
            "control": {"allow_unstable": True},
            "tank": {"kind": "paper"},
            "law": {"shaped_stiffness": {"ratio": 10}},
        },
    )
    (tmp_path / "c.yaml").write_text(campaign(wild, samples=1).to_yaml())
    ran = shell("campaign", tmp_path / "c.yaml", "--workers", 0, "--out", tmp_path / "out")
    assert ran.status == 0
    result = shell("replay", tmp_path / "out", "--sample", 0)
    assert result.status == 2
    assert "passiflex:" not in result.err
    assert "the run ended early: the state left the finite numbers" in result.out
    assert Run.load(tmp_path / "out" / "sample_0.nc").failure


def test_what_replay_refuses(shell: Shell, small: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shell("campaign", small, "--samples", 2, "--workers", 0, "--out", out)
    before = sorted(out.iterdir())
    for sample in (2, -1):
        result = shell("replay", out, "--sample", sample)
        assert result.status == 2
        assert (
            f"passiflex: samples of campaign 'small'; got [{sample}]; needs " in result.err.splitlines()[-1]
        )
    empty = shell("replay", tmp_path, "--sample", 0)
    assert empty.status == 2
    assert empty.err.endswith(f"\npassiflex: {tmp_path} holds no campaign; got no manifest.json\n")
    for target in ("run.csv", ""):
        result = shell("replay", out, "--sample", 0, "--out", tmp_path / target)
        refused(result, "--out is no netCDF file; got ")
    assert sorted(out.iterdir()) == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out", "small.yaml"]


def test_workers_and_a_scheduler_are_one_too_many(shell: Shell, small: Path, tmp_path: Path) -> None:
    result = shell(
        "campaign", small, "--workers", 1, "--scheduler", "tcp://127.0.0.1:9", "--out", tmp_path / "out"
    )
    refused(result, "workers and scheduler; got 1, tcp://127.0.0.1:9; needs one of the two")
    assert not (tmp_path / "out").exists()


def test_what_campaign_refuses(shell: Shell, small: Path, tmp_path: Path) -> None:
    (tmp_path / "unstable.yaml").write_text(campaign(UNSTABLE).to_yaml())
    (tmp_path / "wrong.yaml").write_text(
        campaign().to_yaml().replace("distribution: uniform", "distribution: unifrom")
    )
    out = tmp_path / "out"
    for name, options, message in (
        (
            "unstable.yaml",
            (),
            "the law of 'planar' does not hold\n  cause: .*\n  number: .*\n  remedy: .*control.allow_unstable: true",
        ),
        ("small.yaml", ("--workers", -1), "number of worker processes; got -1; needs ≥ 1"),
        ("small.yaml", ("--samples", 0), "number of samples; got 0; needs 1 to 1000000"),
        ("none.yaml", (), "none.yaml|.*none.yaml"),
        ("wrong.yaml", (), ".*wrong.yaml: "),
    ):
        result = shell("campaign", tmp_path / name, *options, "--out", out)
        assert (result.status, result.out) == (2, "")
        assert re.match(f"passiflex: {message}", result.err), result.err
        assert not out.exists()


def test_out_is_a_file(shell: Shell, small: Path, tmp_path: Path) -> None:
    refused(shell("campaign", small, "--workers", 0, "--out", small), "cannot write into ")
    assert small.read_text() == campaign().to_yaml()


def test_a_scheduler_that_is_not_there_is_not_waited_for(small: Path, tmp_path: Path) -> None:
    """In a process of its own, as what the other threads print cannot be caught here."""
    pytest.importorskip("distributed")
    environment = os.environ | {"PYTHONPATH": str(Path(passiflex.__file__).parents[1])}
    command = [sys.executable, "-c", "from passiflex.cli import main; main()"]
    arguments = ["campaign", small, "--scheduler", "tcp://127.0.0.1:9", "--out", tmp_path / "out"]
    ended = subprocess.run(
        [*command, *arguments], env=environment, capture_output=True, text=True, check=False, timeout=300
    )
    assert (ended.returncode, ended.stdout) == (2, "")
    assert re.fullmatch(r"passiflex: no scheduler answers at tcp://127\.0\.0\.1:9; got .*\n", ended.stderr)
    assert not (tmp_path / "out").exists()


def progress(done: int, **verdicts: int) -> Progress:
    return Progress(done, 100, 12.3456, (100 - done) / 12.3456, verdicts)


def test_progress_without_a_terminal_is_a_line_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The first, the last, and one in ten seconds between."""
    now = 1000.0
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now)
    with terminal.campaign_bar() as show:
        for done, later in ((1, 0.0), (2, 9.0), (3, 1.5), (4, 1.0), (100, 0.1)):
            now += later
            show(progress(done, violated=1, passive=done - 1))
    assert capsys.readouterr().err.splitlines() == [
        "1 of 100 samples, 12.3/s, 8 s left: 0 passive, 1 violated",
        "3 of 100 samples, 12.3/s, 8 s left: 2 passive, 1 violated",
        "100 of 100 samples, 12.3/s, 0 s left: 99 passive, 1 violated",
    ]


def test_the_words_of_progress_before_the_first_verdict() -> None:
    assert terminal._words(progress(0)).endswith("s left: ")


@pytest.mark.parametrize("command", ["campaign", "replay"])
def test_help_says_what_the_options_do(shell: Shell, command: str) -> None:
    result = shell(command, "--help")
    assert result.status == 0
    assert "--out" in result.out


def test_the_lines_of_a_sampled_campaign_name_it(shell: Shell, tmp_path: Path) -> None:
    """Every verdict is counted."""
    c = campaign(
        merged(SAMPLED, {"control": {"allow_unstable": True}}),
        samples=4,
        parameters={"law.shaped_inertia.ratio": {"distribution": "choice", "values": [0.2, 1]}},
    )
    (tmp_path / "c.yaml").write_text(c.to_yaml())
    result = shell("campaign", tmp_path / "c.yaml", "--workers", 0, "--out", tmp_path / "out")
    verdicts = Results.load(tmp_path / "out").rows()["verdict"].to_pylist()
    counted = ", ".join(f"{verdicts.count(v)} {v}" for v in sorted(set(verdicts)))
    assert result.err.splitlines()[0].endswith(f"left: {counted}")
    assert set(verdicts) == {"passive", "violated"}


def test_an_interruption_is_one_line(
    shell: Shell, small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The framework of the command line would end without a word."""

    def interrupted(*arguments: object, **more: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("passiflex.campaigns.run_campaign", interrupted)
    result = shell("campaign", small, "--workers", 0, "--out", tmp_path / "out")
    assert (result.status, result.out) == (130, "")
    assert result.err == "passiflex: interrupted; nothing is half-written, and the same command goes on\n"
