"""Where chunks are computed: in this process, or in local processes of which any may be killed."""

from __future__ import annotations

import os
import queue
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Executor, Future
from types import TracebackType
from typing import Any, NamedTuple, ParamSpec, TypeVar, final

from passiflex.chunks.worker import Worker, WorkerLostError
from passiflex.errors import ValueRangeError

P = ParamSpec("P")
T = TypeVar("T")

TRIES = 3
"""How many workers a call may cost."""


class Engine(Executor, ABC):
    """An executor that says how many calls keep it busy."""

    @property
    @abstractmethod
    def in_flight(self) -> int:
        """Return how many calls to have submitted at a time."""


def usable_cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@final
class InProcess(Engine):
    """Runs each call when it is submitted, here: to debug, and to compare with."""

    @property
    def in_flight(self) -> int:
        """Return 1."""
        return 1

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Call the function and return its result."""
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class _Call(NamedTuple):
    future: Future[Any]
    function: Callable[..., Any]
    args: tuple[Any, ...]
    kwargs: dict[str, Any]


@final
class LocalProcesses(Engine):
    """Runs calls in processes of this machine, each of one thread.

    A worker that is killed costs its own call only, which a fresh worker repeats; a call that has cost
    `TRIES` workers raises WorkerLostError. A `with` block that raises ends the workers at once.

    Parameters
    ----------
    workers: How many; as many as there are usable cores if None.
    """

    def __init__(self, workers: int | None = None):
        self._workers = usable_cores() if workers is None else workers
        if self._workers < 1:
            raise ValueRangeError(
                "number of worker processes", got=workers, needs="≥ 1, or 0 for this process"
            )
        self._calls: queue.SimpleQueue[_Call | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._closed = self._killed = False
        self._alive: set[Worker] = set()
        self._threads: list[threading.Thread] = []

    @property
    def in_flight(self) -> int:
        """Return two per worker: one at work, one waiting."""
        return 2 * self._workers

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Queue a call; function, arguments and result must be picklable."""
        with self._lock:
            if self._closed:
                raise RuntimeError("cannot schedule new futures after shutdown")
            if len(self._threads) < self._workers:
                self._threads.append(threading.Thread(target=self._keep_a_worker_busy, daemon=True))
                self._threads[-1].start()
        future: Future[T] = Future()
        self._calls.put(_Call(future, fn, args, kwargs))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the workers once the queued calls, or with `cancel_futures` the running ones, are done."""
        with self._lock:
            self._closed = True
        if cancel_futures:
            self._cancel_queued()
        for _ in self._threads:
            self._calls.put(None)
        if wait:
            for thread in self._threads:
                thread.join()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None:
            with self._lock:
                self._closed = self._killed = True
                for worker in self._alive:
                    worker.kill()
        self.shutdown(cancel_futures=error is not None)

    def _cancel_queued(self) -> None:
        while True:
            try:
                call = self._calls.get_nowait()
            except queue.Empty:
                return
            if call is not None:
                call.future.cancel()

    def _keep_a_worker_busy(self) -> None:
        worker = None
        while (call := self._calls.get()) is not None:
            if call.future.set_running_or_notify_cancel():
                worker = self._run(call, worker)
        if worker is not None:
            worker.close()

    def _run(self, call: _Call, worker: Worker | None) -> Worker | None:
        """Fulfil a call, and return the worker that lives on."""
        for left in reversed(range(TRIES)):
            try:
                worker = worker or self._start()
                call.future.set_result(worker.call(call.function, *call.args, **call.kwargs))
                break
            except WorkerLostError as error:
                with self._lock:
                    self._alive.discard(worker)
                worker = None
                if self._killed:
                    call.future.set_exception(error)
                    break
                if left == 0:
                    call.future.set_exception(
                        WorkerLostError(f"{TRIES} worker processes ended in the middle of it", got=error.got)
                    )
            except Exception as error:
                call.future.set_exception(error)
                break
        return worker

    def _start(self) -> Worker:
        worker = Worker()
        with self._lock:
            self._alive.add(worker)
            if self._killed:
                worker.kill()
        return worker
