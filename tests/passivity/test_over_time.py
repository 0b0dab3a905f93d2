"""A verdict is an extremum over time: rows change nothing about it, nor does when a reference jumps."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from passiflex.passivity import Audit, audit, available_energy
from passiflex.passivity.extremes import extremes, extremes_of_rows
from passiflex.problems.resolution import resolve
from passiflex.simulation import Run, parse_scenario, salvage, simulate
from passiflex.simulation.batch import simulate_batch, simulate_in_lane
from passiflex.simulation.integrate import Stretch, smooth_stretch
from worlds import PERIOD, by_rows, merged, planar_text, ran, world

JUDGED = ("verdict", "time", "term", "margin", "margin_time", "integration_error", "books_error")
ACTIVE: dict[str, Any] = {
    "law": {"shaped_stiffness": {"ratio": 10}, "shaped_inertia": {"ratio": 0.01}},
    "control": {"external_torque": "measured", "allow_unstable": True, "delay": PERIOD},
    "motors": {"torque_limit": "robot"},
}
"""The paper's gains on the small arm: between two samples they give more than there was."""
RIGID: dict[str, Any] = {
    "name": "rigid",
    "robot": "iiwa14",
    "posture": [0, 0.6, 0, -1.2, 0, 1, 0],
    "law": {
        "type": "rigid", "task": "position", "gravity": "robot", "stiffness": {"translation": 200},
        "damping": {"translation": 40}, "target_inertia": {"translation": 3},
    },
    "duration": 0.6,
    "output_interval": 0.01,
}  # fmt: skip


def continuous(**changes: Any) -> Run:
    """Return a run of the small arm in continuous time."""
    text = planar_text(reference=[{"at": 0.1, "kind": "step", "by": [0, 0, 0.05]}], duration=0.6, **changes)
    return simulate(parse_scenario(text))


def judged(run: Run) -> dict[str, Any]:
    result = audit(run)
    return {name: getattr(result, name) for name in JUDGED}


def rigid(at: float, **changes: Any) -> Run:
    step = [{"at": at, "kind": "step", "by": [0, 0, 0.05]}]
    return simulate(parse_scenario(yaml.safe_dump(RIGID | {"reference": step} | changes)))


# Rows


@lru_cache
def every_period(seed: int) -> Run:
    return ran(**drawn(seed))


def drawn(seed: int) -> dict[str, Any]:
    """Return a loop that is stable or not, with a tank or none to speak of, noise or none, a push."""
    rng = np.random.default_rng(seed)
    active = ACTIVE if rng.random() < 0.5 else {}
    return merged(
        active,
        {
            "tank": {"initial": rng.choice([0.2, 2.0])},
            "noise": {"torque_variance": rng.choice([1e-6, 0.04]), "hold": PERIOD},
            "forces": [{"from": 0.3, "to": 0.4, "force": [*rng.normal(size=2) * 5, 3]}],
            "seed": seed,
        },
    )


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 5), st.sampled_from([0.002, 0.005, 0.03, 0.1, 0.2, 0.3, 0.6]))
def test_the_interval_of_the_rows_changes_nothing(seed: int, interval: float) -> None:
    """It is one simulation: verdict, margin, times and terms are the same to the last bit."""
    whole = every_period(seed)
    assert judged(ran(**drawn(seed) | {"output_interval": interval})) == judged(whole)
    assert extremes(whole).every_step


@pytest.mark.parametrize("ratio", [0.3, 0.002], ids=["Runge-Kutta", "CVODES"])
def test_nor_in_continuous_time(ratio: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """By Runge-Kutta, and by CVODES where the shaped motors are fast: it looks at the same instants in any case."""
    smooth: list[int] = []

    def counted(*arguments: Any) -> Stretch:
        smooth.append(1)
        return smooth_stretch(*arguments)

    monkeypatch.setattr(import_module("passiflex.simulation.through_time"), "smooth_stretch", counted)
    law = {"shaped_inertia": {"ratio": ratio}}
    runs = [continuous(output_interval=interval, law=law) for interval in (0.001, 0.03, 0.6)]
    assert bool(smooth) == (ratio == 0.002)
    found = [judged(run) for run in runs]
    for other in found[1:]:
        assert (other["verdict"], other["term"]) == (found[0]["verdict"], found[0]["term"])
        assert other["margin"] == pytest.approx(found[0]["margin"], abs=1e-8)
        assert other["margin_time"] == pytest.approx(found[0]["margin_time"], abs=1e-3)


def test_an_overdraft_between_two_rows_is_one() -> None:
    """Rows 0.6 s apart see the start and the end: by them alone nothing happened."""
    late = {
        "control": {"delay": 2 * PERIOD},
        "tank": {"initial": 0.02, "floor": 0.01},
        "output_interval": 0.6,
    }
    sparse = ran(**merged(ACTIVE, late))
    assert len(sparse.time) == 2
    result = audit(sparse)
    assert result.verdict == "violated"
    assert 0.1 < result.time < 0.2
    assert result.every_step
    old = audit(by_rows(sparse))
    assert old.verdict == "passive"
    assert not old.every_step


@pytest.mark.parametrize("seed", range(4))
def test_no_row_has_less(seed: int) -> None:
    """Rows at every sample are some of the steps: the least of them is above the least, by what a period may hide."""
    run = every_period(seed)
    left = available_energy(run)
    noted, rows = extremes(run), extremes_of_rows(run)
    round_off = 1e-12 * max(1.0, np.abs(left).max())
    assert noted.margin <= left.min() + round_off
    assert noted.overdraft_time <= rows.overdraft_time
    assert noted.integration_error >= rows.integration_error - round_off
    most = np.abs(np.diff(left)).max()  # of a period
    assert left.min() - noted.margin <= most
    assert abs(noted.time - run.time[left.argmin()]) <= PERIOD


def test_the_least_margin_of_a_step_is_that_of_a_fine_run() -> None:
    """Against rows at every 10 µs, by CVODES at a tolerance of 1e-11: an extremum has no first-order error."""
    law = {"shaped_inertia": {"ratio": 0.002}}
    run, fine = (
        continuous(law=law, output_interval=0.1),
        continuous(law=law, output_interval=1e-5, tolerance=1e-11),
    )
    left = available_energy(fine)
    assert audit(run).margin == pytest.approx(left.min(), abs=1e-7)
    assert audit(run).time == pytest.approx(fine.time[left.argmin()], abs=3e-5)


def test_lanes_note_what_runs_alone_note() -> None:
    problems = [resolve(world(**drawn(seed) | {"output_interval": 0.1})) for seed in range(3)]
    for seed, recording in enumerate(simulate_batch(problems, ["q"])):
        alone = every_period(seed)
        in_lane = simulate_in_lane(problems[seed])
        for name, value in recording.noted.items():
            np.testing.assert_array_equal(in_lane[name], value)
        stable = "allow_unstable" not in str(drawn(seed))
        if stable:
            assert float(recording["least_margin"]) == pytest.approx(float(alone["least_margin"]), abs=1e-9)


def test_a_storage_that_is_negative_counts_from_its_lowest_value_at_any_time() -> None:
    """Compensated at the motors, S̃ starts below 0 by the weight's deflection: the budget is larger by that much."""
    changes: dict[str, Any] = {"law": {"gravity": "motor"}, "output_interval": 0.6}
    run = ran(**changes)
    lowest = float(run["lowest_storage"])
    assert lowest < 0
    fine = ran(**changes | {"output_interval": PERIOD})
    storage = np.sum(
        [fine[f"{n}_energy"] for n in ("shaped_kinetic", "shaped_spring", "cartesian_spring")], axis=0
    )
    storage += fine["compensated_energy"] + fine["gravity_storage"]
    assert lowest == pytest.approx(storage.min(), abs=1e-12)
    assert judged(run) == judged(fine)


# Files


def test_what_was_noted_is_in_the_file(tmp_path: Path) -> None:
    run = every_period(0)
    path = run.save(tmp_path / "run.nc")
    assert judged(Run.load(path)) == judged(run)
    read, notices = salvage(path)
    assert notices == ()
    assert judged(read) == judged(run)
    for name in ("least_margin", "overdraft_time", "highest_speed"):
        assert run.data[name].attrs["units"]
        assert run.data[name].attrs["long_name"]
    assert judged(run.every(7)) == judged(run)


def test_a_file_whose_rows_tell_of_less_is_judged_by_them() -> None:
    """Energy that somebody added to the rows: the worse of the two counts."""
    run = every_period(0)
    data = run.data.copy(deep=True)
    for name in ("joint_energy", "link_kinetic_energy"):
        data[name] = data[name] + 10 * (data["time"] > 0.5)
    result = audit(Run(data))
    assert result.verdict == "violated"
    assert not result.every_step


# A jump at the start


def law_books(result: Audit) -> float:
    return result.balances[2].worst


@pytest.mark.parametrize("sampled", [False, True])
def test_a_step_costs_at_0_s_what_it_costs_later(sampled: bool) -> None:
    """½ K (5 cm)²: a mark, an entry in the books and a payment, at whatever time; the same motion, only later."""
    control = {"control": {"rate": 1000, "external_torque": "true"}} if sampled else {}
    runs = []
    for at in (0.0, 0.01):
        step = [{"at": at, "kind": "step", "by": [0, 0, 0.05]}]
        data = yaml.safe_load(planar_text(reference=step, duration=0.6)) | control
        runs.append(simulate(parse_scenario(yaml.safe_dump(data))))
    stiffness = yaml.safe_load(planar_text())["law"]["stiffness"]["translation"]
    cost = stiffness * 0.05**2 / 2
    for run, row in zip(runs, (0, np.searchsorted(runs[1].time, 0.01 - 1e-9)), strict=True):
        assert run["reference_energy"][row] == pytest.approx(cost, rel=1e-6)
        assert run["tank_energy"][row] == pytest.approx(2 - cost, rel=1e-6)
    if not sampled:
        assert [event["stored_J"] for run in runs for event in run.events] == pytest.approx(
            [cost] * 2, rel=1e-6
        )
    first, later = map(audit, runs)
    assert first.margin == pytest.approx(later.margin, abs=1e-7)
    assert later.time == pytest.approx(first.time + 0.01, abs=2e-3)
    assert law_books(first) == pytest.approx(law_books(later), abs=1e-6)


@pytest.mark.parametrize(
    "changes", [{}, {"control": {"rate": 1000, "external_torque": "true", "allow_unstable": True}}]
)
def test_the_rigid_law_starts_with_nothing_but_what_it_is_lent(changes: dict[str, Any]) -> None:
    """Before the step it has no energy at all: so the least margin is 0 or less, at 0 s as later."""
    first, later = (audit(rigid(at, **changes)) for at in (0.0, 0.01))
    assert first.margin == pytest.approx(later.margin, abs=1e-6)
    assert first.margin < 1e-9
    run = rigid(0.0, **changes)
    lent = 200 * 0.05**2 / 2
    assert run["reference_energy"][0] == pytest.approx(lent, rel=1e-6)


def test_no_jump_is_no_event() -> None:
    """A reference that starts where the hand is costs nothing, of a tank that holds nothing either."""
    move = [{"at": 0.0, "kind": "move", "by": [0, 0, 0.05], "duration": 0.3}]
    run = simulate(
        parse_scenario(planar_text(reference=move, duration=0.4, tank={"initial": 0.011, "floor": 0.01}))
    )
    assert run.events == []
    assert run["reference_energy"][0] == 0
