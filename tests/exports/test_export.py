"""The one function: an ending says the program, and a missing package says how to get it."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType

import pytest

from passiflex.errors import NameUnknownError
from passiflex.exports import export_run
from passiflex.exports.export import FORMATS, GROUP
from passiflex.extras import MissingExtraError
from passiflex.files import OutputError
from passiflex.simulation import Run


@pytest.mark.parametrize("ending", sorted(FORMATS))
def test_the_file_is_where_it_was_asked_for_and_alone(run: Run, tmp_path: Path, ending: str) -> None:
    path = export_run(run, str(tmp_path / "new" / f"run{ending}"))
    assert path == tmp_path / "new" / f"run{ending}"
    assert [p.name for p in path.parent.iterdir()] == [f"run{ending}"]
    assert path.stat().st_size > 1000


@pytest.mark.parametrize("name", ["run.cvs", "run", "run.CSV"])
def test_another_ending_is_refused(run: Run, tmp_path: Path, name: str) -> None:
    with pytest.raises(
        NameUnknownError, match=r"unknown ending of an export; got '.*'; needs one of .csv, .mcap, .rrd"
    ):
        export_run(run, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("ending", "module", "package"), [(".mcap", "mcap_ros2.writer", "mcap_ros2"), (".rrd", "rerun", "rerun")]
)
def test_a_missing_package_says_how_to_get_it(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str, module: str, package: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)  # as if it were not installed
    with pytest.raises(MissingExtraError, match=f"needs the package '{package}'") as caught:
        export_run(run, tmp_path / f"run{ending}")
    extra = {".mcap": "mcap", ".rrd": "rerun"}[ending]
    assert caught.value.try_ == f"pip install 'passiflex[{extra}]', in a checkout `make extras`"
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written_says_so(run: Run, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"cannot write .*run\.csv"):
        export_run(run, tmp_path / "file" / "run.csv")


def test_another_package_brings_an_ending(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By an entry point, which is loaded where a run is written; it cannot take the place of ours."""
    module = ModuleType("somebodys_format")
    module.write = lambda run, path: path.write_text(run.name)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "somebodys_format", module)
    points = [EntryPoint(ending, "somebodys_format:write", GROUP) for ending in (".txt", ".csv")]
    monkeypatch.setattr(
        "passiflex.exports.export.entry_points", lambda group: points if group == GROUP else []
    )
    assert export_run(run, tmp_path / "run.txt").read_text() == run.name
    assert export_run(run, tmp_path / "run.csv").read_text() != run.name
    with pytest.raises(NameUnknownError, match=r"'\.txt'"):
        export_run(run, tmp_path / "run.text")
