"""Every engine gives the same rows, and a worker that is killed costs its own chunk only."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from chunks.cheap_campaign import CHUNK, ENVIRONMENT, evaluations, logged, run, start, text, work
from passiflex.chunks.engines import InProcess, LocalProcesses, usable_cores
from passiflex.chunks.run_chunks import ChunkError, Progress, run_chunks
from passiflex.chunks.store import open_store
from passiflex.chunks.stored_rows import read_rows
from passiflex.chunks.worker import EngineError
from passiflex.errors import ValueRangeError

SAMPLES = 30


@pytest.fixture(scope="module")
def serial(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return the file of all rows of a run in this process."""
    return run(tmp_path_factory.mktemp("serial"), 0, SAMPLES).read_bytes()


@pytest.fixture(scope="module")
def engine() -> Iterator[LocalProcesses]:
    """Return an engine of one worker."""
    with LocalProcesses(1) as processes:
        yield processes


def run_with(executor: Executor, folder: Path, campaign: str = "{}", samples: int = SAMPLES) -> Path:
    with open_store(folder, campaign, samples, chunk=CHUNK, identity="cheap") as store:
        return run_chunks(store, work, executor)


def wait_for(condition: Callable[[], Any], seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)


def lives(process: int) -> bool:
    """Return whether a process runs; one that nobody has waited for does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_one_worker_gives_the_same_rows(tmp_path: Path, serial: bytes, engine: LocalProcesses) -> None:
    assert run_with(engine, tmp_path).read_bytes() == serial


def test_any_executor_gives_the_same_rows(tmp_path: Path, serial: bytes) -> None:
    with ThreadPoolExecutor(3) as executor:
        assert run_with(executor, tmp_path).read_bytes() == serial


def test_a_killed_worker_costs_its_own_piece_only(tmp_path: Path, serial: bytes) -> None:
    log = tmp_path / "log"
    campaign = text(log=str(log), deadly_once=6, sleep=0.01)
    with LocalProcesses(2) as engine:
        assert run_with(engine, tmp_path / "c", campaign).read_bytes() == serial
    counts = evaluations(log)
    assert [counts[sample] for sample in range(SAMPLES)] == [1] * 4 + [2] * 3 + [1] * 23
    by_process: dict[int, list[int]] = {}
    for sample, process in logged(log):
        by_process.setdefault(process, []).append(sample)
    assert len(by_process) == 3
    assert [samples[-1] for samples in by_process.values()].count(6) == 1


def test_a_piece_that_kills_every_worker_stops_the_campaign(tmp_path: Path, engine: LocalProcesses) -> None:
    log = tmp_path / "log"
    with pytest.raises(ChunkError) as error:
        run_with(engine, tmp_path / "c", text(deadly=5, log=str(log)))
    assert str(error.value) == (
        "samples 4 to 7 cannot be evaluated; got 3 worker processes ended in the middle of it; got SIGKILL"
    )
    assert evaluations(log)[5] == 3
    assert set(range(4)) <= set(read_rows(tmp_path / "c")["sample"].to_pylist())


@pytest.mark.parametrize("processes", [True, False])
def test_work_that_raises_names_the_samples(tmp_path: Path, engine: LocalProcesses, processes: bool) -> None:
    with pytest.raises(ChunkError) as error:
        run_with(engine if processes else InProcess(), tmp_path, text(wrong=5))
    assert str(error.value) == "samples 4 to 7 cannot be evaluated; got ValueError: sample 5 is wrong"
    assert "cheap_campaign.py" in error.value.__notes__[0]
    assert read_rows(tmp_path)["sample"].to_pylist()[:4] == [0, 1, 2, 3]


def test_a_worker_does_not_hear_of_ctrl_c(engine: LocalProcesses) -> None:
    worker = engine.submit(os.getpid).result()
    os.kill(worker, signal.SIGINT)
    assert engine.submit(os.getpid).result() == worker


def test_a_worker_has_one_thread(engine: LocalProcesses) -> None:
    before = os.environ.get("OMP_NUM_THREADS")
    assert engine.submit(os.getenv, "OMP_NUM_THREADS").result() == "1"
    assert os.environ.get("OMP_NUM_THREADS") == before


@pytest.mark.parametrize(
    ("function", "argument", "message"),
    [(int, "x", "ValueError: invalid literal"), (memoryview, b"x", "TypeError: cannot pickle")],
)
def test_a_call_that_fails_does_not_end_the_worker(
    engine: LocalProcesses, function: Any, argument: Any, message: str
) -> None:
    before = engine.submit(os.getpid).result()
    with pytest.raises(EngineError, match=message):
        engine.submit(function, argument).result()
    assert engine.submit(os.getpid).result() == before


def test_a_function_that_cannot_be_pickled_does_not_end_the_worker(engine: LocalProcesses) -> None:
    with pytest.raises(AttributeError):
        engine.submit(lambda: 1).result()
    assert engine.submit(abs, -1).result() == 1


def test_there_are_as_many_workers_as_usable_cores() -> None:
    assert usable_cores() == len(os.sched_getaffinity(0))
    with LocalProcesses() as engine:
        assert engine.in_flight == 2 * usable_cores()
    with pytest.raises(ValueRangeError, match=r"number of worker processes; got 0; needs ≥ 1"):
        LocalProcesses(0)
    with pytest.raises(RuntimeError):
        engine.submit(abs, 1)


def fail_at_once(engine: LocalProcesses) -> None:
    with engine:
        future = engine.submit(time.sleep, 3600)
        engine.submit(time.sleep, 3600)
        wait_for(future.running)
        raise KeyboardInterrupt


def test_a_block_that_raises_does_not_wait_for_its_calls() -> None:
    engine = LocalProcesses(1)
    with pytest.raises(KeyboardInterrupt):
        fail_at_once(engine)


class Counting(Executor):
    """Keeps count of the calls that are submitted and not done."""

    def __init__(self, pool: ThreadPoolExecutor):
        self.pool, self.now, self.most = pool, 0, 0

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.now += 1
        self.most = max(self.most, self.now)
        future = self.pool.submit(fn, *args, **kwargs)
        future.add_done_callback(self.count_down)
        return future

    def count_down(self, _: Future[Any]) -> None:
        self.now -= 1


def test_only_a_few_pieces_are_in_flight(tmp_path: Path) -> None:
    with ThreadPoolExecutor(2) as pool:
        executor = Counting(pool)
        run_with(executor, tmp_path, samples=100)
    assert 2 <= executor.most <= 2 * usable_cores()


class Elsewhere(Executor):
    """Gives rows as if other source had computed them."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs)._replace(source="0123"))
        return future


def test_rows_of_other_source_are_refused(tmp_path: Path) -> None:
    with pytest.raises(EngineError, match=r"samples \d+ to \d+ were evaluated by other source.* got 0123"):
        run_with(Elsewhere(), tmp_path)
    assert read_rows(tmp_path).num_rows == 0


def test_progress_counts_what_was_there_before(tmp_path: Path) -> None:
    with pytest.raises(ChunkError):
        run_with(InProcess(), tmp_path, text(wrong=20))
    seen: list[Progress] = []
    with open_store(tmp_path, text(sleep=0.002), SAMPLES, chunk=CHUNK, identity="cheap") as store:
        run_chunks(store, work, InProcess(), seen.append)
    assert [progress.done for progress in seen] == [24, 28, 30]
    assert all(progress.total == SAMPLES for progress in seen)
    assert seen[0].verdicts == {"holds": 16, "fails": 8}
    assert seen[-1].verdicts == {"holds": 20, "fails": 10}
    assert 0 < seen[0].rate < 1 / 0.002
    assert seen[0].remaining == pytest.approx(6 / seen[0].rate)
    assert seen[-1].remaining == 0


def two_workers_at_work(folder: Path, log: Path) -> tuple[subprocess.Popen[str], set[int]]:
    """Return a process that runs a campaign, and its workers."""
    process = start(folder, 2, 10_000, text(sleep=0.02, log=str(log)))
    wait_for(
        lambda: len({worker for _, worker in logged(log)}) == 2 and len(list(folder.glob("pieces/0*"))) > 3
    )
    return process, {worker for _, worker in logged(log)}


def test_no_worker_outlives_a_killed_parent(tmp_path: Path) -> None:
    log = tmp_path / "log"
    process, workers = two_workers_at_work(tmp_path / "c", log)
    assert all(map(lives, workers))
    with process:
        process.kill()
    wait_for(lambda: not any(map(lives, workers)), seconds=2)
    count = len(logged(log))
    with open_store(tmp_path / "c", text(sleep=0.02, log=str(log)), 10_000) as store:
        assert store.done >= 3 * CHUNK
        assert store.damaged == []
        assert store.done <= count <= store.done + 4 * CHUNK
    assert len(logged(log)) == count


def test_ctrl_c_in_a_terminal_is_one_line(tmp_path: Path) -> None:
    process, workers = two_workers_at_work(tmp_path / "c", tmp_path / "log")
    with process:
        os.killpg(process.pid, signal.SIGINT)  # a terminal sends it to all
        out, err = process.communicate(timeout=10)
    assert (out, err) == ("", "passiflex: interrupted\n")
    assert process.returncode == 1
    wait_for(lambda: not any(map(lives, workers)), seconds=2)
    assert read_rows(tmp_path / "c").num_rows >= 3 * CHUNK


UNGUARDED = """
from passiflex.chunks.engines import LocalProcesses
from passiflex.errors import PassiflexError
with LocalProcesses(1) as engine:
    try:
        engine.submit(abs, -1).result()
    except PassiflexError as error:
        print(error)
"""


def test_a_script_without_a_guard_is_told_so(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(UNGUARDED)
    done = subprocess.run(
        [sys.executable, script], env=ENVIRONMENT, capture_output=True, text=True, timeout=30
    )
    assert done.stdout == (
        "a worker process does not start; got exit status 1; "
        "try calling this below `if __name__ == '__main__':`, or no workers\n"
    )
