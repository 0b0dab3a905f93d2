"""A campaign whose samples cost what its text says, and a process that runs it: something to kill.

python -m chunks.cheap_campaign FOLDER WORKERS SAMPLES TEXT
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from passiflex.chunks.engines import InProcess, LocalProcesses
from passiflex.chunks.run_chunks import run_chunks
from passiflex.chunks.store import open_store
from passiflex.errors import PassiflexError

TESTS = Path(__file__).parents[1]
CHUNK = 4
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join([str(TESTS.parent / "src"), str(TESTS)])}


def text(**settings: Any) -> str:
    """Return a campaign's text: sleep [s], log (a file for a line per sample), deadly, deadly_once, wrong."""
    return json.dumps(settings)


def row(sample: int) -> dict[str, Any]:
    """Return the row of a sample: all kinds of values, with kinds and holes that come late."""
    return {
        "sample": sample,
        "angle": sample / 7,
        "count": sample if sample % 5 else None,
        "mixed": sample if sample < 10 else sample + 0.5,
        "late": None if sample < 9 else f"text {sample}",
        "never": None,
        "bool": sample % 2 == 0,
        "values": [1.0 * sample, float("nan")],
        "gap": float("nan"),
        "verdict": "holds" if sample % 3 else "fails",
    }


def work(campaign: str, samples: Sequence[int]) -> list[dict[str, Any]]:
    """Return rows, after what the text orders."""
    settings = json.loads(campaign)
    rows = []
    for sample in samples:
        if "log" in settings:
            with open(settings["log"], "a") as log:
                log.write(f"{sample} {os.getpid()} {threading.get_ident()}\n")
        time.sleep(settings.get("sleep", 0.0))
        if sample == settings.get("wrong"):
            raise ValueError(f"sample {sample} is wrong")
        if sample == settings.get("deadly"):
            os.kill(os.getpid(), signal.SIGKILL)
        if sample == settings.get("deadly_once"):
            mark = Path(settings["log"] + ".mark")
            if not mark.exists():
                mark.touch()
                os.kill(os.getpid(), signal.SIGKILL)
        rows.append(row(sample))
    return rows


def logged(log: Path) -> list[tuple[int, int]]:
    """Return sample and process of each evaluation; a line that a kill cut short is left out."""
    lines = log.read_text().splitlines() if log.exists() else []
    return [(int(line.split()[0]), int(line.split()[1])) for line in lines if len(line.split()) == 3]


def evaluations(log: Path) -> Counter[int]:
    """Return how often each sample was evaluated."""
    return Counter(sample for sample, _ in logged(log))


def start(folder: Path, workers: int, samples: int, campaign: str, **popen: Any) -> subprocess.Popen[str]:
    """Start a process that runs the campaign, as a leader of its own session."""
    command = [sys.executable, "-m", "chunks.cheap_campaign", folder, workers, samples, campaign]
    return subprocess.Popen(
        [str(word) for word in command],
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        **popen,
    )


def run(folder: Path, workers: int, samples: int, campaign: str = "{}", **options: Any) -> Path:
    """Run the campaign here, with so many local workers, or none."""
    options = {"chunk": CHUNK} | options
    with (
        open_store(folder, campaign, samples, **options) as store,
        LocalProcesses(workers) if workers else InProcess() as engine,
    ):
        return run_chunks(store, work, engine)


if __name__ == "__main__":
    try:
        print(run(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]))
    except PassiflexError as error:
        sys.exit(f"passiflex: {error}")
    except KeyboardInterrupt:
        sys.exit("passiflex: interrupted")
