"""Results are there whole, or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from passiflex.files import OutputError, whole_file


def names(folder: Path) -> list[str]:
    """Return everything in a folder, hidden files too."""
    return sorted(p.name for p in folder.iterdir())


def test_the_file_appears_when_the_block_ends(tmp_path: Path) -> None:
    path = tmp_path / "run.nc"
    with whole_file(path) as temporary:
        temporary.write_text("whole")
        assert not path.exists()
        assert temporary.parent == path.parent  # a move within one file system is one step
        assert temporary.suffix == ".nc"  # writers choose their format by it
    assert path.read_text() == "whole"
    assert names(tmp_path) == ["run.nc"]


def test_everyone_may_read_it(tmp_path: Path) -> None:
    with whole_file(tmp_path / "run.nc"):
        pass
    assert (tmp_path / "run.nc").stat().st_mode & 0o777 == 0o644


def test_folders_are_made(tmp_path: Path) -> None:
    with whole_file(tmp_path / "a" / "b" / "run.nc") as temporary:
        temporary.write_text("whole")
    assert names(tmp_path / "a" / "b") == ["run.nc"]


def test_an_earlier_file_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "run.nc"
    path.write_text("old")
    with whole_file(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"


def broken(path: Path, error: BaseException) -> None:
    with whole_file(path) as temporary:
        temporary.write_text("half")
        raise error


@pytest.mark.parametrize("error", [ValueError("wrong"), KeyboardInterrupt(), SystemExit(3)])
def test_nothing_is_left_of_a_block_that_fails(tmp_path: Path, error: BaseException) -> None:
    with pytest.raises(type(error)):
        broken(tmp_path / "run.nc", error)
    assert names(tmp_path) == []


@pytest.mark.parametrize("error", [ValueError("wrong"), OSError(errno.ENOSPC, "No space left on device")])
def test_an_earlier_file_survives_a_failure(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "run.nc"
    path.write_bytes(b"old")
    with pytest.raises((ValueError, OutputError)):
        broken(path, error)
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["run.nc"]


def test_a_full_disk_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "run.nc"
    with pytest.raises(OutputError) as error:
        broken(path, OSError(errno.ENOSPC, "No space left on device"))
    assert (
        str(error.value)
        == f"cannot write {path}; got No space left on device; try another folder, or freeing disk space"
    )


@pytest.mark.parametrize("below", ["run.nc", "deeper/run.nc"])
def test_a_file_in_place_of_the_folder_is_one_line(tmp_path: Path, below: str) -> None:
    (tmp_path / "taken").write_text("a file")
    path = tmp_path / "taken" / below
    with pytest.raises(OutputError, match="cannot write") as error, whole_file(path):
        pytest.fail("the block must not run")
    assert str(error.value).startswith(f"cannot write {path}; got ")
    assert "\n" not in str(error.value)
    assert (tmp_path / "taken").read_text() == "a file"


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everywhere")
def test_a_folder_without_permission_is_one_line(tmp_path: Path) -> None:
    folder = tmp_path / "closed"
    folder.mkdir(mode=0o555)
    with pytest.raises(OutputError, match="cannot write") as error, whole_file(folder / "run.nc"):
        pytest.fail("the block must not run")
    assert "Permission denied" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_folder_in_place_of_the_file_stays(tmp_path: Path) -> None:
    path = tmp_path / "run.nc"
    path.mkdir()
    with pytest.raises(OutputError), whole_file(path) as temporary:
        temporary.write_text("whole")
    assert path.is_dir()
    assert names(tmp_path) == ["run.nc"]
    assert names(path) == []


def test_two_writers_do_not_meet(tmp_path: Path) -> None:
    """Each has a name of its own; the last to finish wins, whole."""
    path = tmp_path / "run.nc"
    with whole_file(path) as first, whole_file(path) as second:
        assert first != second
        first.write_text("first")
        second.write_text("second")
    assert path.read_text() == "first"
    assert names(tmp_path) == ["run.nc"]
