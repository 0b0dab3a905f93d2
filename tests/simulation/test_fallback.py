"""Gains that rate and delay do not allow: refused with a remedy; or insisted on, and the law falls back for good."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
import yaml

from passiflex.control.posture import posture
from passiflex.errors import UnstableLoopError
from passiflex.passivity import audit
from passiflex.problems.altered import rewritten
from passiflex.simulation import Run, parse_scenario, resolve, simulate, simulate_problem, simulate_sampled
from passiflex.stability.causes import advise
from passiflex.stability.judgement import judge
from passiflex.studies import shipped_scenario
from passiflex.studies.sampled import VARIANTS
from worlds import books, merged, ran, world

PAPER = {"law": {"shaped_stiffness": {"ratio": 10}, "shaped_inertia": {"ratio": 0.01}}}
"""At 1 kHz a joint of this arm grows 24-fold in a period without delay, 5-fold with one period of it."""
INSISTENT: dict[str, Any] = merged(
    PAPER,
    {
        "control": {"external_torque": "measured", "delay": 1e-3, "allow_unstable": True},
        "motors": {"torque_limit": "robot"},
        "tank": {"initial": 0.4},
        "reference": [
            {"at": 0.1, "kind": "step", "by": [0, 0, 0.05]},
            {"at": 0.6, "kind": "step", "by": [-0.1, 0, -0.05]},
            {"at": 2.0, "kind": "circle", "plane": ["x", "z"], "radius": 0.05, "period": 1.0},
        ],
        "duration": 4.0,
    },
)
SOFT = {"shaped_inertia": {"ratio": 0.5}, "stiffness": {"translation": 50}, "damping": {"translation": 80}}
REAL = {
    "link_resolution": 1.7e-4,
    "motor_resolution": 1.7e-6,
    "velocity": "differences",
    "velocity_filter": 200,
}
ACTIVE: dict[str, dict[str, Any]] = {
    "paper": {},
    "other fallback": {"control": {"fallback": SOFT}},
    "growing slowly": {"law": {"shaped_stiffness": {"ratio": 3}, "shaped_inertia": {"ratio": 0.3}}},
    "noisy": {"noise": {"torque_variance": 0.2, "hold": 1e-3}, "sensors": REAL},
    "missed": {"control": {"missed": 0.2}},
    "weight": {"law": {"gravity": "static"}},
}
TRIP = 0.05
"""Half of the floor of the port tank [J]."""


@lru_cache
def active(name: str) -> Run:
    run = ran(**merged(INSISTENT, ACTIVE[name]))
    assert not run.failure
    return run


def latched_at(run: Run) -> int:
    """Return the first period of the fallback."""
    periods = np.flatnonzero(run["latched"])
    assert periods.size
    return int(periods[0])


@pytest.mark.parametrize("name", ACTIVE)
def test_an_overdrawn_law_falls_back_for_good(name: str) -> None:
    """Once T is below the trip level; from then on nothing is granted, the valve is shut, and T + S has no jump."""
    run = active(name)
    k = latched_at(run)
    assert (run["latched"][k:] == 1).all()
    assert run["tank_energy"][:k].min() >= TRIP
    assert run.time[k] > 0.1  # nothing happens before the reference does
    frozen = ("granted_energy", "reference_energy", "held_stiffness", "governed_position")
    for signal in frozen:
        np.testing.assert_array_equal(run[signal][k:], np.broadcast_to(run[signal][k], run[signal][k:].shape))
    assert run["valve"][k:].max() == 0
    both = run["tank_energy"] + run["law_storage"] + run["measured_port_energy"]
    assert np.abs(np.diff(books(run))).max() < 1e-12
    np.testing.assert_allclose(both[k:] + run["spilled_energy"][k:], both[0], rtol=0, atol=1e-12)
    spent = run["granted_energy"] + run["drawn_energy"] + run["spilled_energy"]
    level = 0.4 - spent + run["refilled_energy"] + run["rebased_energy"]
    np.testing.assert_allclose(run["tank_energy"], level, rtol=0, atol=1e-12)
    assert np.flatnonzero(np.diff(run["rebased_energy"])).tolist() == [k - 1]


@pytest.mark.parametrize("name", ACTIVE)
def test_the_fallback_holds_the_pose_that_it_read(name: str) -> None:
    """x̂_d = f(φ) of that period, with a slack spring; the arm comes to rest there, though the reference goes on."""
    run, scenario = active(name), world(**merged(INSISTENT, ACTIVE[name]))
    k, problem = latched_at(run), resolve(scenario)
    read = posture(problem.law.robot, run["phi"][k], problem.law.robot.layout.unpack(problem.model))
    np.testing.assert_allclose(run["governed_position"][k], read.pose.position, rtol=0, atol=1e-12)
    assert run["cartesian_spring_energy"][k] < 1e-20
    speed = np.linalg.norm(run["dq"], axis=1)
    assert speed[k] > 0.5
    assert speed[-200:].max() < 0.03 * speed[k]
    sag = np.linalg.norm(run["tau_a"][-1]) / 5000  # f(φ) is held, the end effector is at f(q)
    assert np.linalg.norm(run["position"][-1] - run["governed_position"][-1]) < 1.5e-3 + sag
    assert np.ptp(run["desired_position"][2000:], axis=0).max() > 0.09
    wanted = scenario.control.fallback.stiffness if scenario.control else None
    np.testing.assert_array_equal(run["held_stiffness"][-1], (50 if wanted else 200) * np.eye(3))
    assert (np.abs(run["tau_m"]) <= [100, 50]).all()


def test_with_torque_limits_the_port_was_never_overdrawn() -> None:
    """What T lost, the motors have: the true port energy stays within S_0 + T_0, by 0.18 J and more of 0.4 J."""
    for name in ACTIVE:
        result = audit(active(name))
        assert result.verdict == "passive"
        assert result.margin > 0.15


def test_without_torque_limits_the_overdraft_is_large_and_reported() -> None:
    """24-fold per period: kilojoules within a period or two of the trip, and the arm is caught all the same."""
    run = ran(**merged(INSISTENT, {"motors": None, "control": {"delay": 0.0}}))
    k = latched_at(run)
    assert not run.failure
    assert run["lowest_level"][-1] < -1000
    assert run["tank_energy"].min() == run["lowest_level"][-1]
    result = audit(run)
    assert result.verdict == "violated"
    assert result.time == pytest.approx(run.time[k], abs=3e-3)
    assert result.overdraft > 1000
    speed = np.linalg.norm(run["dq"], axis=1)
    assert speed[-200:].max() < 0.05 * speed.max()


def test_only_an_overdrawn_port_tank_falls_back() -> None:
    """Not one with enough in it for the limit cycle to go on, and none that keeps other books."""
    enough = ran(**merged(INSISTENT, {"tank": {"initial": 2}}))
    assert not enough["latched"].any()
    assert np.abs(np.diff(enough["tau_m"], axis=0))[-100:].max() > 50
    paper = ran(**merged(INSISTENT, {"tank": {"kind": "paper"}}))
    assert not paper["latched"].any()
    lower = ran(**merged(INSISTENT, {"tank": {"trip": 0.0}}))
    assert latched_at(lower) >= latched_at(active("paper"))


def test_the_papers_gains_on_the_iiwa_are_caught_within_its_limits() -> None:
    """Fig. 1's step at 0.3 s, from sensors as they are: latched within 0.2 s, 2 J too much, and the arm comes back."""
    scenario = VARIANTS["paper_port"].change(shipped_scenario("fig1_sampled"))
    step = scenario.reference[0].model_copy(update={"at": 0.3})
    run = simulate(scenario.model_copy(update={"reference": (step,), "forces": (), "duration": 6.0}))
    k = latched_at(run)
    assert 0.3 < run.time[k] < 0.5
    assert (run["latched"][k:] == 1).all()
    assert np.abs(np.diff(books(run))).max() < 1e-12
    assert (np.abs(run["tau_m"]) <= run["torque_limit"]).all()
    away = np.linalg.norm(run["position"] - run["governed_position"], axis=1)
    assert away[k:].max() < 0.2
    assert away[-1] < 0.4 * away[k:].max()
    assert 0 < audit(run).overdraft < 4


# The first line of defence


@pytest.mark.parametrize("delay", [0.0, 1e-3])
def test_an_unstable_loop_is_refused_with_gains_that_hold(delay: float) -> None:
    """Nothing is run; with what is said to write, the same scenario runs and never falls back."""
    changes = merged(INSISTENT, {"control": {"allow_unstable": None, "delay": delay}, "motors": None})
    problem = resolve(world(**changes))
    with pytest.raises(UnstableLoopError, match="the law of 'planar' does not hold"):
        simulate_problem(problem)
    first = advise(problem, judge(problem)).remedies[0]
    wanted = yaml.safe_load(rewritten(problem.text, first.entry))
    run = simulate(parse_scenario(yaml.safe_dump(wanted | {"tank": {"kind": "port", "initial": 2.0}})))
    assert not run.failure
    assert not run["latched"].any()
    assert audit(run).verdict == "passive"
    assert np.linalg.norm(run["dq"], axis=1).max() < 3


def test_the_refusal_comes_before_anything_is_run(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = resolve(world(**PAPER))
    monkeypatch.delattr(simulate_sampled, "start")
    with pytest.raises(UnstableLoopError):
        simulate_problem(problem)


def test_jitter_counts_as_delay() -> None:
    """A loop that is stable at its least delay and not at its largest is refused as well."""
    border = {"law": {"shaped_inertia": {"ratio": 0.07}}}
    assert not ran(**border).failure
    with pytest.raises(UnstableLoopError, match="with no delay and 1 period of jitter"):
        ran(**merged(border, {"control": {"jitter": 1e-3}}))


def test_insisting_changes_nothing_of_a_loop_that_is_stable() -> None:
    np.testing.assert_array_equal(ran(control={"allow_unstable": True})["q"], ran()["q"])
