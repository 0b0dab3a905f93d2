"""A process that calls functions for its parent, one after the other, and does not outlive it."""

from __future__ import annotations

import ctypes
import multiprocessing as mp
import os
import pickle
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any, final

from passiflex.errors import PassiflexError

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_SPAWN = mp.get_context("spawn")  # a forked process would inherit locks that threads of the parent held
_STARTING = threading.Lock()
_PR_SET_PDEATHSIG = 1


class EngineError(PassiflexError):
    """Work cannot be done where it was to be done."""


class WorkerLostError(EngineError):
    """A worker ended in the middle of a call."""


@final
class Worker:
    """The parent's end of a worker. The thread that makes it must live as long as it is used."""

    def __init__(self) -> None:
        self._pipe, theirs = _SPAWN.Pipe()
        self._process = _SPAWN.Process(target=_serve, args=(theirs,), daemon=True)
        with _STARTING, _environment(ONE_THREAD), _without_interrupts():
            self._process.start()
        theirs.close()  # the worker's is now the only one: its end is the end of the pipe
        self._ready = False

    def call(self, function: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        """Return what the function returns in the worker.

        Raises
        ------
        WorkerLostError
            If the worker ends before it answers: killed, out of memory, or crashed.
        EngineError
            If the worker does not start, or the function raises; its exception comes as text.
        """
        try:
            if not self._ready:
                self._ready = self._pipe.recv()
            self._pipe.send((function, args, kwargs))
            done, answer = self._pipe.recv()
        except (EOFError, ConnectionError):
            self._process.join()
            code = self._process.exitcode or 0
            if not self._ready and code > 0:
                raise EngineError(
                    "a worker process does not start",
                    got=f"exit status {code}",
                    try_="calling this below `if __name__ == '__main__':`, or no workers",
                ) from None
            ended = signal.Signals(-code).name if code < 0 else f"exit status {code}"
            raise WorkerLostError("a worker process ended in the middle of a call", got=ended) from None
        if done:
            return answer
        error = EngineError(answer[0])
        error.add_note(answer[1])
        raise error

    def kill(self) -> None:
        """End the process at once; any thread may."""
        self._process.kill()

    def close(self) -> None:
        """Let the process end, which is between two calls, and wait for it."""
        self._pipe.close()
        self._process.join(5)
        self._process.kill()
        self._process.join()


def _serve(pipe: Connection) -> None:
    """Answer calls until the parent closes the pipe or ends."""
    _end_with_parent()
    pipe.send(True)
    while True:
        try:
            call = pipe.recv_bytes()
        except EOFError:
            return
        try:
            function, args, kwargs = pickle.loads(call)
            answer = pickle.dumps((True, function(*args, **kwargs)))
        except Exception as error:
            answer = pickle.dumps((False, (f"{type(error).__name__}: {error}", traceback.format_exc())))
        pipe.send_bytes(answer)


def _end_with_parent() -> None:
    """Make the parent's end, also by SIGKILL, the end of this process.

    On Linux the kernel does it; elsewhere a thread, which native code that holds the interpreter delays.
    """
    parent = mp.parent_process()
    assert parent is not None

    def watch() -> None:
        wait([parent.sentinel])
        os._exit(1)

    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    threading.Thread(target=watch, daemon=True).start()  # sees it also if the parent ended before prctl


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Keep Ctrl-C, which reaches every process of the terminal, from a process that is started meanwhile.

    It inherits for good what this thread has blocked for now.
    """
    resource_tracker.ensure_running()  # before: starting it unblocks interrupts
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """Set environment variables for a process that is started meanwhile."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
