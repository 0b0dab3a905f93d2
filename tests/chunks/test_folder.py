"""What is the user's own in a campaign's folder stays; what is removed from it meanwhile costs no more than that."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from chunks.cheap_campaign import CHUNK, run, text, work
from passiflex.chunks import stored_rows
from passiflex.chunks.engines import InProcess
from passiflex.chunks.manifest import FolderError, load_manifest
from passiflex.chunks.run_chunks import ChunkError, Progress, run_chunks
from passiflex.chunks.source import PACKAGE, source_digest
from passiflex.chunks.store import open_store
from passiflex.chunks.stored_rows import read_blocks, read_rows
from passiflex.errors import PassiflexError
from passiflex.files import OutputError

SAMPLES = 30
OWN = (
    ".my-settings.json", ".docker-registry", ".editor-config12.yaml", ".gitignore", ".samples-abcd1234.parquet",
    ".manifest-00000000-00000000.json", "notes-20240101.parquet", "runs/sample_3.nc", "pieces/2023-2024.parquet",
    "pieces/1-2.parquet", "pieces/000000008-000000004.parquet", "pieces/.000000000-000000004-12345678.parquet",
)  # fmt: skip


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return run(tmp_path_factory.mktemp("whole"), 0, SAMPLES).read_bytes()


def partly(folder: Path) -> None:
    """Run a campaign up to sample 21, which raises."""
    with pytest.raises(ChunkError):
        run(folder, 0, SAMPLES, text(wrong=21), identity="{}")


def rest(folder: Path) -> Path:
    return run(folder, 0, SAMPLES, "{}", identity="{}")


def test_files_of_the_user_stay(tmp_path: Path, whole: bytes) -> None:
    partly(tmp_path)
    (tmp_path / "runs").mkdir()
    for name in OWN:
        (tmp_path / name).write_text("mine")
    assert rest(tmp_path).read_bytes() == whole
    assert rest(tmp_path).read_bytes() == whole
    assert [name for name in OWN if (tmp_path / name).read_text() == "mine"] == list(OWN)
    assert not list(tmp_path.glob("pieces/0*0.parquet"))


def test_a_lock_of_somebody_else_keeps_its_text(tmp_path: Path, whole: bytes) -> None:
    (tmp_path / ".lock").write_text("mine")
    assert rest(tmp_path).read_bytes() == whole
    assert (tmp_path / ".lock").read_text() == "mine"


def removing(folder: Path, what: Any, after: int, again: bool = False) -> PassiflexError:
    """Return how a campaign ends in whose folder something is removed when so many samples are done."""

    def remove(progress: Progress) -> None:
        if progress.done == after or (again and progress.done > after):
            what(folder)

    with (
        pytest.raises((FolderError, OutputError)) as error,
        open_store(folder, "{}", SAMPLES, chunk=CHUNK) as store,
    ):
        run_chunks(store, work, InProcess(), remove)
    assert "\n" not in str(error.value)
    return error.value


def chunks(folder: Path) -> None:
    shutil.rmtree(folder / "pieces")


def everything(folder: Path) -> None:
    shutil.rmtree(folder)


def everything_but_chunks(folder: Path) -> None:
    (folder / "manifest.json").unlink()
    (folder / ".lock").unlink()


def another_in_its_place(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.mkdir()
    (folder / ".lock").touch()


@pytest.mark.parametrize("again", [True, False])
@pytest.mark.parametrize("what", [chunks, everything, everything_but_chunks, another_in_its_place])
def test_what_is_removed_meanwhile_is_one_line_and_the_rest_is_kept(
    tmp_path: Path, whole: bytes, what: Any, again: bool
) -> None:
    folder = tmp_path / "c"
    error = removing(folder, what, 12, again)
    assert str(error).startswith(f"files of the campaign were removed from {folder} while it ran; got ")
    assert str(error).endswith("try the same again: only the missing ones are run")
    if what is chunks and not again:
        assert "got 18 of 30 samples at most" in str(error)
        assert read_rows(folder)["sample"].to_pylist() == list(range(12, 30))
    if what is everything_but_chunks:
        assert read_rows(folder).num_rows == 12
    assert rest(folder).read_bytes() == whole


def test_the_last_moment_is_no_exception(tmp_path: Path, whole: bytes) -> None:
    for what in (chunks, everything):
        assert (
            "got 0 of 30 samples at most" in str(removing(tmp_path / what.__name__, what, SAMPLES))
            or what is everything
        )
        assert rest(tmp_path / what.__name__).read_bytes() == whole


def test_a_manifest_alone_is_written_again(tmp_path: Path, whole: bytes) -> None:
    def remove(progress: Progress) -> None:
        (tmp_path / "manifest.json").unlink()

    with open_store(tmp_path, "{}", SAMPLES, chunk=CHUNK) as store:
        before = store.manifest
        assert run_chunks(store, work, InProcess(), remove).read_bytes() == whole
    assert load_manifest(tmp_path) == before


def test_no_piece_goes_before_the_file_of_all_is_read_back(
    tmp_path: Path, whole: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    groups = stored_rows._groups

    def lossy(*args: Any) -> Iterator[pa.Table]:
        return (group.slice(1) for group in groups(*args))

    with monkeypatch.context() as patched:
        patched.setattr(stored_rows, "_groups", lossy)
        with pytest.raises(FolderError, match="other samples than there should be"):
            rest(tmp_path)
    assert not (tmp_path / "samples.parquet").exists()
    assert read_rows(tmp_path).num_rows == SAMPLES
    assert rest(tmp_path).read_bytes() == whole


def test_rows_that_vanish_while_they_are_read_are_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, found = rest(tmp_path), stored_rows.stored(tmp_path)
    path.unlink()
    monkeypatch.setattr(stored_rows, "stored", lambda _: found)
    for read in (read_rows, lambda folder: list(read_blocks(folder))):
        with pytest.raises(FolderError, match=rf"rows are gone from {tmp_path}; got no "):
            read(tmp_path)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"samples": "5"}, "samples: expected a whole number, ≥ 1; got '5'"),
        ({"samples": -1}, "samples: expected a whole number, ≥ 1; got -1"),
        ({"samples": 2.0}, "samples: expected a whole number, ≥ 1; got 2"),
        ({"samples": True}, "samples: expected a whole number, ≥ 1; got True"),
        ({"samples": 10**12}, "samples: "),
        ({"piece": 0}, "piece: expected a whole number, ≥ 1; got 0"),
        ({"campaign": None}, "campaign: expected text; got None"),
        ({"campaign": 5}, "campaign: expected text; got 5"),
        ({"identity": ["a"]}, "identity: expected text; got ['a']"),
        ({"source": "../x"}, "source: expected letters, digits, and any of _ . -; got '../x'"),
        ({"runs": ["../../x"]}, "runs[0]: expected letters, digits, and any of _ . -; got '../../x'"),
        ({"runs": "sample_1.nc"}, "runs: "),
        ({"smaples": 5}, "smaples: unknown name; try 'samples'"),
    ],
)
def test_values_of_a_manifest_are_those_of_a_campaign(
    tmp_path: Path, entry: dict[str, Any], said: str
) -> None:
    with open_store(tmp_path, "{}", 2):
        pass
    path = tmp_path / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | entry))
    for use in (lambda: rest(tmp_path), lambda: read_rows(tmp_path)):
        with pytest.raises(FolderError) as error:
            use()
        assert str(error.value).startswith(f"{path} is damaged; got {said}")
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ('{"format": "passiflex campaign 1", "format": "x"}', "'format' is there twice"),
        ('{"samples": NaN}', "NaN is no number"),
        ("[" * 200_000, "nested too deeply"),
        ('{"samples": ' + "9" * 5000 + "}", "Exceeds the limit"),
        ("{", "Expecting property name"),
        ("null", "no mapping"),
    ],
)
def test_a_manifest_is_read_strictly(tmp_path: Path, content: str, said: str) -> None:
    (tmp_path / "manifest.json").write_text(content)
    with pytest.raises(FolderError, match=f"is damaged; got .*{said}"):
        load_manifest(tmp_path)


def test_a_manifest_that_is_no_file_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "manifest.json").symlink_to("/dev/zero")
    with pytest.raises(FolderError, match="is damaged; got no regular file"):
        load_manifest(tmp_path)


def test_a_manifest_of_before_is_read(tmp_path: Path) -> None:
    """It does not say which runs are the campaign's."""
    with open_store(tmp_path, "{}", 2):
        pass
    path = tmp_path / "manifest.json"
    content = json.loads(path.read_text())
    del content["runs"]
    path.write_text(json.dumps(content))
    assert load_manifest(tmp_path).runs == []


@pytest.mark.parametrize(
    ("file", "counts"),
    [
        ("diagrams/panel.py", False), ("reports/page.py", False), ("reports/bundle/viewer.js", False),
        ("exports/csv_file.py", False), ("plotting/run.py", False), ("cli/commands.py", False),
        ("problems/resolution.py", True), ("loops/plant.py", True), ("robots/data/iiwa14.urdf", True),
        ("native/lanes.h", True),
        ("metrics/measures.py", True), ("passivity/audit.py", True), ("chunks/tables.py", True),
    ],
)  # fmt: skip
def test_rows_are_of_the_source_that_makes_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str, counts: bool
) -> None:
    copy = tmp_path / "passiflex"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__", "bundle"))
    monkeypatch.setattr("passiflex.chunks.source.PACKAGE", copy)
    before = source_digest.__wrapped__()
    (copy / file).parent.mkdir(exist_ok=True)
    with (copy / file).open("a") as out:
        out.write("\n")
    assert (source_digest.__wrapped__() != before) == counts
