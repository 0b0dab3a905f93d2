"""Results are there whole, or not at all."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from passiflex.files import OutputError, is_half_written, whole_file


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


def mode(path: Path) -> int:
    return path.stat().st_mode & 0o777


def write(path: Path) -> None:
    with whole_file(path) as temporary:
        temporary.write_text("new")


@pytest.fixture
def umask(request: pytest.FixtureRequest) -> Iterator[None]:
    before = os.umask(request.param)
    yield
    os.umask(before)


@pytest.mark.parametrize(
    ("umask", "expected"), [(0o022, 0o644), (0o077, 0o600), (0o007, 0o660)], indirect=["umask"]
)
def test_who_may_read_it_is_up_to_the_umask(tmp_path: Path, umask: None, expected: int) -> None:
    with whole_file(tmp_path / "run.nc") as temporary:
        assert mode(temporary) == expected  # from the first byte on
    assert mode(tmp_path / "run.nc") == expected


def test_a_file_that_was_private_stays_private(tmp_path: Path) -> None:
    path = tmp_path / "run.nc"
    path.touch(0o600)
    write(path)
    assert mode(path) == 0o600


@pytest.mark.parametrize("there", [True, False])
def test_a_link_is_written_through(tmp_path: Path, there: bool) -> None:
    target, link, again = tmp_path / "a" / "run.nc", tmp_path / "link.nc", tmp_path / "again.nc"
    target.parent.mkdir()
    if there:
        target.write_text("old")
    link.symlink_to("a/run.nc")
    again.symlink_to(link)
    write(again)
    assert target.read_text() == "new"
    assert (os.readlink(link), os.readlink(again)) == ("a/run.nc", str(link))
    assert names(tmp_path / "a") == ["run.nc"]


def test_links_in_a_ring_are_one_line(tmp_path: Path) -> None:
    (tmp_path / "a.nc").symlink_to("b.nc")
    (tmp_path / "b.nc").symlink_to("a.nc")
    with pytest.raises(OutputError, match=r"cannot write .*a\.nc; got Too many levels of symbolic links"):
        write(tmp_path / "a.nc")


def test_what_is_no_file_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "null.nc").symlink_to("/dev/null")
    os.mkfifo(tmp_path / "pipe.nc")
    for name in ("null.nc", "pipe.nc"):
        with pytest.raises(OutputError, match="got no regular file is there"):
            write(tmp_path / name)
    assert Path("/dev/null").is_char_device()
    assert (tmp_path / "pipe.nc").is_fifo()


def test_names_of_temporaries_are_told_from_all_others(tmp_path: Path) -> None:
    for name in ("samples.parquet", "no_ending", "a-b.tar.gz", "ö" * 120 + ".nc"):
        with whole_file(tmp_path / name) as temporary:
            assert is_half_written(temporary)
    own = (
        ".samples-k3j2h1g0.parquet",
        ".my-settings.json",
        ".a-00000000-00000000.nc",
        "samples.parquet",
        ".x",
    )
    assert not any(is_half_written(tmp_path / name) for name in own)
    assert not is_half_written(temporary.with_name(temporary.name.removeprefix(".")))
    assert not is_half_written(temporary.with_suffix(".json"))


def test_a_folder_is_not_made_if_it_is_not_to_be(tmp_path: Path) -> None:
    with (
        pytest.raises(OutputError, match="No such file"),
        whole_file(tmp_path / "gone" / "run.nc", parents=False),
    ):
        pytest.fail("the block must not run")
    assert names(tmp_path) == []


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
