"""The table: every bit of every signal, for every reader."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from passiflex.exports import csv_file, export_run
from passiflex.exports.signals import signals_of
from passiflex.simulation import Run


def read_back(path: Path) -> dict[str, np.ndarray]:
    """Return the columns as Python's own reader has them."""
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file, strict=True)
    assert len(set(header)) == len(header)
    assert all(len(row) == len(header) for row in rows)
    return dict(zip(header, np.array([[float(x) for x in row] for row in rows]).T, strict=True))


@pytest.mark.parametrize("block", [csv_file.BLOCK, 7, 301])
def test_the_table_holds_the_run_bit_for_bit(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int
) -> None:
    monkeypatch.setattr(csv_file, "BLOCK", block)
    table = read_back(export_run(run, tmp_path / "run.csv"))
    assert next(iter(table)) == "time [s]"
    np.testing.assert_array_equal(table.pop("time [s]"), run.time)
    for signal in signals_of(run):
        for k, title in enumerate(signal.titles):
            assert table.pop(title).tobytes() == np.ascontiguousarray(signal.values[:, k]).tobytes()
    assert table == {}


def test_a_name_from_elsewhere_is_no_formula(run: Run, tmp_path: Path) -> None:
    hostile = {"q": "=HYPERLINK(1)", "dq": "@SUM(1)", "theta": "+1", "dtheta": "-1", "tau_m": "a=b"}
    table = read_back(export_run(Run(run.data.rename(hostile)), tmp_path / "run.csv"))
    assert "'=HYPERLINK(1)_1 [rad]" in table
    assert "a=b_1 [N m]" in table
    assert not [title for title in table if title[0] in "=+-@"]


def test_numbers_of_all_kinds_come_back(run: Run, tmp_path: Path) -> None:
    data = run.data.copy(deep=True)
    odd = [np.nan, np.inf, -np.inf, -0.0, 5e-324, 1 / 3, 1e300, 0.1 + 0.2]
    data["tank_energy"][: len(odd)] = odd
    got = read_back(export_run(Run(data), tmp_path / "run.csv"))["tank_energy [J]"]
    assert got[: len(odd)].tobytes() == np.array(odd).tobytes()


def test_numpy_and_a_plain_reading_of_lines_agree(run: Run, tmp_path: Path) -> None:
    path = export_run(run, tmp_path / "run.csv")
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    np.testing.assert_array_equal(table[:, 0], run.time)
    text = path.read_bytes()
    assert text.count(b"\r\n") == text.count(b"\n") == len(run.time) + 1  # as RFC 4180 has it
    assert text.startswith(b"time [s],q_1 [rad],q_2 [rad],")
    named = np.genfromtxt(path, delimiter=",", names=True)
    np.testing.assert_array_equal(named["tank_energy_J"], run["tank_energy"])
