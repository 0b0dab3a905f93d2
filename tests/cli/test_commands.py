"""The command line: what it prints, what it writes, and with which status it ends."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import passiflex
from cli.shell import Shell
from passiflex.passivity import audit
from passiflex.simulation import Run, parse_scenario, passed_limits, simulate
from passiflex.studies.reproduce import FIGURES, STUDIES
from worlds import PLANAR, by_rows, ran

WRONG = """\
name: wrong
robot: planar2r
posture: [0.5, eight]
law:
  type: impedance
  task: position
  gravity: robott
  shaped_stiffness: {ratio: -2}
  shaped_inertia: {ratio: 0.5}
  stiffnes: {translation: 60}
  damping: {translation: 20}
duration: 0.5
"""


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(monkeypatch, capsys)


@lru_cache
def run() -> Run:
    return simulate(parse_scenario(PLANAR))


def one_line(text: str) -> str:
    """Return the only line of a message, which may stand in a frame that breaks it."""
    words = [line.strip("│ ") for line in text.splitlines() if not re.match("[╭╰]", line)]
    return " ".join(w for w in words if w)


# simulate


def test_simulate_writes_one_file_and_says_so(shell: Shell, tmp_path: Path) -> None:
    scenario, out = tmp_path / "planar.yaml", tmp_path / "new" / "run.nc"
    scenario.write_text(PLANAR)
    result = shell("simulate", scenario, "--out", out)
    assert result.status == 0
    assert result.out == f"wrote {out}\n"
    working, took = result.err.splitlines()
    assert working == "planar: compiling and running"
    assert re.fullmatch(r"took \d+\.\d s", took)
    assert [p.name for p in out.parent.iterdir()] == ["run.nc"]
    np.testing.assert_array_equal(Run.load(out)["q"], run()["q"])


def test_every_mistake_of_a_scenario_is_told_and_nothing_written(shell: Shell, tmp_path: Path) -> None:
    scenario, out = tmp_path / "wrong.yaml", tmp_path / "new" / "run.nc"
    scenario.write_text(WRONG)
    result = shell("simulate", scenario, "--out", out)
    assert result.status == 2
    first, *mistakes = result.err.splitlines()
    assert first == f"passiflex: {scenario}: {len(mistakes)} mistakes"
    assert len(mistakes) >= 4
    for word in ("posture", "gravity", "shaped_stiffness", "stiffnes"):
        assert any(word in m for m in mistakes), word
    assert all(re.match(r"  line \d+, column \d+", m) for m in mistakes)
    assert not out.parent.exists()


def test_a_scenario_that_does_not_fit_its_robot(shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(PLANAR.replace("[0.5, 0.8]", "[0.5, 0.8, 1]"))
    result = shell("simulate", tmp_path / "s.yaml", "--out", tmp_path / "run.nc")
    assert result.status == 2
    assert result.err == (
        "passiflex: posture does not fit robot 'planar2r'; got 3 angles; needs 2 angles in rad\n"
    )
    assert not (tmp_path / "run.nc").exists()


def test_a_scenario_that_is_not_there(shell: Shell, tmp_path: Path) -> None:
    result = shell("simulate", tmp_path / "none.yaml", "--out", tmp_path / "run.nc")
    assert result.status == 2
    assert f"{tmp_path / 'none.yaml'}: 1 mistake" in result.err
    assert "No such file or directory" in result.err


def test_an_output_that_cannot_be_written(shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(PLANAR)
    (tmp_path / "taken").write_text("a file")
    result = shell("simulate", tmp_path / "s.yaml", "--out", tmp_path / "taken" / "run.nc")
    assert result.status == 2
    assert result.err.startswith(f"passiflex: cannot write into {tmp_path / 'taken'}; got ")
    assert len(result.err.splitlines()) == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["s.yaml", "taken"]


# audit


def saved(tmp_path: Path, **changes: float | str) -> Path:
    """Return the file of the run, with this much more energy through the joints at the end, or a failure."""
    data = run().data.copy(deep=True)
    energy = float(changes.get("energy", 0)) * run().time / run().time[-1]
    wrong = float(changes.get("wrong", 0)) * run().time / run().time[-1]
    for name, added in (("joint_energy", energy), ("link_kinetic_energy", energy + wrong)):
        data[name] = data[name].copy(data=data[name].to_numpy() + added)
    return Run(data.assign_attrs(failure=changes.get("failure", ""))).save(tmp_path / "run.nc")


def test_a_file_of_before_is_judged_by_its_rows_and_the_audit_says_so(shell: Shell, tmp_path: Path) -> None:
    sentence = "judged by the rows of the file alone: what happened between them was not noted"
    assert sentence not in shell("audit", saved(tmp_path)).out
    old = shell("audit", by_rows(run()).save(tmp_path / "old.nc"))
    assert old.status == 0
    assert sentence in old.out


def test_a_limit_that_is_passed_is_said_by_simulate_and_by_audit(shell: Shell, tmp_path: Path) -> None:
    stiff = PLANAR.replace("{translation: 60}", "{translation: 3000}").replace(
        "[0, 0, 0.05]", "[-0.3, 0, 0.3]"
    )
    scenario, out = tmp_path / "fast.yaml", tmp_path / "fast.nc"
    scenario.write_text(stiff + "tank: {initial: 200}\n")
    made, read = shell("simulate", scenario, "--out", out), shell("audit", out)
    for result in (made, read):
        lines = [line for line in result.out.splitlines() if " exceeds its " in line]
        assert lines == [str(passed) for passed in passed_limits(Run.load(out))]
        assert [line.split(",")[0] for line in lines] == [
            "joint 2 exceeds its speed limit", "motor 1 exceeds its torque limit",
        ]  # fmt: skip
    assert "exceeds" not in shell("audit", saved(tmp_path)).out


def test_what_the_energies_do_not_show_is_said(shell: Shell, tmp_path: Path) -> None:
    data = run().data.drop_vars("theta").copy(deep=True)
    data["q"][20:] = np.nan
    path = Run(data).save(tmp_path / "gaps.nc")
    lines = shell("audit", path).out.splitlines()
    assert lines[0] == f"{path}: The file lacks theta."
    expected = "Numbers that are not finite or too large, shown as gaps: q (first at 0.2 s)."
    assert lines[1] == f"{path}: {expected}"


def test_a_run_that_is_cut_short_is_no_passive_one(shell: Shell, tmp_path: Path) -> None:
    path = Run(run().data.isel(time=slice(0, 31))).save(tmp_path / "short.nc")
    result = shell("audit", path)
    assert result.status == 2
    assert "verdict: inconclusive" in result.out
    assert "remedy: the run ended early: its rows end at 0.3 s of 0.5 s" in result.out


def test_a_passive_run_ends_with_0(shell: Shell, tmp_path: Path) -> None:
    path = saved(tmp_path)
    result = shell("audit", path)
    expected = audit(run())
    assert result.status == 0
    assert result.err == ""
    assert (
        f"verdict: passive\nleast margin at {expected.time:g} s, most of it taken by: {expected.term}"
        in result.out
    )
    assert (
        f"margin: {expected.margin:.6g} J, integration error {expected.integration_error:.1e} J" in result.out
    )
    for balance in ("robot", "links", "law"):
        assert re.search(rf"│ {balance} +│", result.out)
    assert "remedy" not in result.out
    assert "books are wrong" not in result.out


def test_an_active_run_ends_with_1(shell: Shell, tmp_path: Path) -> None:
    result = shell("audit", saved(tmp_path, energy=3))
    assert result.status == 1
    assert "verdict: violated\ndecided at 0." in result.out
    assert (
        "the law's own books are wrong by up to 3 J\n" in result.out
    )  # there is neither model error nor noise
    assert "remedy: lower the gains or give the tank more to start with\n" in result.out


def test_an_undecided_run_ends_with_2(shell: Shell, tmp_path: Path) -> None:
    result = shell("audit", saved(tmp_path, failure="the integrator gave up"))
    assert result.status == 2
    assert "verdict: inconclusive" in result.out
    assert "remedy: the run ended early: the integrator gave up" in result.out


def test_audit_prints_what_errors_of_the_sensors_may_hide(shell: Shell, tmp_path: Path) -> None:
    """The bound at the end and its mean power, of a sampled run; nothing of it for a file of before."""
    sampled = ran(noise={"torque_variance": 0.2, "hold": 0.001}, duration=0.3)
    bound = sampled["measurement_bound"][-1]
    said = " ".join(shell("audit", sampled.save(tmp_path / "run.nc")).out.split())
    words = f"the tank may claim up to {bound:.3g} J too much by the end, {bound / 0.3:.2g} W on average"
    assert f"errors of the sensors: {words}; nothing was granted on it" in said
    older = Run(sampled.data.drop_vars("measurement_bound"))
    assert "errors of the sensors" not in shell("audit", older.save(tmp_path / "old.nc")).out


def test_files_that_cannot_be_audited_end_with_2(shell: Shell, tmp_path: Path) -> None:
    whole = saved(tmp_path).read_bytes()
    contents = {"text.nc": b"no run", "empty.nc": b"", "half.nc": whole[: len(whole) // 2]}
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
    for name in (*contents, "none.nc", "."):
        result = shell("audit", tmp_path / name)
        assert result.status == 2
        assert result.out == ""
        assert result.err.startswith("passiflex: ")
        assert len(result.err.splitlines()) == 1


# reproduce


def test_an_unknown_figure_names_the_nearest(shell: Shell, tmp_path: Path) -> None:
    result = shell("reproduce", "figg1", "--out", tmp_path / "new")
    assert result.status == 2
    assert result.err.startswith(
        f"passiflex: unknown figure; got 'figg1'; needs one of {', '.join(sorted((*FIGURES, *STUDIES)))}; try 'fig1'"
    )
    assert len(result.err.splitlines()) == 1
    assert not (tmp_path / "new").exists()


def test_its_help_names_every_study(shell: Shell) -> None:
    told = re.findall("[a-z]+", shell("reproduce", "--help").out.partition("The studies are")[2])
    assert set(STUDIES) <= set(told)


def test_sensitivity_takes_no_figures(shell: Shell, tmp_path: Path) -> None:
    result = shell("reproduce", "fig1", "--sensitivity", "--out", tmp_path / "new")
    assert result.status == 2
    assert result.err == "passiflex: --sensitivity takes no figure names; got fig1\n"
    assert not (tmp_path / "new").exists()


def test_reproduce_hands_over_what_it_was_told(
    shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from passiflex.studies import reproduce as room

    calls = []

    def instead(figures: tuple[str, ...], folder: Path, report: object) -> dict[str, list[Path]]:
        calls.append((figures, folder))
        return {"fig2": [folder / "fig2.png"], "summary": [folder / "summary.json"]}

    monkeypatch.setattr(room, "reproduce", instead)
    result = shell("reproduce", "fig2", "fig1", "--out", tmp_path)
    assert calls == [(("fig2", "fig1"), tmp_path)]
    assert result.status == 0
    lines = result.out.splitlines()
    assert lines == [f"wrote {tmp_path / 'fig2.png'}", f"wrote {tmp_path / 'summary.json'}"]
    assert result.err.splitlines()[-1].startswith("took ")
    shell("reproduce")
    assert calls[1] == ((), Path("results"))


# keys


def test_keys_are_those_of_every_section(shell: Shell) -> None:
    """What is written in a file of its own kind is in the table of its place."""
    for place, words in {
        "": ["robot", "posture", "duration", "environment"],
        "control": ["rate", "task_rate", "lost"],
        "control.lost": ["at", "periods"],
        "control.fallback.stiffness": ["translation", "matrix"],
        "environment": ["plane:", "load:", "person:"],
        "environment.plane": ["point", "normal", "stiffness"],
        "reference.circle": ["radius", "period"],
    }.items():
        result = shell("keys", *[place] * bool(place))
        assert (result.status, result.err) == (0, "")
        assert all(word in result.out for word in words), (place, result.out)


def test_a_place_that_there_is_not_is_told_with_those_that_there_are(shell: Shell) -> None:
    result = shell("keys", "control.falback")
    assert (result.status, result.out) == (2, "")
    assert result.err.startswith("passiflex: unknown section of control; got 'falback'")
    assert "try 'fallback'" in result.err


# robots, help, wrong use


def test_robots_lists_the_catalogue_with_its_sources(shell: Shell) -> None:
    result = shell("robots")
    assert result.status == 0
    assert "iiwa14: 7 joints\n  links: RobotLocomotion/models" in result.out
    assert "planar2r: 2 joints" in result.out
    # Sources hold brackets, which are not markup: nothing of them may be lost.
    assert "quoted in orocos_kdl, solvertest.cpp [2nd]" in result.out


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("simulate", ["--out", "netCDF"]),
        ("audit", ["0 passive", "1 violated", "2 inconclusive"]),
        ("reproduce", ["--out", "--sensitivity", "fig1"]),
        ("robots", ["catalogue"]),
    ],
)
def test_every_command_has_help(shell: Shell, command: str, words: list[str]) -> None:
    result = shell(command, "--help")
    assert result.status == 0
    for word in words:
        assert word in one_line(result.out)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["audit", "--loud", "run.nc"], "Unknown option: --loud."),
        (["audit"], 'Command "audit" parameter RUN requires an argument.'),
        (["simulate", "s.yaml"], 'Command "simulate" parameter --out requires an argument.'),
        (["robots", "all"], "Unused Tokens: ['all']."),
    ],
)
def test_wrong_use_is_one_message_and_never_status_0_or_1(
    shell: Shell, arguments: list[str], message: str
) -> None:
    """1 would mean `violated` to a script that audits."""
    result = shell(*arguments)
    assert result.status == 2
    assert result.out == ""
    assert one_line(result.err).startswith(message)


def test_the_installed_way(tmp_path: Path) -> None:
    """One real process: statuses, streams, and no traceback."""
    environment = os.environ | {"PYTHONPATH": str(Path(passiflex.__file__).parents[1])}
    command = [sys.executable, "-c", "from passiflex.cli import main; main()"]
    (tmp_path / "wrong.yaml").write_text(WRONG)
    arguments = ["simulate", "wrong.yaml", "--out", "run.nc"]
    ended = subprocess.run(
        [*command, *arguments], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 2
    assert ended.stdout == ""
    assert ended.stderr.startswith("passiflex: wrong.yaml: ")
    assert "Traceback" not in ended.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["wrong.yaml"]


@pytest.mark.parametrize("target", ["s.yaml", "run.csv", ""])
def test_out_must_be_a_netcdf_file_of_its_own(shell: Shell, tmp_path: Path, target: str) -> None:
    """Least of all may it overwrite the scenario."""
    (tmp_path / "s.yaml").write_text(PLANAR)
    result = shell("simulate", tmp_path / "s.yaml", "--out", tmp_path / target)
    assert result.status == 2
    assert result.err.startswith("passiflex: --out is no netCDF file; got ")
    assert (tmp_path / "s.yaml").read_text() == PLANAR
    assert [p.name for p in tmp_path.iterdir()] == ["s.yaml"]
