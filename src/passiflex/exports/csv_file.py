"""A run as a table: text that any program reads, without loss."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from passiflex.exports.signals import signals_of
from passiflex.runs.run import Run

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What a spreadsheet would take for the beginning of a formula."""
BLOCK = 2000
"""Rows that are turned into text at once: a run of many signals is larger as text than in memory."""


def write_csv(run: Run, path: Path) -> None:
    """Write all signals over time as RFC 4180 has it: one header, one row per instant, all rows of the run.

    The first column is `time [s]`; the others say signal, index and unit, as `q_1 [rad]`. Numbers have as
    many digits as it takes to read them back bit for bit. What is no signal over time, as the robot's
    limits, is not in the table. There is no comment line: readers take the first line for the header. A name of
    a foreign file that a spreadsheet would run as a formula gets a leading '.
    """
    signals = list(signals_of(run))
    table = np.column_stack([run.time, *(signal.values for signal in signals)])
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        titles = [title for signal in signals for title in signal.titles]
        writer.writerow(["time [s]", *(f"'{t}" if t.startswith(FORMULA) else t for t in titles)])
        for start in range(0, len(table), BLOCK):
            writer.writerows(table[start : start + BLOCK].tolist())
