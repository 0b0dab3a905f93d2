"""The search for the worst case: found where it is known to be, within the budget, and the same again as a file."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaigns.small_campaigns import CONTINUOUS, SAMPLED, STIFFNESS, campaign, choice, same_rows, uniform
from passiflex.campaigns import Campaign, load_campaign
from passiflex.campaigns import search as room
from passiflex.campaigns.box import EDGE, Box
from passiflex.campaigns.evaluate import evaluate_problems
from passiflex.campaigns.found import Found, require_place
from passiflex.campaigns.search import DISTINCT, search
from passiflex.cli.campaign_tables import found_table
from passiflex.errors import NameUnknownError, ValueRangeError
from passiflex.files import OutputError
from passiflex.metrics.measures import MEASURES
from passiflex.scenarios.scenario import Scenario
from passiflex.simulation import load_scenario, resolve, simulate
from worlds import merged

FORCE, VARIANCE, LOOP = "forces.1.force.1", "noise.torque_variance", "control.inner_loop"
PUSHED: dict[str, Any] = merged(
    SAMPLED, {"duration": 0.4, "forces": [{"from": 0.1, "to": 0.2, "force": [0, 0, 0]}]}
)
BORDER = {FORCE: uniform(2, 8), VARIANCE: {"distribution": "log_uniform", "low": 1e-6, "high": 1e-2}}
"""The harder the push, the more energy the environment gives."""


def searched(measure: str = "external_energy", *, scenario: dict[str, Any] = PUSHED, **more: Any) -> Found:
    settings = {"evaluations": 64, "keep": 3} | {
        k: more.pop(k) for k in ("evaluations", "keep", "seed", "report") if k in more
    }
    return search(campaign(scenario, **({"parameters": BORDER} | more)), measure, **settings)


def again(folder: Path, rank: int) -> tuple[Scenario, dict[str, Any]]:
    """Return a case's file and its measures when it is run as `evaluate_problems` does."""
    scenario = load_scenario(folder / f"worst_{rank}.yaml")
    (measured,) = evaluate_problems([resolve(scenario)], [scenario])
    return scenario, measured


def test_a_worst_point_at_the_border_is_found_there() -> None:
    found = searched()
    assert found.cases[0].values[FORCE] == 8
    values = [case.measures["external_energy"] for case in found.cases]
    assert values == sorted(values, reverse=True)


def test_the_bad_end_is_that_of_the_measure() -> None:
    """The margin is bad where it is low: it begins with what is in the tank."""
    found = searched("margin", parameters={"tank.initial": uniform(1, 3)})
    assert MEASURES["margin"].worst == "low"
    assert found.cases[0].values["tank.initial"] == 1
    assert found.cases[0].measures["margin"] == min(float(c.measures["margin"]) for c in found.cases)


def test_nothing_beats_it_on_a_grid() -> None:
    parameters = {"law.damping.translation": uniform(10, 30), STIFFNESS: uniform(-0.3, 0.3)}
    found = searched("torque_peak", parameters=parameters, evaluations=120, keep=1)
    of = campaign(PUSHED, parameters=parameters)
    scenarios = [
        room.with_values(of, {"law.damping.translation": d, STIFFNESS: k})
        for d in np.linspace(10, 30, 8)
        for k in np.linspace(-0.3, 0.3, 8)
    ]
    grid = evaluate_problems([resolve(s) for s in scenarios], scenarios)
    assert found.cases[0].measures["torque_peak"] >= max(float(m["torque_peak"]) for m in grid)


def test_the_budget_is_kept_and_told() -> None:
    lines: list[str] = []
    found = searched(evaluations=50, report=lines.append)
    assert found.evaluations == found.budget == 50
    assert lines[-1].startswith("50 of 50 simulations; worst external_energy: ")
    assert len(lines) == len(found.history)
    counts, best = zip(*found.history, strict=True)
    assert (counts[-1], best[-1]) == (50, found.cases[0].measures["external_energy"])
    assert list(best) == sorted(best)


def test_no_point_is_simulated_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of three words there are three scenarios, however many simulations are allowed."""
    ran: list[Any] = []

    def counting(problems: Any, scenarios: Any) -> Any:
        ran.extend(problems)
        return evaluate_problems(problems, scenarios)

    monkeypatch.setattr(room, "evaluate_problems", counting)
    found = searched(parameters={"control.external_torque": choice("true", "measured", "none")}, keep=5)
    assert len(ran) == found.evaluations == 3
    assert {c.values["control.external_torque"] for c in found.cases} == {"true", "measured", "none"}


def test_words_numbers_and_joints_are_searched_together() -> None:
    parameters = {
        LOOP: choice("plain", "matched"), "noise.hold": choice(0.005, 0.01), STIFFNESS: uniform(-0.1, 0.1, per="joint"),
        "control.delay": choice(0.005),
    }  # fmt: skip
    found = searched("torque_peak", parameters=parameters)
    for case in found.cases:
        assert case.values[LOOP] in ("plain", "matched")
        assert case.values["noise.hold"] in (0.005, 0.01)
        assert case.values["control.delay"] == 0.005
        assert len(case.values[STIFFNESS]) == 2  # type: ignore[arg-type]
        assert case.scenario.control is not None
        assert case.scenario.control.inner_loop == case.values[LOOP]


def test_a_campaign_of_constants_has_one_case() -> None:
    found = searched(parameters={FORCE: choice(3.0)})
    assert (found.evaluations, [c.values for c in found.cases]) == (1, [{FORCE: 3}])


def test_the_same_seed_finds_the_same_and_another_looks_elsewhere() -> None:
    one, same, other = (searched("margin", seed=s, evaluations=32) for s in (1, 1, 2))
    assert [c.values for c in one.cases] == [c.values for c in same.cases]
    assert (one.history, one.evaluations) == (same.history, same.evaluations)
    assert one.history != other.history


def test_every_point_has_the_scenarios_own_seed() -> None:
    found = searched(scenario=merged(PUSHED, {"seed": 17}), evaluations=16)
    assert {c.scenario.seed for c in found.cases} == {17}


def test_cases_are_distinct() -> None:
    found = searched(keep=5)
    box = Box.of(campaign(PUSHED, parameters=BORDER))
    points = [
        np.array([(float(c.values[FORCE]) - 2) / 6, (math.log10(float(c.values[VARIANCE])) + 6) / 4])  # type: ignore[arg-type]
        for c in found.cases
    ]
    assert len(points) == 5
    for i, one in enumerate(points):
        assert all(box.distance(one, other) >= DISTINCT - 1e-9 for other in points[:i])


@pytest.mark.parametrize(
    "which", [PUSHED, CONTINUOUS, merged(PUSHED, {"law": {"shaped_inertia": {"ratio": 0.6}}})]
)
def test_a_saved_case_runs_again_to_the_last_bit(which: dict[str, Any], tmp_path: Path) -> None:
    """Also where its loop is unstable, which `passiflex simulate` refuses unless the scenario insists."""
    parameters = {STIFFNESS: uniform(-0.2, 0.3, per="joint"), FORCE: uniform(-5, 5)}
    found = searched("margin", scenario=which, parameters=parameters, evaluations=24)
    paths = found.save(tmp_path)
    assert [p.name for p in paths] == ["worst_1.yaml", "worst_2.yaml", "worst_3.yaml", "search.json"]
    for rank, case in enumerate(found.cases, start=1):
        scenario, measured = again(tmp_path, rank)
        assert scenario == case.scenario
        assert scenario.name == f"planar_worst_{rank}"
        assert same_rows([measured], [case.measures])
        run = simulate(scenario)  # not refused
        assert not case.measures["failure"] or run.failure


def test_a_case_insists_where_its_loop_is_unstable_only() -> None:
    parameters = {"law.shaped_inertia.ratio": uniform(0.3, 1.5)}
    found = searched("torque_peak", parameters=parameters, keep=10)
    assert all(c.scenario.control for c in found.cases)
    insists = {
        float(c.values["law.shaped_inertia.ratio"]): c.scenario.control.allow_unstable  # type: ignore[arg-type,union-attr]
        for c in found.cases
    }
    assert insists == {ratio: ratio < 0.67 for ratio in insists}
    assert set(insists.values()) == {False, True}


def test_what_diverges_is_worst_and_the_earlier_the_worse() -> None:
    parameters = {"law.shaped_inertia.ratio": {"distribution": "log_uniform", "low": 0.02, "high": 2}}
    scenario = merged(PUSHED, {"duration": 1, "tank": {"kind": "paper"}})
    found = searched("margin", scenario=scenario, parameters=parameters, keep=10)
    failed = [bool(c.measures["failure"]) for c in found.cases]
    assert failed[0]
    assert not failed[-1]
    assert failed == sorted(failed, reverse=True)
    ends = [float(c.measures["end_time"]) for c in found.cases if c.measures["failure"]]
    assert ends == sorted(ends)
    assert "diverged at" in str(next(iter(found_table(found).columns[2].cells)))


def test_impossible_points_are_left_and_counted() -> None:
    """A posture beyond the end of the joint's range is none of this robot's."""
    found = searched("torque_peak", parameters={"posture.2": uniform(0.5, 9.0)}, evaluations=40)
    assert 0 < found.refused < found.evaluations == 40
    assert all(float(c.values["posture.2"]) < 7 for c in found.cases)  # type: ignore[arg-type]


def test_a_problem_that_cannot_be_run_does_not_take_others_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def moody(problems: Any, scenarios: list[Scenario]) -> Any:
        if any(s.forces[0].force[0] > 5 for s in scenarios):
            raise ValueRangeError("cannot be integrated")
        return evaluate_problems(problems, scenarios)

    monkeypatch.setattr(room, "evaluate_problems", moody)
    found = searched(evaluations=24)
    assert 0 < found.refused < 24
    assert all(float(c.values[FORCE]) <= 5 for c in found.cases)  # type: ignore[arg-type]


def test_a_measure_that_is_no_number_has_no_cases() -> None:
    found = searched("settling_time", scenario=PUSHED | {"reference": None}, evaluations=8)
    assert (found.cases, found.evaluations) == ((), 8)
    assert math.isnan(found.history[-1].value)


def test_the_record_says_all(tmp_path: Path) -> None:
    found = searched("torque_peak", evaluations=16)
    found.save(tmp_path)
    data = json.loads((tmp_path / "search.json").read_text())
    assert (data["measure"], data["worst"], data["seed"], data["evaluations"]) == (
        "torque_peak",
        "high",
        0,
        16,
    )
    assert data["cases"][0]["scenario"] == "worst_1.yaml"
    assert data["cases"][0]["values"] == found.cases[0].values
    assert data["cases"][0]["measures"]["torque_peak"] == found.cases[0].measures["torque_peak"]
    assert data["version"]
    path = tmp_path / "campaign.yaml"
    path.write_text(data["campaign"])
    assert load_campaign(path) == campaign(PUSHED, parameters=BORDER)


def test_a_search_removes_what_its_record_names_and_nothing_else(tmp_path: Path) -> None:
    found = searched("torque_peak", evaluations=16)
    three = replace(found, cases=found.cases[:1] * 3)
    mine = [tmp_path / name for name in ("worst_case.yaml", "worst_9.yaml", "../worst_1.yaml")]
    for path in mine:
        path.write_text("mine")
    assert len(three.save(tmp_path)) == 4
    record = tmp_path / "search.json"
    data = json.loads(record.read_text())
    data["cases"] += [{"scenario": "../worst_1.yaml"}, {"scenario": "worst_case.yaml"}]
    record.write_text(json.dumps(data))
    replace(found, cases=found.cases[:1]).save(tmp_path)
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"worst_1.yaml", "search.json", "worst_case.yaml", "worst_9.yaml"}
    assert all(path.read_text() == "mine" for path in mine)


@pytest.mark.parametrize(
    "content", ["", "{", "[]", '{"cases": 1}', '{"cases": [1]}', '{"cases": [{}]}', "[" * 10**5]
)
def test_a_record_that_is_none_is_somebodys_own(tmp_path: Path, content: str) -> None:
    mine = {"search.json": content, "worst_2.yaml": "mine"}
    for name, text in mine.items():
        (tmp_path / name).write_text(text)
    with pytest.raises(OutputError, match=r"search.json is none that a search wrote; try another folder"):
        replace(searched("torque_peak", evaluations=16), cases=()).save(tmp_path)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == mine


def test_a_scenario_that_no_search_wrote_is_not_written_over(tmp_path: Path) -> None:
    (tmp_path / "worst_1.yaml").symlink_to(tmp_path / "nowhere")
    with pytest.raises(OutputError, match=r"worst_1.yaml is none that a search wrote"):
        require_place(tmp_path, 1)
    found = searched("torque_peak", evaluations=16)
    with pytest.raises(OutputError, match=r"worst_1.yaml is none that a search wrote"):
        found.save(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["worst_1.yaml"]
    (tmp_path / "worst_1.yaml").unlink()
    found.save(tmp_path)
    assert require_place(tmp_path, 9) == {"search.json", *(f"worst_{i}.yaml" for i in (1, 2, 3))}


def test_a_robot_from_a_file_is_found_from_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scenario, problem = _with_robot_file("arms/mine.yaml")
    assert room.case_scenario(scenario, problem, 1).robot == str(tmp_path / "arms" / "mine.yaml")
    assert room.case_scenario(_of().scenario, problem, 1).robot == "planar2r"


def _of() -> Campaign:
    return campaign(PUSHED, parameters=BORDER)


def _with_robot_file(path: str) -> tuple[Scenario, Any]:
    return _of().scenario.model_copy(update={"robot": path}), resolve(_of().scenario)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"measure": "margn"}, NameUnknownError, "unknown metric.*try 'margin'"),
        ({"evaluations": 7}, ValueRangeError, "evaluations and keep"),
        ({"keep": 0}, ValueRangeError, "evaluations and keep"),
        ({"parameters": {}}, ValueRangeError, "has no parameters"),
        (
            {"parameters": {FORCE: {"distribution": "normal", "mean": 0, "deviation": 1, "low": -2}}},
            ValueRangeError,
            "parameter 'forces.1.force.1' has no worst value.*from -2 to inf.*try `low",
        ),
    ],
)
def test_wrong_use_is_refused(changes: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        searched(**changes)


def test_the_box_leads_to_the_ends_of_the_supports() -> None:
    parameters = {
        FORCE: {"distribution": "normal", "mean": 0, "deviation": 1, "low": -2, "high": 3},
        VARIANCE: BORDER[VARIANCE],
        "noise.hold": choice(0.01, 0.005),
        LOOP: choice("plain", "matched"),
    }
    box = Box.of(campaign(PUSHED, parameters=parameters))
    low, high = box.bounds.T
    assert (low.tolist(), high.tolist()) == ([-EDGE, -EDGE, 0, 0], [1 + EDGE, 1 + EDGE, 1, 1])
    assert box.row(box.inside(low)).tolist() == [-2, 1e-6, 0.01, 0]
    assert box.row(box.inside(high)).tolist() == [3, 1e-2, 0.005, 1]
    middle = box.row(box.inside(np.full(4, 0.5)))
    assert middle[:2] == pytest.approx([0.5, 1e-4], rel=1e-12)
    assert box.distance(np.zeros(4), np.array([0.3, 0.1, 0, 0])) == 0.3
    assert box.distance(np.zeros(4), np.array([0, 0, 0, 1])) == 1
