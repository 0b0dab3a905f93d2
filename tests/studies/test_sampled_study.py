"""The sampled study: its files, the numbers of its summary, and (slow) what it shows of the tanks and the gains."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from passiflex.errors import UnstableLoopError
from passiflex.metrics.steps import displacement, step_window
from passiflex.origin import package_version, source_commit
from passiflex.passivity import audit
from passiflex.plotting.sampled import SampledPanel, draw_sampled
from passiflex.simulation import Run, Scenario, resolve, simulate, simulate_problem
from passiflex.studies import external_torque, sampled, shipped_scenario
from passiflex.studies.paper import ideals
from passiflex.studies.reproduce import reproduce
from passiflex.studies.summary import response_numbers

SHARED = {
    "motor_torque_peak", "lowest_true_level", "overdraft", "lowest_claimed_level", "highest_claimed_level",
    "claimed_beyond_true", "governed_share", "latched_at", "verdict", "decided_at", "integration_error", "failure",
}  # fmt: skip
STEP = {"overshoot", "settling_time", "peak_y", "offset_before_step", "rms_to_msd"}
DISTANCE = {"fig1": "rms_to_msd", "fig2": "reference_rms"}
CASES = [
    *(f"fig1_sampled_{key}" for key in sampled.VARIANTS if key != "recommended_drag"),
    *(f"fig2_sampled_{key}" for key in sampled.VARIANTS),
]
TORQUE = {"peak_y", "rms_to_known", "port_energy", "tank_energy_end", "margin", "verdict"}


def shortened(name: str) -> Scenario:
    """Return a shipped scenario with the same events, much earlier; in Fig. 2 the tank cannot pay for all of them."""
    scenario = shipped_scenario(name)
    if name.startswith("fig2"):
        step, circle = scenario.reference
        events = (step.model_copy(update={"at": 0.2}), circle.model_copy(update={"at": 0.5}))
        poor = scenario.tank.model_copy(update={"initial": 0.25}) if scenario.tank else None
        return scenario.model_copy(update={"duration": 1.2, "reference": events, "tank": poor})
    (step,), (push,) = scenario.reference, scenario.forces
    changes: dict[str, Any] = {
        "duration": 1.0,
        "reference": (step.model_copy(update={"at": 0.3}),),
        "forces": (push.model_copy(update={"start": 0.8, "end": 0.9}),),
    }
    return scenario.model_copy(update=changes)


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sampled, "shipped_scenario", shortened)
    monkeypatch.setattr(sampled, "SETTLED_CIRCLE", 0.3)
    monkeypatch.setattr(sampled, "DRAG", sampled.DRAG.model_copy(update={"viscous": 20.0}))
    few = {name: external_torque.CHOICES[name] for name in ("true", "measured_100_hz")}
    monkeypatch.setattr(external_torque, "CHOICES", few)


def refuse(constant: str) -> float:
    raise ValueError(f"{constant} is no JSON")


def summary(folder: Path) -> dict[str, Any]:
    """Return the summary, of JSON as it is defined: without NaN and Infinity."""
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"), parse_constant=refuse)


def check_complete(numbers: dict[str, Any], folder: Path) -> None:
    """Every case with every column, its run beside it, and the picture."""
    assert set(numbers) >= {"source", "external_torque", *CASES}
    for name in CASES:
        case, task = numbers[name], name.split("_")[0]
        distance = {DISTANCE[task]} if case["failure"] or task == "fig2" else STEP
        assert set(case) == SHARED | distance, name
        assert case["verdict"] in ("passive", "violated", "inconclusive")
        assert case["overdraft"] == max(0.0, -case["lowest_true_level"])
        run = Run.load(folder / f"{name}.nc") if not case["failure"] else None
        if run is not None:
            assert run.name == name
            assert np.diff(run.time) == pytest.approx(5e-3)
            assert audit(run).verdict == case["verdict"]
    png, pdf = ((folder / f"sampled{suffix}").read_bytes() for suffix in (".png", ".pdf"))
    assert png.startswith(b"\x89PNG\r\n")
    assert pdf.startswith(b"%PDF-")
    assert len(png) > 50_000
    assert len(pdf) > 20_000


@pytest.mark.usefixtures("short")
def test_figure_runs_and_summary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    drawn: list[list[SampledPanel]] = []

    def draw(tasks: list[list[SampledPanel]], conditions: str) -> Any:
        drawn.extend(tasks)
        return draw_sampled(tasks, conditions)

    monkeypatch.setattr(sampled, "draw_sampled", draw)
    written = reproduce(["sampled"], tmp_path / "new", said.append)
    paths = [path for group in written.values() for path in group]
    names = {"sampled.png", "sampled.pdf", "summary.json", "fig1_sampled.html", "fig2_sampled.html"} | {
        f"{name}.nc" for name in CASES
    }
    assert {p.name for p in paths} == names == {p.name for p in (tmp_path / "new").iterdir()}
    numbers = summary(tmp_path / "new")
    assert set(numbers) == {"source", "external_torque", *CASES}
    check_complete(numbers, tmp_path / "new")
    assert said[0] == "fig1_sampled: paper's gains and tank"
    assert said[-1] == "sampled: drawing"
    assert all("\n" not in text for text in said)

    for task in ("fig1", "fig2"):
        diverging = numbers[f"{task}_sampled_paper"]
        assert diverging["verdict"] == "violated"
        assert diverging["failure"].startswith("the state left the finite numbers")
        assert diverging[DISTANCE[task]] is None
        assert (tmp_path / "new" / f"{task}_sampled_paper.nc").is_file()
        recommended = numbers[f"{task}_sampled_recommended"]
        assert recommended["verdict"] == "passive"
        assert recommended["latched_at"] is None
        assert math.isfinite(recommended[DISTANCE[task]])
    assert numbers["fig2_sampled_recommended_drag"]["lowest_true_level"] < recommended["lowest_true_level"]
    for panels, task in zip(drawn, ("fig1", "fig2"), strict=True):
        assert [p.title for p in panels] == [v.title for v in sampled.VARIANTS.values()][: len(panels)]
        for panel, key in zip(panels, sampled.VARIANTS, strict=False):
            case = numbers[f"{task}_sampled_{key}"]
            assert panel.governed.mean() == pytest.approx(case["governed_share"], abs=0.01)
            assert panel.latched.any() == (case["latched_at"] is not None)
            assert panel.verdict.startswith(case["verdict"])
            assert panel.motion[0] == panel.goal[0] == 0
    assert drawn[1][-1].governed.any()
    assert set(numbers["external_torque"]) == {"true", "measured_100_hz"}
    for row in numbers["external_torque"].values():
        assert set(row) == TORQUE
        assert row["verdict"] == "passive"
    assert numbers["external_torque"]["true"]["rms_to_known"] == 0


@pytest.mark.usefixtures("short")
def test_other_figures_stay_in_the_summary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sampled, "VARIANTS", {"recommended": sampled.VARIANTS["recommended"]})
    monkeypatch.setattr(sampled, "PAGES", dict.fromkeys(sampled.TASKS, ("recommended",)))
    monkeypatch.setattr(sampled, "external_torque_table", lambda report: {})
    source = {"version": package_version(), "commit": source_commit()}
    (tmp_path / "summary.json").write_text(json.dumps({"source": source, "fig2": {"verdict": "passive"}}))
    reproduce(["sampled"], tmp_path)
    assert summary(tmp_path)["fig2"] == {"verdict": "passive"}
    assert summary(tmp_path)["fig1_sampled_recommended"]["verdict"] == "passive"


@pytest.mark.parametrize("key", ["paper", "paper_limited", "paper_port"])
def test_the_papers_variants_would_be_refused_without_insisting(key: str) -> None:
    """They run the paper's own gains, which nobody gets at this rate by accident."""
    scenario = sampled.VARIANTS[key].change(shipped_scenario("fig1_sampled"))
    printed = shipped_scenario("fig1").law
    assert scenario.law == printed
    assert scenario.control is not None
    assert scenario.control.allow_unstable
    timid = scenario.model_copy(
        update={"control": scenario.control.model_copy(update={"allow_unstable": False})}
    )
    with pytest.raises(UnstableLoopError, match="the law of 'fig1_sampled' does not hold"):
        simulate(timid)


def test_the_shipped_scenarios_are_stable_without_insisting() -> None:
    for task in sampled.TASKS:
        scenario = shipped_scenario(f"{task}_sampled")
        assert scenario.control is not None
        assert not scenario.control.allow_unstable
        assert not simulate(
            scenario.model_copy(update={"duration": 0.1, "reference": (), "forces": ()})
        ).failure


def distance_to_ideal(scenario: Scenario) -> float:
    """Return the rms distance to the ideal mass-spring-damper, as a share of the step."""
    problem = resolve(scenario)
    run = simulate_problem(problem)
    numbers = response_numbers(
        run.time, displacement(run["position"]), ideals(problem, run.time)["msd"], step_window(scenario)
    )
    return numbers["rms_to_msd"]


@pytest.mark.slow
def test_what_the_study_shows(tmp_path: Path) -> None:
    reproduce(["sampled"], tmp_path)
    numbers = summary(tmp_path)
    check_complete(numbers, tmp_path)
    limits = resolve(shipped_scenario("fig1_sampled")).law.robot.torque_limit

    for task in ("fig1", "fig2"):
        paper, limited, port, recommended = (
            numbers[f"{task}_sampled_{key}"]
            for key in ("paper", "paper_limited", "paper_port", "recommended")
        )
        # Without limits: active within 20 ms, before the step; the paper's tank is full of it.
        assert paper["verdict"] == "violated"
        assert paper["decided_at"] < 0.02
        assert paper["lowest_claimed_level"] >= 2
        # With limits: a limit cycle that gives, and a tank that claims it was given.
        assert limited["verdict"] == "violated"
        assert limited["claimed_beyond_true"] > 50
        assert limited["highest_claimed_level"] > 50
        assert limited["latched_at"] is None
        # The port tank sees it: the law falls back, and what was given by then is bounded and reported.
        assert port["latched_at"] < 1
        assert 0 <= port["overdraft"] < 20
        assert port["claimed_beyond_true"] < 0.2
        assert port["lowest_claimed_level"] < 0
        for case in (limited, port):
            assert case["motor_torque_peak"] == limits.max()
        # Gains that hold at this rate: passive, and nothing was held back.
        assert recommended["verdict"] == "passive"
        assert recommended["overdraft"] == 0
        assert recommended["latched_at"] is None
        assert recommended["governed_share"] == 0
        assert recommended["claimed_beyond_true"] < 0.3
        assert recommended["lowest_claimed_level"] > 1
        run = Run.load(tmp_path / f"{task}_sampled_recommended.nc")
        assert (np.abs(run["tau_m"]) <= limits).all()
        assert recommended["motor_torque_peak"] < limits.max() / 2

    drag = numbers["fig2_sampled_recommended_drag"]
    assert drag["verdict"] == "passive"
    assert drag["governed_share"] > 0.1
    assert drag["latched_at"] is None
    assert drag["reference_rms"] > numbers["fig2_sampled_recommended"]["reference_rms"]
    assert drag["lowest_true_level"] > 0

    # As good as in continuous time, but for the noise: the paper's law asks for 4000 N m there.
    quiet: dict[str, Any] = {"noise": None, "forces": (), "duration": 20.0}
    ours = distance_to_ideal(shipped_scenario("fig1_sampled").model_copy(update=quiet))
    continuous = distance_to_ideal(shipped_scenario("fig1").model_copy(update=quiet))
    assert ours <= 1.5 * continuous
    assert numbers["fig1_sampled_recommended"]["rms_to_msd"] < 2 * continuous

    torque = numbers["external_torque"]
    assert set(torque) == set(external_torque.CHOICES)
    assert torque["measured_100_hz"]["rms_to_known"] < 0.01
    assert torque["observer_100_hz"]["rms_to_known"] < torque["observer_20_hz"]["rms_to_known"] < 0.01
    assert torque["none"]["rms_to_known"] > 0.1
    assert torque["none"]["peak_y"] < torque["true"]["peak_y"] / 2
    assert {row["verdict"] for row in torque.values()} == {"passive"}
