"""The run of a campaign: what is missing in its folder is computed, and written as it comes."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from pathlib import Path
from typing import NamedTuple

from passiflex.chunks.chunk import Failed, Rows, Work, evaluate
from passiflex.chunks.engines import Engine, usable_cores
from passiflex.chunks.source import source_digest
from passiflex.chunks.store import Store
from passiflex.chunks.worker import EngineError
from passiflex.errors import PassiflexError

QUIET = 10.0
"""Time between two lines of progress where they are not to be many [s]."""


class ChunkError(PassiflexError):
    """Samples that cannot be evaluated; the traceback is in the notes."""


class Progress(NamedTuple):
    """How far a campaign is.

    Attributes
    ----------
    done, total: Samples, those of earlier runs included.
    rate: Samples per second in this run [1/s].
    remaining: Expected time to the end [s].
    verdicts: How often each verdict occurs among the finished samples.
    """

    done: int
    total: int
    rate: float
    remaining: float
    verdicts: dict[str, int]


def sparsely(show: Callable[[Progress], None]) -> Callable[[Progress], None]:
    """Return a function that shows the first progress, the last, and one now and then between."""
    last = time.monotonic() - QUIET

    def on_progress(progress: Progress) -> None:
        nonlocal last
        if time.monotonic() - last >= QUIET or progress.done == progress.total:
            last = time.monotonic()
            show(progress)

    return on_progress


def run_chunks(
    store: Store,
    work: Work,
    executor: Executor,
    on_progress: Callable[[Progress], None] = lambda progress: None,
) -> Path:
    """Run the chunks that a store misses, and return the path of the file of all rows.

    Whatever ends it early, Ctrl-C or SIGTERM, leaves the finished chunks in the store; rows are not collected here.

    Parameters
    ----------
    work: Picklable; a row may depend on nothing but the text and the number of its sample.
    executor: An engine, or any executor that brings back the results of picklable functions.
    on_progress: Called after every chunk.

    Raises
    ------
    ChunkError
        If the work raises, or a chunk ends its worker again and again; the message names the samples.
    OutputError
        If a chunk cannot be written.
    """
    start, before = time.monotonic(), store.done
    missing = store.missing()
    running: dict[Future[Rows | Failed], range] = {}

    def room() -> bool:
        return len(running) < (executor.in_flight if isinstance(executor, Engine) else 2 * usable_cores())

    def keep(future: Future[Rows | Failed]) -> None:
        samples = running.pop(future)
        store.add(samples, _rows_of(future, samples))
        rate = (store.done - before) / max(time.monotonic() - start, 1e-9)
        left = (store.samples - store.done) / rate
        on_progress(Progress(store.done, store.samples, rate, left, dict(store.verdicts)))

    try:
        while True:
            while room() and (samples := next(missing, None)) is not None:
                running[executor.submit(evaluate, work, store.manifest.campaign, samples)] = samples
            if not running:
                return store.finish()
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                keep(future)
    except (KeyboardInterrupt, SystemExit):  # Ctrl-C, SIGTERM
        for future in [future for future in running if future.done()]:
            keep(future)
        raise
    finally:
        for future in running:
            future.cancel()


def _rows_of(future: Future[Rows | Failed], samples: range) -> Rows:
    names = (
        f"sample {samples.start}" if len(samples) == 1 else f"samples {samples.start} to {samples.stop - 1}"
    )
    try:
        outcome = future.result()
    except Exception as error:  # each executor has its own
        raise ChunkError(f"{names} cannot be evaluated", got=str(error) or type(error).__name__) from error
    if isinstance(outcome, Failed):
        failed = ChunkError(f"{names} cannot be evaluated", got=outcome.error)
        failed.add_note(outcome.traceback)
        raise failed
    if outcome.source != source_digest():
        raise EngineError(
            f"{names} were evaluated by other source than this process has",
            got=outcome.source,
            needs=source_digest(),
            try_="the same version of the package everywhere, and not editing it meanwhile",
        )
    return outcome
