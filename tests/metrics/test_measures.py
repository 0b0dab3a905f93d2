"""Measures: each against a computation of its own from the signals of the run, for runs of all kinds."""

from __future__ import annotations

import dataclasses
import itertools
import math
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import passiflex
from passiflex.metrics import measures as module
from passiflex.metrics.contact import contact_signals
from passiflex.metrics.measures import MEASURES, OF_CONTACT, SIGNALS, measures
from passiflex.metrics.msd import ideal_response
from passiflex.metrics.steps import step_window
from passiflex.problems.problem import Event, SampledProblem
from passiflex.simulation import Run, Scenario, resolve, simulate_problem
from passiflex.simulation.batch import digest_batch, simulate_in_lane
from worlds import merged, world

TEXTS = {"verdict", "decided_by", "failure"}
SAMPLED: dict[str, Any] = {
    "control": {"rate": 200, "delay": 5e-3},
    "law": {"shaped_inertia": {"ratio": 1}, "stiffness": {"translation": 60}, "damping": {"translation": 20}},
    "noise": {"torque_variance": 0.01, "hold": 5e-3},
    "reference": [{"at": 0.3, "kind": "step", "by": [0.01, 0, 0.04]}],
    "forces": [{"from": 1.8, "to": 2.0, "force": [1, 0, 2]}],
    "output_interval": 0.01,
    "duration": 2.5,
}
UNSTABLE = {"control": {"allow_unstable": True}, "law": {"shaped_inertia": {"ratio": 0.2}}}
WORLDS: dict[str, dict[str, Any]] = {
    "sampled": SAMPLED,
    "no step": merged(SAMPLED, {"reference": []}),
    "gains change": merged(
        SAMPLED, {"gains": [{"at": 2.0, "duration": 0.2, "stiffness": {"translation": 80}}]}
    ),
    "poor": merged(SAMPLED, {"tank": {"initial": 0.13}, "duration": 1.5, "forces": []}),
    "fallback": merged(SAMPLED, UNSTABLE),
    "diverged": merged(
        SAMPLED, merged(UNSTABLE, {"tank": {"kind": "paper"}, "law": {"shaped_stiffness": {"ratio": 10}}})
    ),
    "diverged in the step": merged(
        SAMPLED,
        {
            **merged(UNSTABLE, {"tank": {"kind": "paper"}, "law": {"shaped_stiffness": {"ratio": 10}}}),
            "reference": [{"at": 0.015, "kind": "step", "by": [0.01, 0, 0.04]}],
        },
    ),
    "rigid": {
        **SAMPLED,
        "robot": str(
            Path(__file__).parents[1] / "campaigns" / "turret.yaml"
        ),  # the rigid law needs three joints
        "posture": [0.2, 0.5, 0.8],
        "law": {
            "type": "rigid",
            "gravity": "model",
            "target_inertia": {"translation": 2},
            "shaped_stiffness": None,
            "shaped_inertia": None,
            "stiffness": {"translation": 60},
            "damping": {"translation": 40},
        },
        "tank": None,
        "noise": None,
        "forces": [],
        "duration": 4,
    },
    "wall": {
        **SAMPLED,
        "environment": [
            {
                "kind": "plane",
                "point": [0, 0, 0.02],
                "normal": [0, 0, -1],
                "relative": True,
                "stiffness": 2000,
            },
            {
                "kind": "plane",
                "name": "far",
                "point": [0, 0, 0.03],
                "normal": [0, 0, -1],
                "relative": True,
                "stiffness": 5e3,
            },
        ],
        "forces": [],
        "output_interval": 0.005,
    },
    "load": {**SAMPLED, "environment": [{"kind": "load", "from": 1.5, "to": 2, "mass": 0.1}], "forces": []},
    "continuous": {
        **SAMPLED,
        "control": None,
        "noise": None,
        "tank": {"kind": "paper", "initial": 2},
        "duration": 1.0,
        "forces": [],
    },
}


@lru_cache
def scenario(name: str) -> Scenario:
    return world(**WORLDS[name])


@lru_cache
def run_of(name: str) -> Run:
    problem = resolve(scenario(name))
    return simulate_in_lane(problem) if isinstance(problem, SampledProblem) else simulate_problem(problem)


@lru_cache
def found(name: str) -> dict[str, Any]:
    return measures(resolve(scenario(name)), step_window(scenario(name)), run_of(name))


def numbers(name: str) -> dict[str, float]:
    return {key: value for key, value in found(name).items() if key not in TEXTS}


@pytest.mark.parametrize("name", WORLDS)
def test_there_is_every_measure_and_no_other(name: str) -> None:
    touched = set(OF_CONTACT) if name == "wall" else set()
    assert set(found(name)) == set(MEASURES) - set(OF_CONTACT) | touched | TEXTS
    assert all(type(value) is float for value in numbers(name).values())
    assert all(type(found(name)[text]) is str for text in TEXTS)


def test_the_table_is_complete() -> None:
    for name, measure in MEASURES.items():
        assert measure.unit in {"1", "J", "s", "m", "rad", "N m", "N", "N s"}, name
        assert measure.worst in {"low", "high"}
        assert measure.meaning


@pytest.mark.parametrize("name", WORLDS)
def test_the_verdict_is_that_of_the_audit(name: str) -> None:
    audit, got = passiflex.audit(run_of(name)), found(name)
    assert (got["verdict"], got["decided_by"]) == (audit.verdict, audit.term)
    told = [
        got[key] for key in ("margin", "decided_at", "overdraft", "claimed_beyond_true", "integration_error")
    ]
    assert told == [audit.margin, audit.time, audit.overdraft, audit.books_error, audit.integration_error]


def test_the_verdicts_are_of_all_kinds() -> None:
    verdicts = {name: found(name)["verdict"] for name in WORLDS}
    assert verdicts["sampled"] == verdicts["continuous"] == "passive"
    assert verdicts["fallback"] == "violated"
    assert verdicts["diverged"] in ("violated", "inconclusive")


@pytest.mark.parametrize("name", WORLDS)
def test_energies_and_effort(name: str) -> None:
    run, got = run_of(name), found(name)
    for port in ("external", "motor", "joint", "reference"):
        assert got[f"{port}_energy"] == float(run.data[f"{port}_energy"][-1])
    torque, speed = np.abs(run["tau_m"]).max(axis=0), np.abs(run["dq"]).max(axis=0)
    ends = np.min([run["q"] - run["lower_position_limit"], run["upper_position_limit"] - run["q"]])
    assert got["torque_peak"] == torque.max()
    assert got["torque_share"] == pytest.approx((torque / run["torque_limit"]).max(), rel=1e-14)
    # Speeds and positions are extremes of all steps, of which the rows are some.
    assert got["velocity_share"] == pytest.approx(
        (run["highest_speed"] / run["velocity_limit"]).max(), rel=1e-14
    )
    assert (run["highest_speed"] >= speed).all()
    assert got["velocity_share"] == pytest.approx((speed / run["velocity_limit"]).max(), rel=0.05)
    assert got["joint_limit_margin"] <= ends
    assert got["joint_limit_margin"] == pytest.approx(ends, abs=1e-3)


@pytest.mark.parametrize("name", WORLDS)
def test_the_tank(name: str) -> None:
    run, got = run_of(name), found(name)
    if name == "rigid":
        assert math.isnan(got["tank_energy_end"])
        assert math.isnan(got["tank_energy_min"])
        return
    levels = run["tank_energy"].tolist()
    assert [got["tank_energy_end"], got["tank_energy_min"]] == [levels[-1], min(levels)]


@pytest.mark.parametrize("name", WORLDS)
def test_the_governor_and_the_fallback(name: str) -> None:
    run, got = run_of(name), found(name)
    if name == "continuous":
        assert math.isnan(got["governed_share"])
        assert math.isnan(got["fell_back_at"])
        return
    assert got["governed_share"] == float(run.data["governed_time"][-1]) / run.time[-1]
    latched = [t for t, on in zip(run.time, run["latched"], strict=True) if on]
    assert got["fell_back_at"] == latched[0] if latched else math.isnan(got["fell_back_at"])


def test_the_runs_show_what_they_are_named_after() -> None:
    """Else the tests above would compare nothing with nothing."""
    assert found("poor")["governed_share"] > 0.05
    assert 0 < found("fallback")["fell_back_at"] < 1
    assert 0.2 < found("rigid")["settling_time"] < 3
    assert not run_of("fallback").failure
    assert math.isnan(found("sampled")["fell_back_at"])
    assert "finite" in found("diverged")["failure"]


@pytest.mark.parametrize("name", WORLDS)
def test_tracking(name: str) -> None:
    run = run_of(name)
    away = run["position"] - run["desired_position"]
    expected = math.sqrt(sum(float(e @ e) for e in away) / len(away))
    assert found(name)["tracking_rms"] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", ["sampled", "poor", "fallback", "rigid", "continuous", "gains change"])
def test_the_response_to_the_step(name: str) -> None:
    """Written out row by row, with the ideal of the integrator."""
    run, got = run_of(name), found(name)
    begin = 0.3
    end = scenario(name).forces[0].start if scenario(name).forces else scenario(name).duration
    size = math.hypot(0.01, 0.04)
    direction = np.array([0.01, 0, 0.04]) / size
    along = (run["position"] - run["position"][0]) @ direction
    before = max(i for i, t in enumerate(run.time) if t < begin - 1e-9)
    assert got["offset_before_step"] == abs(along[before])
    inside = [i for i, t in enumerate(run.time) if begin <= t < end]
    shares = {i: (along[i] - along[before]) / size for i in inside}
    assert got["overshoot"] == pytest.approx(max(shares.values()) - 1, rel=1e-12)
    outside = [i for i, share in shares.items() if abs(share - 1) > 0.02]
    settled = outside[-1] != inside[-1]
    assert got["settling_time"] == (pytest.approx(run.time[outside[-1] + 1] - begin) if settled else math.inf)
    if name == "gains change":
        assert math.isnan(got["rms_to_msd"])
        return
    one = np.eye(3)
    K, D = 60, 40 if name == "rigid" else 20
    mass = (D / (2 * 0.7)) ** 2 / K
    events = resolve(scenario(name)).events
    ideal = ideal_response(mass * one, K * one, D * one, events, run.time).displacement @ direction
    away = [along[i] - along[before] - ideal[i] for i in inside]
    assert got["rms_to_msd"] == pytest.approx(math.sqrt(np.mean(np.square(away))) / size, rel=1e-7)
    assert got["rms_to_msd"] > 1e-3


def test_what_surfaces_felt() -> None:
    """Row by row, of two walls behind each other."""
    run, got = run_of("wall"), found("wall")
    felt = [[math.hypot(*force) for force in run[f"{name}_force"]] for name in ("plane", "far")]
    assert got["contact_force_peak"] == pytest.approx(max(map(max, felt)), rel=1e-12)
    assert got["contact_force_peak"] > 0.5
    middles = [(a + b) / 2 for force in felt for a, b in itertools.pairwise(force)]
    assert got["contact_impulse"] == pytest.approx(sum(middles) * 0.005, rel=1e-9)
    given = [-(a + b) for a, b in zip(run["plane_given_energy"], run["far_given_energy"], strict=True)]
    assert got["contact_energy"] == pytest.approx(max(given), rel=1e-12)
    ends = [a > 0.1 >= b for force in felt for a, b in itertools.pairwise(force)]
    assert got["contact_bounces"] == sum(ends)


@pytest.mark.parametrize("name", ["wall", "load"])
def test_a_hand_that_something_touches_is_held_against_no_ideal(name: str) -> None:
    """The ideal knows of neither; without them it is there."""
    assert math.isnan(found(name)["rms_to_msd"])
    assert math.isfinite(found(name)["overshoot"])
    assert math.isfinite(found("sampled")["rms_to_msd"])


def test_without_a_step_there_is_no_response() -> None:
    missing = {name for name, value in numbers("no step").items() if math.isnan(value)}
    assert missing == {"overshoot", "settling_time", "offset_before_step", "rms_to_msd", "fell_back_at"}


@pytest.mark.parametrize("name", ["diverged", "diverged in the step"])
def test_a_run_that_leaves_the_finite_numbers(name: str) -> None:
    """It has not settled and says nothing of the step; all else is what it was until then."""
    got, run = found(name), run_of(name)
    assert got["end_time"] == run.time[-1] < 2.5
    assert got["failure"] == run.failure
    assert got["settling_time"] == math.inf
    assert got["verdict"] != "passive"
    missing = {key for key, value in numbers(name).items() if math.isnan(value)}
    assert missing == {"overshoot", "offset_before_step", "rms_to_msd", "fell_back_at"}
    for key in (
        "margin",
        "torque_share",
        "velocity_share",
        "tracking_rms",
        "joint_limit_margin",
        "motor_energy",
    ):
        assert math.isfinite(got[key]), key


@pytest.mark.parametrize("name", [n for n in WORLDS if n != "continuous"])
def test_a_recording_in_lanes_has_the_measures_of_its_run(name: str) -> None:
    """To the last bit: `SIGNALS` and those of surfaces are all that is needed."""
    problem = resolve(scenario(name))
    signals = (*SIGNALS, *contact_signals(problem))
    (got,) = digest_batch([problem], signals, lambda _, r: measures(problem, step_window(scenario(name)), r))
    assert got.keys() == found(name).keys()
    for key, value in found(name).items():
        assert got[key] == value or (math.isnan(value) and math.isnan(got[key])), key


def ideals(*changed: dict[str, Any]) -> list[np.ndarray]:
    """Return the ideal responses of the sampled world with each of these changes, one after the other."""
    module._ideals.clear()
    problems = [resolve(world(**merged(SAMPLED, c))) for c in changed]
    return [
        module._ideal(problem, round(problem.duration / problem.output_interval) + 1) for problem in problems
    ]


DIFFERENT: dict[str, dict[str, Any]] = {
    "stiffness": {"law": {"stiffness": {"translation": 61}}},
    "one direction": {"law": {"stiffness": {"translation": [60, 60, 61]}}},
    "damping": {"law": {"damping": {"translation": 21}}},
    "time of the step": {"reference": [{"at": 0.31, "kind": "step", "by": [0.01, 0, 0.04]}]},
    "size of the step": {"reference": [{"at": 0.3, "kind": "step", "by": [0.01, 0, 0.05]}]},
    "a move": {"reference": [{"at": 0.3, "kind": "move", "by": [0.01, 0, 0.04], "duration": 0.5}]},
    "a longer move": {"reference": [{"at": 0.3, "kind": "move", "by": [0.01, 0, 0.04], "duration": 0.6}]},
    "no step": {"reference": []},
    "force": {"forces": [{"from": 1.8, "to": 2.0, "force": [1, 0, 3]}]},
    "time of the force": {"forces": [{"from": 1.8, "to": 2.1, "force": [1, 0, 2]}]},
    "interval": {"output_interval": 0.02},
    "interval of as many rows": {"output_interval": 0.02, "duration": 5},
    "duration": {"duration": 2.4},
}


@pytest.mark.parametrize("name", DIFFERENT)
def test_the_ideal_of_another_problem_is_another(name: str) -> None:
    """Whatever was asked before: each is that of a fresh start."""
    base, other, again = ideals({}, DIFFERENT[name], {})
    (alone,) = ideals(DIFFERENT[name])
    np.testing.assert_array_equal(other, alone)
    assert again is base
    assert other.shape != base.shape or np.abs(other - base).max() > 1e-6


def test_an_event_is_told_apart_by_what_it_changes() -> None:
    """A step and a force that does nothing, either first: the same times, motions and wrenches in the same order."""
    nothing = {"force": [0, 0, 0]}
    changes = [
        {
            "reference": [{"at": step, "kind": "step", "by": [0, 0, 0.05]}],
            "forces": [{"from": other, "to": 1.0, **nothing}],
        }
        for step, other in ((0.3, 0.5), (0.5, 0.3))
    ]
    first, second = ideals(*changes)
    rows = slice(31, 50)
    assert np.abs(first[rows]).max() > 1e-3
    np.testing.assert_array_equal(second[rows], 0)


@pytest.mark.parametrize(
    "change",
    [
        {"deviations": {"joint_stiffness": 0.2, "motor_inertia": -0.1}},
        {"noise": {"torque_variance": 0.3}},
        {"seed": 5},
        {"law": {"shaped_inertia": {"ratio": 1.2}}},
    ],
)
def test_samples_that_differ_in_the_robot_share_the_ideal(change: dict[str, Any]) -> None:
    base, other = ideals({}, change)
    assert other is base


def test_the_ideals_that_are_kept_are_bounded() -> None:
    problem = resolve(world(**SAMPLED))
    module._ideals.clear()
    for i in range(70):
        module._ideal(
            dataclasses.replace(problem, events=(problem.events[0], Event(0.1 + i / 1e3, None, np.ones(6)))),
            2,
        )
    assert len(module._ideals) <= 64
