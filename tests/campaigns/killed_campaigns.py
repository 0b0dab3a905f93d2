"""Real campaigns whose processes are killed at random, again and again, until each of them is complete.

    python -m campaigns.killed_campaigns WHO FOLDER KILLS SEED

WHO is `parent` (one process), `family` (a parent that has workers) or `workers`. A campaign that is complete begins
anew in another folder until so many processes were killed. Prints a line for each: its folder.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

from campaigns.small_campaigns import SAMPLED, STIFFNESS, campaign, uniform
from passiflex.campaigns import Results, run_campaign
from passiflex.chunks.run_chunks import ChunkError, Progress

LONGEST = {"parent": 0.4, "family": 5.0}
"""Latest moment of the first kill [s]."""
SAMPLES = 320
CAMPAIGN = campaign(
    SAMPLED,
    parameters={STIFFNESS: uniform(-0.2, 0.2, per="joint")},
    keep={"worst": 1, "by": "margin"},
    samples=SAMPLES,
)


def run(folder: Path, **options: object) -> Results:
    """Run the campaign, or what is missing of it."""
    return run_campaign(CAMPAIGN, folder, **options)  # type: ignore[arg-type]


def killed_parents(folder: Path, workers: int, longest: float, rng: np.random.Generator) -> int:
    """Return how many processes were killed before one completed the campaign."""
    for kills in range(10_000):
        child = os.fork()
        if child == 0:
            run(folder, workers=workers)
            os._exit(0)
        time.sleep(rng.uniform(0, longest * (1 + kills / 8)))  # in the end one gets through
        os.kill(child, signal.SIGKILL)
        if os.waitpid(child, 0)[1] == 0:
            return kills
    raise AssertionError("the campaign does not get on")


def killed_workers(folder: Path, rng: np.random.Generator) -> int:
    """Return how many workers were killed while the campaign ran."""
    killed = 0

    def kill_one(progress: Progress) -> None:
        nonlocal killed
        workers = multiprocessing.active_children()
        if workers and rng.random() < 0.5:
            victim = workers[rng.integers(len(workers))].pid
            assert victim is not None
            os.kill(victim, signal.SIGKILL)
            killed += 1

    while True:
        with suppress(ChunkError):  # one of its calls cost as many workers as a call may
            run(folder, workers=2, on_progress=kill_one)
            return killed


def campaigns(who: str, folder: Path, kills: int, seed: int) -> Iterator[Path]:
    """Yield the folders of complete campaigns."""
    rng, count, killed = np.random.default_rng(seed), 0, 0
    run(folder / "warm", workers=0, samples=1)  # compiled once, for all that are forked from here
    while killed < kills:
        here = folder / str(count)
        if who == "workers":
            killed += killed_workers(here, rng)
        else:
            killed += killed_parents(here, 2 * (who == "family"), LONGEST[who], rng)
        count += 1
        yield here


if __name__ == "__main__":
    for done in campaigns(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])):
        print(done)
