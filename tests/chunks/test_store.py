"""A campaign's folder survives what happens to it, and holds each sample once."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from chunks.cheap_campaign import CHUNK, ENVIRONMENT, evaluations, logged, row, run, start, text
from passiflex.chunks.folder_lock import FolderInUseError
from passiflex.chunks.manifest import FolderError
from passiflex.chunks.run_chunks import ChunkError
from passiflex.chunks.store import open_store
from passiflex.chunks.stored_rows import DamagedError, chunk_path, read_rows
from passiflex.chunks.tables import RowsError
from passiflex.errors import ValueRangeError
from passiflex.files import OutputError, whole_file

SAMPLES = 30


def partly(folder: Path, samples: int = SAMPLES, **settings: Any) -> None:
    """Run a campaign up to sample 21, which raises: the chunks before 20 are there."""
    with pytest.raises(ChunkError):
        run(folder, 0, samples, text(wrong=21, **settings), identity="cheap")


def rest(folder: Path, samples: int = SAMPLES, **settings: Any) -> Path:
    """Run what is missing."""
    return run(folder, 0, samples, text(**settings), identity="cheap")


def everything(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return the file of all rows of a run that nothing happened to."""
    return rest(tmp_path_factory.mktemp("whole")).read_bytes()


def test_the_rows_are_those_of_the_work(tmp_path: Path) -> None:
    assert rest(tmp_path) == tmp_path / "samples.parquet"
    assert everything(tmp_path) == [".lock", "manifest.json", "samples.parquet"]
    rows = read_rows(tmp_path)
    assert rows.schema == pa.schema(
        {
            "sample": pa.int64(),
            "angle": pa.float64(),
            "count": pa.int64(),
            "mixed": pa.float64(),
            "late": pa.string(),
            "never": pa.null(),
            "bool": pa.bool_(),
            "values": pa.list_(pa.float64()),
            "gap": pa.float64(),
            "verdict": pa.string(),
        }
    )
    expected = [row(sample) | {"mixed": float(row(sample)["mixed"])} for sample in range(SAMPLES)]
    assert repr(rows.to_pylist()) == repr(expected)  # as text: NaN is not equal to itself


@pytest.mark.parametrize("chunk", [1, 7, 100])
def test_the_bytes_do_not_depend_on_the_chunks(tmp_path: Path, whole: bytes, chunk: int) -> None:
    assert run(tmp_path, 0, SAMPLES, text(), identity="cheap", chunk=chunk).read_bytes() == whole


def test_the_bytes_do_not_depend_on_the_pieces_across_row_groups(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("passiflex.chunks.stored_rows.GROUP", 6)
    one, other = (run(tmp_path / str(chunk), 0, SAMPLES, chunk=chunk).read_bytes() for chunk in (4, 13))
    assert one == other


def test_rows_can_be_read_before_the_end(tmp_path: Path) -> None:
    partly(tmp_path)
    before = read_rows(tmp_path)
    assert before["sample"].to_pylist() == list(range(20))
    rest(tmp_path)
    after = read_rows(tmp_path).slice(0, 20)
    assert repr(after.to_pylist()) == repr(before.to_pylist())


def test_a_campaign_goes_on_with_what_is_missing(tmp_path: Path, whole: bytes) -> None:
    log = tmp_path / "log"
    partly(tmp_path / "c", log=str(log))
    assert rest(tmp_path / "c", log=str(log)).read_bytes() == whole
    counts = evaluations(log)
    assert [counts[sample] for sample in range(SAMPLES)] == [1] * 20 + [2, 2] + [
        1
    ] * 8  # chunk 20 to 23 raised at 21


def test_a_complete_campaign_runs_nothing(tmp_path: Path, whole: bytes) -> None:
    rest(tmp_path / "c")
    assert rest(tmp_path / "c", log=str(tmp_path / "log")).read_bytes() == whole
    assert not (tmp_path / "log").exists()


@pytest.mark.parametrize("first", [18, 20])
@pytest.mark.parametrize("finished", [True, False])
def test_more_samples_extend_a_campaign(tmp_path: Path, whole: bytes, first: int, finished: bool) -> None:
    log, folder = tmp_path / "log", tmp_path / "c"
    rest(folder, first, log=str(log)) if finished else partly(folder, 24, log=str(log))
    path = run(folder, 0, SAMPLES, text(log=str(log)), identity="cheap", extends=True)
    assert path.read_bytes() == whole
    assert json.loads((folder / "manifest.json").read_text())["samples"] == SAMPLES
    assert all(evaluations(log)[sample] == 1 for sample in range(first))


def change(folder: Path, **values: Any) -> None:
    path = folder / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | values))


def test_fewer_samples_than_there_are_is_no_other_campaign(tmp_path: Path) -> None:
    with open_store(tmp_path, "a: 1\n", 8):
        pass
    with pytest.raises(FolderError) as error, open_store(tmp_path, "a: 1\n", 7):
        pass
    assert (
        str(error.value)
        == "the campaign in this folder has more samples; got 7; needs 8 or more; try --samples 8"
    )


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"campaign": "a: 1\nb: 3\n"}, "the campaign: 'b: 2' there, 'b: 3' asked for"),
        ({"samples": 9}, "the number of samples: 8 → 9, and this sampling cannot be extended"),
    ],
)
def test_another_campaign_is_refused(tmp_path: Path, asked: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"campaign": "a: 1\nb: 2\n", "samples": 8}
    with open_store(tmp_path, **arguments):
        pass
    before = (tmp_path / "manifest.json").read_bytes()
    with pytest.raises(FolderError) as error, open_store(tmp_path, **(arguments | asked)):
        pass
    assert str(error.value) == f"the folder holds rows of another campaign; got {message}; try another folder"
    assert (tmp_path / "manifest.json").read_bytes() == before


def test_rows_of_other_code_are_refused(tmp_path: Path) -> None:
    partly(tmp_path)
    change(tmp_path, source="0123", version="0.0.1", commit="abc")
    with pytest.raises(
        FolderError, match=r"source of the package: the rows are from version 0\.0\.1, commit abc"
    ):
        rest(tmp_path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ('{"format": "passiflex campaign 0"}', "is of another version; got 'passiflex campaign 0'"),
        ('{"format": "passiflex campaign 1"}', "is damaged"),
        ("", "is damaged"),
        ("[]", "is damaged"),
    ],
)
def test_a_manifest_that_is_not_ours_is_refused(tmp_path: Path, content: str, message: str) -> None:
    (tmp_path / "manifest.json").write_text(content)
    with pytest.raises(FolderError, match=message):
        rest(tmp_path)


def test_rows_without_a_manifest_are_refused(tmp_path: Path) -> None:
    partly(tmp_path)
    (tmp_path / "manifest.json").unlink()
    with pytest.raises(FolderError, match="rows of an unknown campaign"):
        rest(tmp_path)
    with pytest.raises(FolderError, match="holds no campaign"):
        read_rows(tmp_path)


def truncate(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 2)


def empty(path: Path) -> None:
    os.truncate(path, 0)


def turn_bits(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[60] ^= 0xFF
    path.write_bytes(content)


def replace(path: Path) -> None:
    shutil.copy(path.with_name(chunk_path(path, range(0, 4)).name), path)


@pytest.mark.parametrize("damage", [truncate, empty, turn_bits, replace])
def test_a_damaged_piece_is_run_again(tmp_path: Path, whole: bytes, damage: Any) -> None:
    log, folder = tmp_path / "log", tmp_path / "c"
    partly(folder)
    path = chunk_path(folder, range(8, 12))
    damage(path)
    with pytest.raises(DamagedError, match=r"000000008-000000012.parquet is damaged"):
        read_rows(folder)
    assert rest(folder, log=str(log)).read_bytes() == whole
    assert sorted(evaluations(log)) == [8, 9, 10, 11, *range(20, SAMPLES)]


@pytest.mark.parametrize("damage", [truncate, empty, turn_bits])
def test_a_damaged_file_of_all_rows_is_not_removed(tmp_path: Path, damage: Any) -> None:
    path = rest(tmp_path)
    damage(path)
    with pytest.raises(FolderError, match=r"samples.parquet is damaged.*try removing it"):
        rest(tmp_path)
    assert path.exists()
    path.unlink()
    rest(tmp_path)


HALF_WRITTEN: list[Any] = []
"""Blocks that are never left."""


def test_half_written_files_are_not_pieces_and_are_removed(tmp_path: Path, whole: bytes) -> None:
    partly(tmp_path)
    chunk = chunk_path(tmp_path, range(20, 24))
    runs = tmp_path / "runs"
    runs.mkdir()
    for path in (
        chunk,
        *(tmp_path / name for name in ("samples.parquet", "manifest.json", "statistics.json", "page.html")),
        runs / "sample_3.nc",
    ):
        writing = whole_file(path)
        writing.__enter__().write_bytes(b"PAR1")
        HALF_WRITTEN.append(writing)  # as if killed within the block
    (tmp_path / ".gitignore").write_text("*")
    assert read_rows(tmp_path).num_rows == 20
    assert rest(tmp_path).read_bytes() == whole
    assert everything(tmp_path) == [".gitignore", ".lock", "manifest.json", "runs", "samples.parquet"]


def test_pieces_left_beside_the_file_of_all_rows_do_not_count_twice(tmp_path: Path, whole: bytes) -> None:
    partly(tmp_path)
    shutil.copytree(tmp_path / "pieces", tmp_path / "copy")
    rest(tmp_path)
    (tmp_path / "copy").rename(tmp_path / "pieces")  # as if killed before they were removed
    assert read_rows(tmp_path).num_rows == SAMPLES
    assert rest(tmp_path).read_bytes() == whole
    assert not (tmp_path / "pieces").exists()


def test_a_piece_with_other_columns_stops_the_run(tmp_path: Path) -> None:
    with open_store(tmp_path, "", 8) as store:
        from passiflex.chunks.chunk import evaluate

        def two_kinds(_: str, samples: Any) -> list[dict[str, Any]]:
            return [{"sample": sample, "x": "text" if sample > 3 else 1} for sample in samples]

        first, second = (evaluate(two_kinds, "", range(at, at + 4)) for at in (0, 4))
        store.add(range(0, 4), first)  # type: ignore[arg-type]
        with pytest.raises(RowsError, match="column 'x'"):
            store.add(range(4, 8), second)  # type: ignore[arg-type]
        assert store.done == 4
        with pytest.raises(FolderError, match="not complete; got 4 of 8"):
            store.finish()


def test_a_folder_that_holds_no_campaign(tmp_path: Path) -> None:
    with pytest.raises(FolderError, match=r"holds no campaign; got no manifest.json"):
        read_rows(tmp_path / "nothing")
    with open_store(tmp_path, "", 8):
        assert read_rows(tmp_path).num_rows == 0


def test_a_campaign_has_samples(tmp_path: Path) -> None:
    with pytest.raises(ValueRangeError), open_store(tmp_path, "", 0):
        pass


def test_a_second_run_is_refused_until_the_first_one_is_gone(tmp_path: Path) -> None:
    with start(tmp_path, 0, 100, text(sleep=0.1)) as first:
        try:
            wait_for(lambda: any((tmp_path / "pieces").glob("0*.parquet")))
            with pytest.raises(FolderInUseError) as error:
                run(tmp_path, 0, 100, text(sleep=0.1))
            message = f"a campaign is running in {tmp_path}; got the lock of process {first.pid} on"
            assert str(error.value).startswith(message)
        finally:
            first.kill()
    with open_store(tmp_path, text(sleep=0.1), 100) as store:
        assert store.done >= CHUNK


def wait_for(condition: Any, seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_campaign_killed_again_and_again_completes(tmp_path: Path, seed: int) -> None:
    folder, log = tmp_path / "c", tmp_path / "log"
    words = ["-m", "chunks.killed_runs", str(folder), "60", text(sleep=0.01, log=str(log)), str(seed)]
    done = subprocess.run(
        [sys.executable, *words], env=ENVIRONMENT, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    kills = int(done.stdout)
    assert kills >= 3
    assert read_rows(folder)["sample"].to_pylist() == list(range(60))
    assert everything(folder) == [".lock", "manifest.json", "samples.parquet"]
    by_run: dict[int, list[int]] = {}
    for sample, process in logged(log):
        by_run.setdefault(process, []).append(sample)
    starts = [samples[0] for samples in by_run.values()]
    ends = [samples[-1] for samples in by_run.values()]
    assert ends[-1] == 59
    for end, following in zip(ends, starts[1:], strict=False):
        assert following % CHUNK == 0
        assert end - CHUNK < following <= end + 1  # only the unfinished chunk is run again


def test_a_folder_that_is_a_file(tmp_path: Path) -> None:
    (tmp_path / "c").write_text("")
    with pytest.raises(OutputError, match="cannot write into"):
        rest(tmp_path / "c")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_may_not_be_written(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(OutputError, match="cannot write into"):
        rest(tmp_path / "c")


NO_LARGE_FILES = """
import resource, signal, sys
from pathlib import Path
from chunks.cheap_campaign import run
from passiflex.files import OutputError
folder = Path(sys.argv[1])
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
try:
    run(folder, 0, int(sys.argv[3]), chunk=int(sys.argv[4]))
except OutputError as error:
    print(error)
"""


@pytest.mark.parametrize(
    ("limit", "samples", "chunk", "kept"),
    [(6_000, 1_000, 4, "1000 of 1000"), (3_000, 100, 100, "0 of 100")],
    ids=["file of all rows", "chunk"],
)
def test_a_file_that_cannot_be_written_keeps_the_others(
    tmp_path: Path, limit: int, samples: int, chunk: int, kept: str
) -> None:
    words = [sys.executable, "-c", NO_LARGE_FILES, str(tmp_path), str(limit), str(samples), str(chunk)]
    done = subprocess.run(words, env=ENVIRONMENT, capture_output=True, text=True, timeout=30)
    assert done.stderr == ""
    assert done.stdout.count("\n") == 1
    assert f"got File too large; {kept} samples are kept; try freeing disk space" in done.stdout
    assert not list(tmp_path.rglob(".*.parquet"))
    with open_store(tmp_path, "{}", samples) as store:
        assert f"{store.done} of {samples}" == kept


FULL_DISK = """
mount -t tmpfs -o size=600k tmpfs "$1" || exit 77
head -c 400000 /dev/zero > "$1/ballast"
"$2" -m chunks.cheap_campaign "$1/c" 0 300 '{}'
echo "status $?"
rm "$1/ballast"
"$2" -m chunks.cheap_campaign "$1/c" 0 300 '{}' && cp "$1/c/samples.parquet" "$3"
"""


@pytest.mark.skipif(
    os.geteuid() != 0 or not shutil.which("unshare"), reason="only root can mount a small disk"
)
def test_a_full_disk_keeps_the_finished_chunks(tmp_path: Path) -> None:
    disk, copy = tmp_path / "disk", tmp_path / "copy"
    disk.mkdir()
    words = ["unshare", "-m", "sh", "-c", FULL_DISK, "sh", str(disk), sys.executable, str(copy)]
    done = subprocess.run(words, env=ENVIRONMENT, capture_output=True, text=True, timeout=60)
    if done.returncode == 77:
        pytest.skip(f"no small disk can be mounted here: {done.stderr}")
    (line,) = done.stderr.splitlines()
    kept = int(line.partition("got No space left on device; ")[2].split()[0])
    assert 0 < kept < 300
    assert done.stdout.splitlines() == ["status 1", str(disk / "c" / "samples.parquet")]
    assert copy.read_bytes() == run(tmp_path / "direct", 0, 300).read_bytes()


def test_ctrl_c_keeps_the_finished_chunks(tmp_path: Path) -> None:
    with start(tmp_path, 0, 1000, text(sleep=0.01)) as process:
        wait_for(lambda: len(list((tmp_path / "pieces").glob("0*"))) > 2)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=10)
    assert (out, err) == ("", "passiflex: interrupted\n")
    with open_store(tmp_path, text(sleep=0.01), 1000) as store:
        assert store.done >= 2 * CHUNK
        assert store.damaged == []
