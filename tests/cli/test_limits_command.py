"""`passiflex limits` and `recommend`: sentence, tables, files; status 0 for stable, 1 for unstable, 2 for mistakes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

import passiflex.limits
from cli.shell import Result, Shell
from passiflex.errors import ValueRangeError
from passiflex.limits import check
from passiflex.simulation import load_scenario
from worlds import PLAIN, merged


def limits(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *arguments: object) -> Result:
    return Shell(monkeypatch, capsys)("limits", *arguments)


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    path = tmp_path / "planar.yaml"
    path.write_text(PLAIN.replace("rate: 1000", "rate: 1000, delay: 0.001"))
    return path


def test_stable_gains_end_with_0_and_the_answer(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, scenario: Path, tmp_path: Path
) -> None:
    out = tmp_path / "new"
    result = limits(capsys, monkeypatch, scenario, "--out", out)
    assert result.status == 0
    lines = result.out.splitlines()
    answer = check(scenario)
    assert answer.sentence in lines
    assert any(line.startswith("margin: at the start and within 0.3 rad of it B, K, D") for line in lines)
    (one,) = (line for line in lines if re.match(r"│ 1 +│", line))
    cells = [float(cell) for cell in one.strip("│").split("│")]
    assert cells[2] == pytest.approx(answer.least_inertia, rel=0.02)
    assert cells[1] < cells[2] < cells[3]
    assert re.search(r"│ these gains +│ 0\.\d+ +│ stable +│ settles", result.out)
    assert re.search(r"│ K_e = 1 K, B_e = \S+ B +│ 1\.\d+ +│ unstable +│ grows", result.out)
    assert "differs" not in result.out
    assert [f"wrote {out / name}" for name in ("limits.png", "limits.pdf")] == lines[-2:]
    assert sorted(p.name for p in out.iterdir()) == ["limits.pdf", "limits.png"]
    assert re.fullmatch(r"took \d+\.\d s", result.err.splitlines()[-1])


def test_unstable_gains_end_with_1(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, scenario: Path
) -> None:
    result = limits(capsys, monkeypatch, scenario, "--rate", "0.25 kHz", "--delay", "8 ms")
    assert result.status == 1
    lines = result.out.splitlines()
    short = [
        line
        for line in lines
        if re.match("cause: joint|number: .* at 250 Hz with 2 periods of delay|remedy: ", line)
    ]
    assert len(short) == 3
    assert "remedy that was tried" not in result.out
    assert re.search(r"│ these gains +│ 1\.\d+ +│ unstable +│ grows", result.out)


def test_a_recommendation_can_be_pasted(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, scenario: Path, tmp_path: Path
) -> None:
    result = limits(capsys, monkeypatch, scenario, "--recommend")
    assert re.search(
        r"^# recommended: planar2r at 1 kHz .* inner loop \(the \w+ inner loop needs ", result.out, re.M
    )
    assert "each joint off by up to 20 % and the delay by 0.2 periods" in result.out
    snippet = yaml.safe_load(result.out[result.out.index("law:\n") :])
    pasted = tmp_path / "pasted.yaml"
    pasted.write_text(yaml.safe_dump(yaml.safe_load(scenario.read_text()) | snippet))
    assert check(load_scenario(pasted)).stable


def test_a_recommendation_for_a_robot_alone_can_be_pasted(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, scenario: Path, tmp_path: Path
) -> None:
    """Into a scenario of that robot, whose own sections it stands for."""
    words = [
        "planar2r",
        "--rate",
        "1 kHz",
        "--margin",
        "10 %",
        "--task",
        "position",
        "--inner-loop",
        "matched",
    ]
    result = Shell(monkeypatch, capsys)("recommend", *words)
    assert result.status == 0
    assert re.search(
        r"^# recommended: planar2r at 1 kHz with no delay: .* the matched inner loop$", result.out, re.M
    )
    assert "each joint off by up to 10 % and the delay by 0.1 periods" in result.out
    snippet = yaml.safe_load(result.out)
    assert snippet["control"]["inner_loop"] == "matched"
    pasted = tmp_path / "pasted.yaml"
    pasted.write_text(yaml.safe_dump(yaml.safe_load(scenario.read_text()) | snippet))
    assert check(load_scenario(pasted)).stable


def test_a_scenario_is_asked_for_with_what_the_command_was_told(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, scenario: Path
) -> None:
    """By `recommend` and by `limits --recommend` alike; the task of the latter is in the problem."""
    told: list[tuple[tuple[Any, ...], dict[str, Any]]] = []

    def instead(*given: Any, report: object, **options: Any) -> None:
        told.append((given, options))
        raise ValueRangeError("nothing holds")

    monkeypatch.setattr(passiflex.limits, "recommend_for", instead)
    words = ["--rate", "2 kHz", "--delay", "1 ms", "--task", "position", "--inner-loop", "plain"]
    result = Shell(monkeypatch, capsys)("recommend", scenario, *words, "--margin", "10 %")
    assert (result.status, result.err) == (2, "passiflex: nothing holds\n")
    assert told.pop() == ((str(scenario), 0.1, "2 kHz", "1 ms"), {"task": "position", "inner_loop": "plain"})
    assert (
        "recommended: nothing; nothing holds\n"
        in limits(capsys, monkeypatch, scenario, *words, "--recommend").out
    )
    ((problem,), options) = told.pop()
    assert (problem.period, options) == (1 / 2000, {"inner_loop": "plain"})


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["planar2r"], "a robot alone has no control rate; needs one beside it; try --rate '1 kHz'"),
        (["planar2", "--rate", "1 kHz"], "unknown robot; got 'planar2'; "),
        (["planar2r", "--rate", "1 m"], "rate; got '1 m'; needs Hz, one number, > 0"),
        (["planar2r", "--rate", "1 kHz", "--margin", "3 N"], "margin; got '3 N'; "),
        (["planar2r", "--rate", "1 kHz", "--margin", "100 %"], "margin; got 1; needs 0 to below 1"),
    ],
)
def test_what_recommend_cannot_take_is_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, words: list[str], message: str
) -> None:
    result = Shell(monkeypatch, capsys)("recommend", *words)
    assert result.status == 2
    assert result.err.startswith(f"passiflex: {message}")
    assert len(result.err.splitlines()) == 1


def test_task_and_inner_loop_stand_for_those_of_the_scenario(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, scenario: Path, tmp_path: Path
) -> None:
    written = yaml.safe_load(scenario.read_text())
    matched = tmp_path / "matched.yaml"
    matched.write_text(yaml.safe_dump(merged(written, {"control": {"inner_loop": "matched"}})))
    result = limits(capsys, monkeypatch, scenario, "--inner-loop", "matched", "--task", "position")
    (radius,) = re.findall(r"│ these gains +│ (0\.\d+) ", result.out)
    assert radius == f"{check(matched).spectrum.radius:.5f}"
    assert radius != f"{check(scenario).spectrum.radius:.5f}"
    result = limits(capsys, monkeypatch, scenario, "--task", "pose")
    assert result.status == 2
    assert "law.stiffness.rotation: missing; a pose task needs it" in result.err


def test_why_gives_every_remedy_with_what_to_write(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, scenario: Path
) -> None:
    scenario.write_text(scenario.read_text().replace("{ratio: 0.3}", "{ratio: 0.05}"))
    result = limits(capsys, monkeypatch, scenario, "--why")
    assert result.status == 1
    assert "at 1 kHz with 1 period of delay: " in result.out
    assert re.search(r"^remedy that was tried: B_e .*'shaped_inertia'", result.out, re.M)


def test_a_scenario_in_continuous_time_needs_a_rate(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    path = tmp_path / "continuous.yaml"
    data = merged(yaml.safe_load(PLAIN), {"control": None, "tank": None})
    path.write_text(yaml.safe_dump(data))
    result = limits(capsys, monkeypatch, path)
    assert result.status == 2
    assert result.err == (
        "passiflex: scenario 'planar' has no control rate; needs `control: {rate: …}`, or a rate beside it; "
        "try --rate '1 kHz', or rate=1000\n"
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--rate", "fast"], "passiflex: rate; got 'fast'; needs Hz, one number, > 0"),
        (["--rate", "0"], "passiflex: rate; got '0'"),
        (["--delay", "1 m"], "passiflex: delay; got '1 m'"),
        (["--delay", "1 s"], "passiflex: delay of a command; got 1 s; needs 0 to 60 periods"),
    ],
)
def test_what_makes_no_sense_ends_with_2_and_one_line(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    scenario: Path,
    arguments: list[str],
    message: str,
) -> None:
    result = limits(capsys, monkeypatch, scenario, *arguments)
    assert result.status == 2
    assert result.err.startswith(message)
    assert len(result.err.splitlines()) == 1


def test_a_folder_that_cannot_be_written_is_told_before_the_work(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, scenario: Path, tmp_path: Path
) -> None:
    (tmp_path / "taken").write_text("a file")
    result = limits(capsys, monkeypatch, scenario, "--out", tmp_path / "taken" / "new")
    assert result.status == 2
    assert result.out == ""
    assert result.err.startswith("passiflex: cannot write into")
