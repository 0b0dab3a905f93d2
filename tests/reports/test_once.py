"""A page asks each run once for what takes long: audit, scenario, arm; and an old file is shown as a new one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from passiflex.reports import show
from passiflex.runs import run_arm, run_scenario
from passiflex.simulation import Run, parse_scenario, salvage, simulate
from worlds import planar_text


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Return how often each of these is done, from now on, with nothing remembered."""
    times: Counter[str] = Counter()

    def count(module: Any, name: str, what: str) -> None:
        real: Callable[..., Any] = getattr(module, name)

        def counting(*given: Any, **named: Any) -> Any:
            times[what] += 1
            return real(*given, **named)

        monkeypatch.setattr(module, name, counting)

    count(import_module("passiflex.passivity.audit"), "robot_balance", "audit")
    count(run_scenario, "parse_scenario", "scenario")
    count(run_arm, "read_chain", "arm")
    run_scenario.scenario_of_text.cache_clear()
    run_arm._described.cache_clear()
    return times


def test_a_page_of_two_runs_does_each_thing_once_for_each(tmp_path: Path, counted: Counter[str]) -> None:
    runs = [simulate(parse_scenario(planar_text(name=name))) for name in ("one", "other")]
    counted.clear()
    show(runs[0], tmp_path / "page.html", runs[1:])
    assert counted["audit"] == 2
    assert counted["scenario"] == 2
    assert counted["arm"] == 1  # both have the same


def test_an_old_file_is_shown_as_a_new_one(tmp_path: Path) -> None:
    run = simulate(parse_scenario(planar_text()))
    data = run.data.copy()
    data.attrs = {{"scenario": "configuration"}.get(name, name): value for name, value in data.attrs.items()}
    read = salvage(Run(data).save(tmp_path / "old.nc"))
    pages = [each.show(tmp_path / f"{i}.html").read_text() for i, each in enumerate((run, read.run))]
    assert pages[0] == pages[1]
