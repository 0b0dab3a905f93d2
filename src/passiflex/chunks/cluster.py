"""Chunks computed by the workers of a `dask.distributed` scheduler, on any number of machines."""

from __future__ import annotations

import asyncio
import logging
import re
import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from types import TracebackType
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar, final

from passiflex.chunks.engines import Engine
from passiflex.chunks.source import source_digest
from passiflex.chunks.worker import EngineError

if TYPE_CHECKING:
    import distributed

P = ParamSpec("P")
T = TypeVar("T")

PATIENCE = 3.0
"""Time for the scheduler to answer, for a first worker, and to find a lost scheduler again [s]."""


@final
class Cluster(Engine):
    """Runs calls on the workers of a scheduler; they need the same passiflex, but no folder in common.

    The scheduler repeats the calls of workers that are lost, and hands calls to workers that join later.

    Parameters
    ----------
    address: Of the scheduler, as in tcp://host:8786.

    Raises
    ------
    EngineError
        If dask.distributed is not installed, the scheduler does not answer, or its workers are not fit.
    """

    def __init__(self, address: str):
        try:
            import distributed
        except ImportError as error:
            raise EngineError(
                "a scheduler needs dask.distributed",
                got="none installed",
                try_="pip install 'passiflex[dask]'",
            ) from error
        scheme = re.fullmatch(r"(\w+)://.+:\d+", address)
        if scheme is None or scheme[1] not in distributed.comm.registry.backends:
            raise EngineError("no address of a scheduler", got=repr(address), needs="one as tcp://host:8786")
        for name in (
            "distributed",
            "distributed.client",
        ):  # each has a level; what they say comes as our errors
            logging.getLogger(name).setLevel(logging.CRITICAL)
        _require_scheduler(address)
        try:
            self._client: Any = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
        except Exception as error:  # lost since, or of another version: dask has many
            raise _silent(address, error) from error
        try:
            self._require_fit_workers(address)
        except BaseException:
            self._client.close()
            raise

    @property
    def in_flight(self) -> int:
        """Return two per thread of the workers that are there now.

        Raises
        ------
        EngineError
            If the scheduler is lost.
        """
        try:
            threads = sum(self._client.nthreads().values())
        except (OSError, TimeoutError) as error:
            raise EngineError("the scheduler is lost", got=str(error) or type(error).__name__) from error
        return 2 * max(1, threads)

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Hand a call to the scheduler."""
        theirs = self._client.submit(fn, *args, pure=False, **kwargs)
        ours: Future[T] = Future()

        def settle(done: distributed.Future) -> None:
            if not ours.set_running_or_notify_cancel():
                return
            if done.status == "finished":
                ours.set_result(done.result())
            elif done.status == "error":
                ours.set_exception(EngineError("a worker of the cluster failed", got=done.exception()))
            else:
                ours.set_exception(EngineError("the scheduler gave up a call", got=done.status))

        def cancel(done: Future[T]) -> None:
            if done.cancelled():
                with suppress(Exception):  # a scheduler that is gone has nothing to cancel
                    theirs.cancel()

        theirs.add_done_callback(settle)
        ours.add_done_callback(cancel)
        return ours

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave the scheduler, which then drops the calls that are not done."""
        self._client.close()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.shutdown()

    def _require_fit_workers(self, address: str) -> None:
        try:
            self._client.wait_for_workers(1, timeout=PATIENCE)
            sources = self._client.run(source_digest, on_error="return")
        except (OSError, TimeoutError) as error:
            raise EngineError(
                f"the scheduler at {address} has no workers", try_=f"`dask worker {address} --nthreads 1`"
            ) from error
        for worker, source in sources.items():
            if source != source_digest():
                raise EngineError(
                    f"the worker at {worker} has another passiflex",
                    got=str(source),  # or the exception
                    needs=f"source {source_digest()}, as here",
                )
        for worker, threads in self._client.nthreads().items():
            if threads != 1:
                raise EngineError(
                    f"the worker at {worker} shares its interpreter",
                    got=f"{threads} threads",
                    try_="`dask worker --nworkers N --nthreads 1`",
                )


def _require_scheduler(address: str) -> None:
    """Raise EngineError unless a scheduler says in time that it is one.

    It is asked before there is a client: that waits forever for a server that accepts and stays silent, takes
    what a web server says for the size of a message, and prints what goes wrong.
    """
    failed: list[BaseException] = [TimeoutError("no answer")]

    def ask() -> None:
        try:
            asyncio.run(asyncio.wait_for(_ask(address), 1.5 * PATIENCE))
            failed.clear()
        except Exception as error:  # whatever the other side makes of us
            failed[:] = [error]

    thread = threading.Thread(target=ask, daemon=True)  # of its own: the caller may run an event loop
    thread.start()
    thread.join(2 * PATIENCE)
    if failed:
        raise _silent(address, failed[0]) from failed[0]


async def _ask(address: str) -> None:
    from distributed.comm import connect

    comm = await connect(address, timeout=PATIENCE)
    try:
        await comm.write({"op": "identity", "reply": True})
        said = await comm.read()
    finally:
        comm.abort()
    if not (isinstance(said, dict) and "workers" in said):
        raise EngineError("a part of dask that is no scheduler")


def _silent(address: str, error: BaseException) -> EngineError:
    return EngineError(
        f"no scheduler answers at {address}",
        got=(str(error) or type(error).__name__).partition("\n")[0],
        try_="`dask scheduler`, which prints its address",
    )
