"""Two hundred processes of real campaigns are killed at random: the files are those of an undisturbed run."""

from __future__ import annotations

import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from campaigns.killed_campaigns import SAMPLES, run
from chunks.cheap_campaign import ENVIRONMENT
from chunks.dask_processes import scheduler, wait_for_workers, worker
from passiflex.chunks.run_chunks import Progress
from passiflex.errors import PassiflexError

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("whole")
    run(folder, workers=0)
    return content(folder)


def content(folder: Path) -> dict[str, bytes]:
    """Return what a campaign left in its folder, but for the manifest and the lock, which say when and who."""
    said = (".lock", "manifest.json")
    paths = [path for path in folder.rglob("*") if path.is_file() and path.name not in said]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


@pytest.mark.parametrize(("who", "kills"), [("parent", 110), ("family", 20), ("workers", 40)])
def test_killed_processes_change_nothing(
    tmp_path: Path, whole: dict[str, bytes], who: str, kills: int
) -> None:
    words = [sys.executable, "-m", "campaigns.killed_campaigns", who, str(tmp_path), str(kills), "1"]
    done = subprocess.run(words, env=ENVIRONMENT, capture_output=True, text=True, timeout=1800, check=False)
    assert done.returncode == 0, done.stderr
    folders = done.stdout.split()
    assert folders
    for folder in folders:
        assert content(Path(folder)) == whole


def test_killed_workers_and_schedulers_of_a_cluster_change_nothing(
    tmp_path: Path, whole: dict[str, bytes]
) -> None:
    pytest.importorskip("distributed")
    rng, kills, count = np.random.default_rng(2), {"worker": 0, "scheduler": 0}, 0
    while kills["worker"] < 22 or kills["scheduler"] < 8:
        folder = tmp_path / str(count)
        count += 1
        while not until_killed(folder, kills, rng):
            pass
        assert content(folder) == whole


def until_killed(folder: Path, kills: dict[str, int], rng: np.random.Generator) -> bool:
    """Return whether a campaign is complete that goes on until its scheduler is killed; its workers are, too."""
    with ExitStack() as stack:
        address, process = stack.enter_context(scheduler())
        workers = [stack.enter_context(worker(address)) for _ in range(2)]
        wait_for_workers(address, 2)

        def kill_one(progress: Progress) -> None:
            if rng.random() < 0.15 and progress.done < SAMPLES:
                process.kill()
                kills["scheduler"] += 1
            elif rng.random() < 0.4:
                workers.pop(0).kill()
                kills["worker"] += 1
                workers.append(stack.enter_context(worker(address)))

        try:
            run(folder, scheduler=address, on_progress=kill_one)
        except PassiflexError:
            return False
        return True
