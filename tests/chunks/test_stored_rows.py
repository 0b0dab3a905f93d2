"""Rows are read by column and by block, and written in little memory, however wide they are."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from chunks.cheap_campaign import ENVIRONMENT, run, text
from passiflex.chunks import stored_rows
from passiflex.chunks.engines import InProcess
from passiflex.chunks.run_chunks import ChunkError, run_chunks
from passiflex.chunks.store import open_store
from passiflex.chunks.stored_rows import ALL, DamagedError, read_blocks, read_rows
from passiflex.errors import NameUnknownError

SAMPLES = 30


@pytest.fixture(params=["partly", "finished"])
def folder(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return a folder with the chunks of 20 samples of 30, or with the file of all of them."""
    if request.param == "finished":
        run(tmp_path, 0, 20)
    else:
        with pytest.raises(ChunkError):
            run(tmp_path, 0, SAMPLES, text(wrong=21))
    assert (tmp_path / ALL).exists() == (request.param == "finished")
    return tmp_path


@pytest.mark.parametrize("columns", [["values"], ["verdict", "angle"], ["angle", "sample"], ["never"]])
def test_some_columns_are_those_of_all(folder: Path, columns: list[str]) -> None:
    some, everything = read_rows(folder, columns), read_rows(folder)
    assert some.column_names == columns
    assert repr(some.to_pylist()) == repr(everything.select(columns).to_pylist())
    assert some.schema == everything.select(columns).schema


def test_other_columns_are_not_read(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[list[str]] = []
    whole = pq.ParquetFile.read_row_group

    def spied(self: pq.ParquetFile, *args: Any) -> pa.Table:
        read.append((table := whole(self, *args)).column_names)
        return table

    monkeypatch.setattr(pq.ParquetFile, "read_row_group", spied)
    read_rows(folder, ["angle"])
    assert read
    assert all(sorted(names) == ["angle", "sample"] for names in read)


@pytest.mark.parametrize("reader", [read_rows, lambda *given: list(read_blocks(*given))])
def test_an_unknown_column_is_refused_with_the_nearest(folder: Path, reader: Any) -> None:
    with pytest.raises(NameUnknownError, match=r"unknown column; got 'angel'; .* try 'angle'"):
        reader(folder, ["sample", "angel"])


def test_before_the_first_piece_there_are_no_rows_of_any_column(tmp_path: Path) -> None:
    with open_store(tmp_path, "", 8):
        assert read_rows(tmp_path, ["angle", "sample"]).to_pydict() == {"angle": [], "sample": []}
        assert list(read_blocks(tmp_path)) == []


@pytest.mark.parametrize("columns", [None, ["values", "count"]])
def test_blocks_are_the_rows(folder: Path, columns: list[str] | None) -> None:
    blocks = list(read_blocks(folder, columns))
    assert len(blocks) == (1 if (folder / ALL).exists() else 5)
    assert repr(pa.concat_tables(blocks).to_pylist()) == repr(read_rows(folder, columns).to_pylist())


@pytest.mark.parametrize("seen", [1, 4, 5])
def test_blocks_go_on_when_the_campaign_completes_meanwhile(tmp_path: Path, seen: int) -> None:
    with pytest.raises(ChunkError):
        run(tmp_path, 0, SAMPLES, text(wrong=21), identity="cheap")
    blocks = read_blocks(tmp_path, ["sample", "angle"])
    given = [next(blocks) for _ in range(seen)]
    run(tmp_path, 0, SAMPLES, identity="cheap")
    given.extend(blocks)
    samples = [sample for block in given for sample in block["sample"].to_pylist()]
    assert samples == list(range(20 if seen == 5 else SAMPLES))  # all that there was had been given


def test_a_damaged_block_is_refused(folder: Path) -> None:
    path = next(iter(sorted((folder / "pieces").glob("0*")) or [folder / ALL]))
    content = bytearray(path.read_bytes())
    content[60] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(DamagedError):
        list(read_blocks(folder))


def uneven(_: str, samples: Sequence[int]) -> list[dict[str, Any]]:
    """Return rows whose widths differ: none of the first, as of a refused sample, to 400 numbers."""
    lengths = [None if i < 3 else (37 * i) % 400 for i in samples]
    return [
        {"sample": i, "path": None if n is None else np.arange(n) / 7, "word": "x" * (i % 50)}
        for i, n in zip(samples, lengths, strict=True)
    ]


def written(folder: Path, samples: int, chunk: int, first: int | None = None) -> Path:
    """Return the file of all rows, written at once, or when there is one of the first samples."""
    for count in [samples] if first is None else [first, samples]:
        with open_store(folder, "", count, chunk=chunk, extends=True) as store, InProcess() as engine:
            path = run_chunks(store, uneven, engine)
    return path


def test_groups_end_where_the_widths_of_rows_say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stored_rows, "GROUP_BYTES", 20_000)
    monkeypatch.setattr(stored_rows, "GROUP", 15)
    files = [
        written(tmp_path / f"{chunk} {first}", 200, chunk, first)
        for chunk, first in ((1, None), (7, None), (64, None), (200, None), (9, 101), (5, 4))
    ]
    assert len({path.read_bytes() for path in files}) == 1
    sizes, width, count = [], 0, 0
    for line in uneven("", range(200)):
        width += 24 + 8 * (0 if line["path"] is None else len(line["path"])) + len(line["word"])
        count += 1
        if width >= 20_000 or count == 15:
            sizes.append(count)
            width = count = 0
    parquet = pq.ParquetFile(files[0]).metadata
    found = [parquet.row_group(i).num_rows for i in range(parquet.num_row_groups)]
    assert found == [*sizes, *([count] if count else [])]
    assert {15} < set(found[:-1])  # some end by their number of rows, and some by their bytes


WIDE = """
import json, resource, sys
from collections import Counter
from pathlib import Path
import numpy as np
import pyarrow as pa
from passiflex.chunks import stored_rows
from passiflex.chunks.chunk import Rows
from passiflex.chunks.store import open_store
from passiflex.chunks.stored_rows import read_blocks
from passiflex.chunks.tables import encoded

CHUNK, WIDTH = 100, 3000

def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

folder, samples, stored_rows.GROUP_BYTES = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
offsets = np.arange(CHUNK + 1, dtype=np.int32) * WIDTH
lists = pa.ListArray.from_arrays(offsets, np.arange(CHUNK * WIDTH) % WIDTH / 7)
with open_store(folder, "", samples, chunk=CHUNK) as store:
    for chunk in store.missing():
        table = pa.table({"sample": np.array(chunk), "x": lists, "y": lists, "z": lists})
        store.add(chunk, Rows(encoded(table), table.schema, Counter(), ""))
    before = peak()
    store.finish()
rows = sum(block.num_rows for block in read_blocks(folder))
print(json.dumps([rows, peak() - before]))
"""


def growth(folder: Path, group_bytes: int) -> float:
    """Return by how much the peak memory grows when 5000 rows of 72 kB, 343 in all, are made one file [MiB]."""
    words = [sys.executable, "-c", WIDE, str(folder), "5000", str(group_bytes)]
    done = subprocess.run(words, env=ENVIRONMENT, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    rows, grown = json.loads(done.stdout)
    assert rows == 5000
    return float(grown)


def test_wide_rows_are_written_and_read_in_little_memory(tmp_path: Path) -> None:
    assert growth(tmp_path / "as it is", stored_rows.GROUP_BYTES) < 200
    assert growth(tmp_path / "by numbers of rows alone", 2**40) > 300
