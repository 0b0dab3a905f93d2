"""The commands that look at runs: what they write, what they say of damage, and what they refuse."""

from __future__ import annotations

import csv
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from cli.shell import Shell
from passiflex.files import OutputError
from passiflex.simulation import Run, parse_scenario, simulate
from reports.pages import VIEWER
from worlds import PLANAR

BEGINNINGS = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(monkeypatch, capsys)


@pytest.fixture(autouse=True)
def no_screen_and_no_bundle(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("passiflex.reports.report.read_viewer", lambda: VIEWER)
    monkeypatch.setattr("passiflex.reports.screen.has_screen", lambda: False)


@lru_cache
def run() -> Run:
    return simulate(parse_scenario(PLANAR))


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    return run().save(tmp_path / "run.nc")


def with_gap(path: Path) -> Path:
    """Write the run with a gap in the motor torque."""
    data = run().data.copy(deep=True)
    data["tau_m"][10:12] = np.nan
    return Run(data).save(path)


# show


def test_show_writes_one_page_beside_the_run(shell: Shell, saved: Path) -> None:
    result = shell("show", saved)
    assert result.status == 0
    assert result.out.splitlines()[0] == f"wrote {saved.with_suffix('.html')}"
    page = saved.with_suffix(".html").read_text(encoding="utf-8")
    assert page.startswith("<!DOCTYPE html>") or page.startswith("<!doctype html>")
    assert "opened" not in result.out


def test_show_opens_it_where_there_is_a_screen(
    shell: Shell, saved: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[Path] = []
    monkeypatch.setattr("passiflex.reports.open_in_browser", lambda path: opened.append(path) or True)
    assert "opened it in the browser" in shell("show", saved).out
    shell("show", saved, "--out", saved.with_name("named.html"))
    assert opened == [saved.with_suffix(".html")]


def test_show_compares_runs(shell: Shell, saved: Path, tmp_path: Path) -> None:
    other = run().every(2).save(tmp_path / "other.nc")
    out = tmp_path / "both.html"
    assert shell("show", saved, "--compare", other, saved, "--out", out).status == 0
    assert "planar (3)" in out.read_text(encoding="utf-8")


def test_show_says_what_is_damaged_and_shows_the_rest(shell: Shell, tmp_path: Path) -> None:
    path = with_gap(tmp_path / "gap.nc")
    result = shell("show", path)
    assert result.status == 0
    notice = "Numbers that are not finite or too large, shown as gaps: tau_m (first at 0.1 s)."
    assert result.out.splitlines()[0] == f"{path}: {notice}"
    assert notice in path.with_suffix(".html").read_text(encoding="utf-8")


def test_show_says_which_of_the_compared_runs_is_damaged(shell: Shell, saved: Path, tmp_path: Path) -> None:
    path = with_gap(tmp_path / "gap.nc")
    shell("show", path, "--compare", path, saved, "--out", tmp_path / "both.html")
    header = (tmp_path / "both.html").read_text(encoding="utf-8")
    notice = "Numbers that are not finite or too large, shown as gaps: tau_m (first at 0.1 s)."
    assert f'["{notice}","gap.nc: {notice}"' in header.split('"notices":', 1)[1]


def test_run_show_writes_the_same_page(shell: Shell, saved: Path, tmp_path: Path) -> None:
    shell("show", saved)
    path = Run.load(saved).show(tmp_path / "python.html")
    assert path.read_bytes() == saved.with_suffix(".html").read_bytes()
    nowhere = run().show()
    assert nowhere.name == "planar.html"
    assert nowhere.parent != tmp_path


def test_run_show_compares_runs_and_files(saved: Path, tmp_path: Path) -> None:
    out = tmp_path / "both.html"
    pages = [run().show(out, compare=beside).read_bytes() for beside in (run(), [run()], saved, [str(saved)])]
    assert len(set(pages)) == 1
    assert b"planar (2)" in pages[0]


def test_run_show_does_not_write_over_a_run(saved: Path) -> None:
    before = saved.read_bytes()
    with pytest.raises(OutputError) as error:
        run().show(saved)
    expected = f"wrong name for a report; got {saved}; needs a file name that ends in .html or .htm"
    assert str(error.value) == expected
    assert saved.read_bytes() == before


# plot


@pytest.mark.parametrize("kind", ["energy", "tracking", "torque", "port"])
def test_plot_draws_every_kind(shell: Shell, saved: Path, kind: str) -> None:
    result = shell("plot", saved, "--kind", kind)
    assert result.status == 0
    written = saved.with_name(f"run_{kind}.png")
    assert result.out.splitlines()[0] == f"wrote {written}"
    assert written.read_bytes().startswith(BEGINNINGS[".png"])


@pytest.mark.parametrize("ending", [".png", ".pdf", ".svg"])
def test_plot_writes_what_the_name_says(shell: Shell, saved: Path, tmp_path: Path, ending: str) -> None:
    out = tmp_path / f"figure{ending}"
    result = shell("plot", saved, "--kind", "energy", "--compare", saved, "--size", "slide", "--out", out)
    assert result.status == 0
    assert out.read_bytes().startswith(BEGINNINGS[ending])


def test_plot_of_contacts_says_that_there_are_none(shell: Shell, saved: Path) -> None:
    result = shell("plot", saved, "--kind", "contact")
    assert result.status != 0
    assert "has no signals to draw for contact" in result.err


def test_plot_of_another_kind(shell: Shell, saved: Path) -> None:
    result = shell("plot", saved, "--kind", "power")
    assert result.status != 0
    assert "energy" in result.out + result.err


# export


def test_export_writes_the_table(shell: Shell, saved: Path) -> None:
    result = shell("export", saved, "--to", "csv")
    assert result.status == 0
    assert result.out.splitlines()[0] == f"wrote {saved.with_suffix('.csv')}"
    with saved.with_suffix(".csv").open(newline="", encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    column = head.index("tank_energy [J]")
    np.testing.assert_array_equal([float(row[column]) for row in rows], run()["tank_energy"])


@pytest.mark.parametrize(("to", "extra"), [("rrd", "rerun"), ("mcap", "mcap")])
def test_export_writes_for_other_programs(shell: Shell, saved: Path, to: str, extra: str) -> None:
    pytest.importorskip("rerun" if extra == "rerun" else "mcap_ros2")
    out = saved.with_name(f"named.{to}")
    assert shell("export", saved, "--to", to, "--out", out).status == 0
    assert out.stat().st_size > 1000


# mistakes


@pytest.mark.parametrize("words", [("show",), ("plot", "--kind", "energy"), ("export", "--to", "csv")])
def test_a_file_that_is_no_run(shell: Shell, tmp_path: Path, words: tuple[str, ...]) -> None:
    path = tmp_path / "text.nc"
    path.write_text("time,q\n0,1\n")
    result = shell(words[0], path, *words[1:])
    assert result.status == 2
    assert result.err.startswith(f"passiflex: {path} is not a netCDF-4 file; needs ")
    assert [p.name for p in tmp_path.iterdir()] == ["text.nc"]


@pytest.mark.parametrize(
    ("words", "out", "needs"),
    [
        (("show",), "page.txt", ".html or .htm"),
        (("plot", "--kind", "energy"), "figure.jpg", ".png or .pdf or .svg"),
        (("export", "--to", "csv"), "table.mcap", ".csv"),
    ],
)
def test_a_name_that_does_not_fit(
    shell: Shell, saved: Path, words: tuple[str, ...], out: str, needs: str
) -> None:
    target = saved.with_name(out)
    result = shell(words[0], saved, *words[1:], "--out", target)
    assert result.status == 2
    expected = f"wrong name for the file to write; got {target}; needs a file name that ends in {needs}"
    assert result.err == f"passiflex: {expected}\n"
    assert not target.exists()


@pytest.mark.parametrize("words", [("show",), ("plot", "--kind", "energy"), ("export", "--to", "csv")])
def test_a_folder_that_cannot_be_made_is_missed_before_the_run_is_read(
    shell: Shell, tmp_path: Path, words: tuple[str, ...]
) -> None:
    (tmp_path / "taken").write_text("a file")
    endings = {"show": ".html", "plot": ".png", "export": ".csv"}
    out = tmp_path / "taken" / f"it{endings[words[0]]}"
    empty = tmp_path / "none.nc"
    empty.touch()
    result = shell(words[0], empty, *words[1:], "--out", out)
    assert result.status == 2
    assert "cannot write" in result.err
    assert "none.nc" not in result.err


@pytest.mark.parametrize("words", [("show",), ("plot", "--kind", "energy"), ("export", "--to", "csv")])
def test_a_folder_in_place_of_a_file(shell: Shell, saved: Path, words: tuple[str, ...]) -> None:
    assert shell(words[0], ".", *words[1:]).err == "passiflex: . is a folder; needs the file of a run\n"
    ending = {"show": ".html", "plot": ".png", "export": ".csv"}[words[0]]
    folder = saved.with_name(f"folder{ending}")
    folder.mkdir()
    result = shell(words[0], saved, *words[1:], "--out", folder)
    assert result.err == f"passiflex: the file to write is a folder; got {folder}\n"


def test_a_run_is_not_written_over(shell: Shell, tmp_path: Path) -> None:
    path = run().save(tmp_path / "run.html")
    before = path.read_bytes()
    result = shell("show", path)
    assert result.err == f"passiflex: the file to write is one of those that are read; got {path}\n"
    assert path.read_bytes() == before
