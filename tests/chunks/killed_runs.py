"""Run a cheap campaign in this process's children, each killed at a random moment, until one gets through.

    python -m chunks.killed_runs FOLDER SAMPLES TEXT SEED

What takes long to import is imported once, before the first fork. Prints the number of children killed.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

import passiflex.runs.run  # noqa: F401 (a new campaign asks it for the commit)
from chunks.cheap_campaign import run

LONGEST = 0.3
"""Latest moment of a kill [s]."""


def killed_runs(folder: Path, samples: int, campaign: str, seed: int) -> int:
    """Return how many children were killed before one completed the campaign."""
    rng = np.random.default_rng(seed)
    for kills in range(100):
        child = os.fork()
        if child == 0:
            run(folder, 0, samples, campaign)
            os._exit(0)
        time.sleep(rng.uniform(0, LONGEST))
        os.kill(child, signal.SIGKILL)
        if os.waitpid(child, 0)[1] == 0:
            return kills
    raise AssertionError("the campaign does not get on")


if __name__ == "__main__":
    print(killed_runs(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3], int(sys.argv[4])))
