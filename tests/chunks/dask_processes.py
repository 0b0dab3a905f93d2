"""A scheduler of dask and its workers, as processes of this machine that end with their block."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from chunks.cheap_campaign import ENVIRONMENT, TESTS


def free_port() -> int:
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        return int(sock.getsockname()[1])


@contextmanager
def dask(*words: str, first: Path = TESTS) -> Iterator[subprocess.Popen[bytes]]:
    """Give a process of dask that looks for modules there first; it has ended when the block ends."""
    command = [sys.executable, "-m", *words, "--no-dashboard"]
    path = {"PYTHONPATH": os.pathsep.join([str(first), ENVIRONMENT["PYTHONPATH"]])}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, env=ENVIRONMENT | path, **quiet) as process:
        try:
            yield process
        finally:
            process.kill()


@contextmanager
def scheduler() -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Give the address of a scheduler that answers, and its process."""
    port = free_port()
    with dask("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port)) as process:
        end = time.monotonic() + 20
        while True:
            try:
                socket.create_connection(("127.0.0.1", port)).close()
                break
            except ConnectionRefusedError:
                assert time.monotonic() < end
                time.sleep(0.02)
        yield f"tcp://127.0.0.1:{port}", process


def worker(address: str, threads: int = 1, **options: Path):
    words = ["--host", "127.0.0.1", "--nthreads", str(threads), "--no-nanny"]
    return dask("distributed.cli.dask_worker", address, *words, **options)


def wait_for_workers(address: str, count: int) -> None:
    """Wait until the scheduler knows of so many; they take seconds to start on a busy machine."""
    import distributed

    with distributed.Client(address, timeout=20, set_as_default=False) as client:
        end = time.monotonic() + 30
        while len(client.nthreads()) != count:
            assert time.monotonic() < end
            time.sleep(0.02)
