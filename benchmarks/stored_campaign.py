"""A whole campaign of 30 s tasks with its folder: time, memory and disk."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import yaml
from rich.console import Console
from rich.table import Table

from passiflex.campaigns import parse_campaign
from passiflex.studies.paper import shipped_scenario

TWO_CORES, MEMORY = 700.0, 1024.0
"""Asked: robot-seconds per second on two cores, and MiB."""
STORED = """
import glob, os, resource, sys, threading, time
from pathlib import Path
def resident():
    total = 0
    for children in ["self"], *(Path(f).read_text().split() for f in glob.glob("/proc/self/task/*/children")):
        for pid in children:
            try:
                lines = Path(f"/proc/{pid}/status").read_text().splitlines()
                total += sum(int(line.split()[1]) for line in lines if line.startswith("VmRSS:"))
            except OSError:
                pass
    return total / 1024
peak = [0.0]
def watch():
    while True:
        peak[0] = max(peak[0], resident())
        time.sleep(0.05)
threading.Thread(target=watch, daemon=True).start()
from passiflex.campaigns import parse_campaign, run_campaign
start, seen = time.perf_counter(), []
campaign = parse_campaign(open(sys.argv[1], encoding="utf-8").read())
progress = lambda p: seen.append((time.perf_counter() - start, p.done))
run_campaign(campaign, sys.argv[2], workers=2, on_progress=progress)
whole = time.perf_counter() - start
of = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
most = of[1].ru_maxrss / 1024
print(whole, *seen[min(1, len(seen) - 1)], *seen[-1], peak[0], most, sum(u.ru_utime + u.ru_stime for u in of))
"""


def campaign_text(samples: int) -> str:
    """Return a campaign of the shipped task with uncertain joints, motors and sensors, every fifth sample recorded."""
    scenario = shipped_scenario("fig1_sampled").model_copy(update={"output_interval": 0.005})
    ends = {"distribution": "uniform", "low": "-20 %", "high": "20 %"}
    data = {
        "name": "benchmark",
        "scenario": scenario.model_dump(mode="json", by_alias=True, exclude_none=True),
        "samples": samples,
        "parameters": {
            "deviations.joint_stiffness": {**ends, "per": "joint"},
            "deviations.motor_inertia": ends,
            "noise.torque_variance": {"distribution": "log_uniform", "low": 0.01, "high": 1},
        },
        "keep": {"response": "50 ms"},
    }
    return parse_campaign(yaml.safe_dump(data)).to_yaml()


def stored(console: Console, samples: int) -> None:
    """Print time, memory and disk of a whole campaign with its folder, in processes of its own."""
    with tempfile.TemporaryDirectory() as folder:
        text, results = Path(folder, "campaign.yaml"), Path(folder, "results")
        text.write_text(campaign_text(samples), encoding="utf-8")
        done = subprocess.run(
            [sys.executable, "-c", STORED, str(text), str(results)],
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            console.print(
                f"- the campaign did not run: {done.stderr.strip().splitlines()[-1]}", highlight=False
            )
            return
        size = sum(file.stat().st_size for file in results.rglob("*") if file.is_file())
    numbers = [float(word) for word in done.stdout.split()]
    whole, first_at, first, last_at, last, memory, worker, cores = numbers
    steady = (last - first) / max(last_at - first_at, 1e-9)
    thousand = whole + (1000 - samples) / steady
    table = Table("1000 robots × 30 s, two processes, stored", "", "asked", "met")
    said = "measured" if samples == 1000 else f"from {samples} measured in {whole:.1f} s"
    table.add_row("time on the wall", f"{thousand:.0f} s, {said}")
    table.add_row("  first two chunks done after", f"{first_at:.0f} s")
    table.add_row(
        "  robot-s per s from there on", f"{steady * 30:.0f}", f"≥ {TWO_CORES:g}",
        "yes" if steady * 30 >= TWO_CORES else "NO",
    )  # fmt: skip
    table.add_row("  robot-s per core-second, all in", f"{samples * 30 / cores:.0f}")
    table.add_row(
        "peak memory of all processes (largest child)", f"{memory:.0f} ({worker:.0f}) MiB", f"≤ {MEMORY:g} MiB",
        "yes" if memory <= MEMORY else "NO",
    )  # fmt: skip
    table.add_row("on disk", f"{size / samples / 1024:.1f} KiB per sample")
    console.print(table)
