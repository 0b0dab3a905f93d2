"""A scheduler with two workers on this machine gives the rows of a serial run, whoever is killed."""

from __future__ import annotations

import re
import shutil
import socket
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest

from chunks.cheap_campaign import CHUNK, ENVIRONMENT, evaluations, logged, run, text, work
from chunks.dask_processes import free_port, scheduler, wait_for_workers, worker
from passiflex.chunks.cluster import Cluster
from passiflex.chunks.run_chunks import run_chunks
from passiflex.chunks.source import PACKAGE
from passiflex.chunks.store import open_store
from passiflex.chunks.worker import EngineError

SAMPLES = 40

distributed = pytest.importorskip("distributed")


def test_a_killed_worker_costs_its_own_piece_only(tmp_path: Path) -> None:
    log, lone = tmp_path / "log", tmp_path / "lone"
    campaign = text(sleep=0.02, log=str(log))
    with ExitStack() as stack:
        address, _ = stack.enter_context(scheduler())
        workers = [stack.enter_context(worker(address)) for _ in range(2)]
        wait_for_workers(address, 2)
        with open_store(tmp_path / "c", campaign, SAMPLES, chunk=CHUNK) as store, Cluster(address) as engine:
            assert engine.in_flight == 4
            killed = []

            def kill_one(_: object) -> None:
                if store.done >= 3 * CHUNK and not killed:
                    killed.append({process for _, process in logged(log)})
                    workers[0].kill()

            path = run_chunks(store, work, engine, kill_one)
        assert killed == [{process.pid for process in workers}]
    assert path.read_bytes() == run(lone, 0, SAMPLES).read_bytes()
    counts = evaluations(log)
    assert set(counts) == set(range(SAMPLES))
    assert max(counts.values()) <= 2
    assert sum(counts.values()) <= SAMPLES + 2 * CHUNK


def test_a_scheduler_that_is_not_there_is_one_line() -> None:
    script = f"""
import distributed
from passiflex.chunks.cluster import Cluster
from passiflex.errors import PassiflexError
try:
    Cluster("tcp://127.0.0.1:{free_port()}")
except PassiflexError as error:
    print(error)
"""
    done = subprocess.run(
        [sys.executable, "-c", script], env=ENVIRONMENT, capture_output=True, text=True, timeout=300
    )
    assert done.stderr == ""
    (line,) = done.stdout.splitlines()
    assert line.startswith("no scheduler answers at tcp://127.0.0.1:")


ASKING = """
import sys
from passiflex.chunks.cluster import Cluster
from passiflex.errors import PassiflexError
try:
    Cluster(sys.argv[1])
except PassiflexError as error:
    print(error)
"""


@pytest.mark.parametrize(
    "answer",
    [b"", b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n", b"\0" * 64],
    ids=["silence", "web", "zeros"],
)
@pytest.mark.parametrize("closes", [True, False])
def test_a_server_that_is_no_scheduler_is_one_line(answer: bytes, closes: bool) -> None:
    accepted = []  # held, or they would be closed

    def serve() -> None:
        with suppress(OSError):  # the listener is closed
            while True:
                connection, _ = listener.accept()
                connection.sendall(answer)
                connection.close() if closes else accepted.append(connection)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        threading.Thread(target=serve, daemon=True).start()
        address = f"tcp://127.0.0.1:{listener.getsockname()[1]}"
        words = [sys.executable, "-c", ASKING, address]
        done = subprocess.run(words, env=ENVIRONMENT, capture_output=True, text=True, timeout=300)
        listener.shutdown(socket.SHUT_RDWR)
    for connection in accepted:
        connection.close()
    assert done.stderr == ""
    assert re.fullmatch(rf"no scheduler answers at {address}; got .+; try `dask scheduler`.*\n", done.stdout)


def test_a_worker_is_no_scheduler() -> None:
    with scheduler() as (address, _), worker(address):
        wait_for_workers(address, 1)
        with distributed.Client(address, timeout=20, set_as_default=False) as client:
            (other,) = client.nthreads()
        assert refused(other).startswith(f"no scheduler answers at {other}; got a part of dask that is no")


@pytest.mark.parametrize("address", ["", "nonsense", "nonsense://127.0.0.1:1", "tcp://127.0.0.1"])
def test_an_address_that_is_none_is_refused(address: str) -> None:
    with pytest.raises(EngineError, match=r"no address of a scheduler; got .*; needs one as tcp://host:8786"):
        Cluster(address)


def test_workers_that_are_not_fit_are_refused(tmp_path: Path) -> None:
    changed, older = tmp_path / "changed", tmp_path / "older"
    shutil.copytree(PACKAGE, changed / "passiflex", ignore=shutil.ignore_patterns("__pycache__"))
    with (changed / "passiflex" / "layout.py").open("a") as file:
        file.write("\n")
    (older / "passiflex").mkdir(parents=True)
    (older / "passiflex" / "__init__.py").touch()
    with scheduler() as (address, _):
        with worker(address, first=changed):
            wait_for_workers(address, 1)
            refusal = refused(address)
        wait_for_workers(address, 0)
        assert re.fullmatch(
            r"the worker at tcp://[\d.:]+ has another passiflex; got \w{16}; needs source \w{16}, as here",
            refusal,
        )
        with worker(address, first=older):
            wait_for_workers(address, 1)
            refusal = refused(address)
        wait_for_workers(address, 0)
        assert "has another passiflex; got ModuleNotFoundError(" in refusal
        with worker(address, threads=2):
            wait_for_workers(address, 1)
            refusal = refused(address)
        wait_for_workers(address, 0)
        assert "shares its interpreter; got 2 threads; try `dask worker" in refusal
        assert refused(address).startswith(f"the scheduler at {address} has no workers; try `dask worker")


def refused(address: str) -> str:
    """Return why a cluster is refused."""
    with pytest.raises(EngineError) as error:
        Cluster(address)
    return str(error.value)


LOSING = """
import sys
from pathlib import Path
from chunks.cheap_campaign import CHUNK, work
from passiflex.chunks.cluster import PATIENCE, Cluster
from passiflex.chunks.run_chunks import run_chunks
from passiflex.chunks.store import open_store
from passiflex.errors import PassiflexError
folder, address, campaign = sys.argv[1:]
try:
    with open_store(folder, campaign, 1000, chunk=CHUNK) as store, Cluster(address) as engine:
        run_chunks(store, work, engine)
except PassiflexError as error:
    print(error)
"""


def test_a_scheduler_that_is_lost_is_one_line_and_keeps_the_chunks(tmp_path: Path) -> None:
    campaign = text(sleep=0.02)
    with scheduler() as (address, process), worker(address):
        wait_for_workers(address, 1)
        words = [sys.executable, "-c", LOSING, str(tmp_path), address, campaign]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        with subprocess.Popen(words, env=ENVIRONMENT, text=True, **pipes) as run:
            try:
                while len(list(tmp_path.glob("pieces/0*"))) < 3:
                    assert run.poll() is None
                    time.sleep(0.02)
                process.kill()
                out, err = run.communicate(timeout=20)
            finally:
                run.kill()
    assert err == ""
    by_a_chunk = r"samples \d+ to \d+ cannot be evaluated; got the scheduler gave up .*\n"
    assert re.fullmatch(rf"{by_a_chunk}|the scheduler is lost; got .*\n", out)  # whoever notices first
    with open_store(tmp_path, campaign, 1000) as store:
        assert store.done >= 3 * CHUNK


def test_without_dask_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)  # as if it were not installed
    with pytest.raises(EngineError, match=r"needs dask.distributed; .* try pip install 'passiflex\[dask\]'"):
        Cluster("tcp://127.0.0.1:8786")
