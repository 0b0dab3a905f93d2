"""A controller on a robot: the law of a simulation, whatever the robot says of itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import passiflex as pf
from onboard.arms import ElasticArm
from passiflex.diagrams import ideal_motion
from passiflex.errors import SimulationError, SizeError, UnstableLoopError, ValueRangeError
from passiflex.onboard import Controller, Sensed, Setpoint, WatchSettings
from passiflex.simulation import Run, Scenario, resolve
from worlds import world

START = [0.5, 0.8]
CONTROL: dict[str, Any] = {"external_torque": "none", "delay": 0.001}
LAW = {"shaped_inertia": {"ratio": 1.0}, "damping": {"translation": 100}}
ALL = ("q", "theta", "dq", "dtheta", "tau_a")
IDEAL = WatchSettings.off()


def planar(**changes: Any) -> Scenario:
    return world(**{"control": CONTROL, "law": LAW, **changes})


def heard(run: Run, i: int) -> Sensed:
    return Sensed(*(run[f"measured_{name}"][i] for name in ALL))


def asked(run: Run, i: int) -> Setpoint:
    return Setpoint(position=run["desired_position"][i], rotation=run["desired_rotation"][i])


NOISY = {
    "sensors": {
        "link_resolution": 1e-4,
        "motor_resolution": 1e-5,
        "velocity": "differences",
        "torque_bandwidth": 200,
    },
    "noise": {"torque_variance": 0.01, "hold": 0.001},
}


@pytest.mark.parametrize("world_of", [{}, NOISY], ids=["ideal", "noisy"])
@pytest.mark.parametrize("inner", ["plain", "matched"])
def test_it_commands_what_a_simulation_commands(world_of: dict[str, Any], inner: str) -> None:
    """Told what the simulated sensors said, one period after the other."""
    scenario = planar(control=CONTROL | {"inner_loop": inner}, **world_of)
    run = pf.simulate(scenario)
    controller = Controller(scenario, IDEAL, weight_in_readings=False)
    controller.start(heard(run, 0))
    for i in range(run.time.size - 1):
        torque = controller.step(heard(run, i), asked(run, i))
        np.testing.assert_allclose(torque, run["commanded_torque"][i], rtol=1e-9, atol=1e-9)
        assert controller.report.level == pytest.approx(run["tank_energy"][i], abs=1e-9)
    assert np.abs(run["commanded_torque"]).max() > 1


def moved(
    arm: ElasticArm, controller: Controller, says: tuple[str, ...], seconds: float, *wished: Setpoint
) -> None:
    """Let a controller move an arm, with one setpoint for all the time."""
    for _ in range(round(seconds / arm.period)):
        arm.move(controller.step(arm.said(*says), *wished))


@pytest.mark.parametrize(
    "says",
    [ALL, ("q", "dq", "tau_a"), ("theta", "dtheta", "tau_a"), ("q", "tau_a"), ("q", "theta"), ("theta",)],
    ids=lambda says: "+".join(says),
)
def test_an_arm_that_says_less_goes_where_it_is_told(says: tuple[str, ...]) -> None:
    """Its firmware carries the weight, which its readings contain; the law knows of none."""
    arm = ElasticArm("planar2r", START)
    controller = Controller(planar(sensors={"velocity_filter": 60}), WatchSettings(frozen_after=np.inf))
    controller.start(arm.said(*says))
    goal = arm.hand + np.array([0.02, 0, 0.03])
    moved(arm, controller, says, 3.5, Setpoint(position=goal))
    assert np.abs(arm.hand - goal).max() < 5e-4
    assert controller.report.why == ""


@pytest.mark.parametrize("taken_out", [True, False])
def test_the_weight_in_the_readings_is_taken_out_unless_that_was_done(taken_out: bool) -> None:
    """Of torque and motor position alike, by the weight that the arm's own equations have."""
    arm = ElasticArm("planar2r", START)
    controller = Controller(planar(), WatchSettings(frozen_after=np.inf), weight_in_readings=taken_out)
    controller.start(arm.said("q", "theta", "tau_a"))
    controller.step(arm.said("q", "theta", "tau_a"))
    told = controller.law.signals.unpack(controller._signals)
    weight, K = arm.weight(arm.x[:2]), arm.robot.joint_stiffness
    assert np.abs(weight).max() > 10
    np.testing.assert_allclose(told["measured_tau_a"], 0 if taken_out else weight, atol=1e-9)
    given = told["measured_theta"] - told["measured_q"]
    np.testing.assert_allclose(given, 0 if taken_out else weight / K, atol=1e-12)


def test_a_law_that_carries_the_weight_itself() -> None:
    arm = ElasticArm("planar2r", START, carries=False)
    controller = Controller(planar(law=LAW | {"gravity": "static"}), WatchSettings(frozen_after=np.inf))
    controller.start(arm.said("q", "theta"))
    before = arm.hand
    moved(arm, controller, ("q", "theta"), 1.0)
    assert np.abs(arm.hand - before).max() < 1e-6


def test_it_starts_where_the_robot_stands() -> None:
    """The law is laid out, and judged, for that posture."""
    arm = ElasticArm("planar2r", [0.2, 1.3])
    scenario = planar(law=LAW | {"damping": {"translation": None, "ratio": 0.7}})
    controller = Controller(scenario)
    controller.start(arm.said(*ALL))
    there = resolve(scenario.changed(posture=[0.2, 1.3]))
    np.testing.assert_allclose(controller.problem.gains, there.gains)
    first = controller.step(arm.said(*ALL))
    assert np.abs(first).max() < 1e-9
    assert controller.judgement.stable


def test_what_it_remembers_can_be_kept_and_given_back() -> None:
    arm = ElasticArm("planar2r", START)
    controller = Controller(planar(), IDEAL)
    controller.start(arm.said(*ALL))
    goal = Setpoint(position=arm.hand + np.array([0, 0, 0.02]))
    moved(arm, controller, ALL, 0.05, goal)
    kept, said = controller.state, arm.said(*ALL)
    first = controller.step(said, goal).copy()
    controller.step(said, goal)
    controller.state = kept
    np.testing.assert_array_equal(controller.step(said, goal), first)


def test_a_reset_takes_the_arm_where_it_is_with_the_tank_as_it_is() -> None:
    arm = ElasticArm("planar2r", START)
    controller = Controller(planar(), IDEAL)
    controller.start(arm.said(*ALL))
    moved(arm, controller, ALL, 0.1, Setpoint(position=arm.hand + np.array([0, 0, 0.03])))
    level = controller.report.level
    assert level < 2 - 1e-3
    arm.x[4:] = 0
    controller.reset_at(arm.said(*ALL))
    assert controller.report.level == pytest.approx(level)
    arm.move(controller.step(arm.said(*ALL)))
    assert np.abs(controller.torque).max() < 1
    controller.reset_at(arm.said(*ALL), level=1.5)
    assert controller.report.level == 1.5


def test_a_recorded_run_is_audited_as_a_simulated_one() -> None:
    arm = ElasticArm("planar2r", START)
    controller = Controller(planar(), IDEAL)
    controller.start(arm.said(*ALL))
    recorder = controller.record(0.5)
    goal = Setpoint(position=arm.hand + np.array([0.01, 0, 0.05]))
    moved(arm, controller, ALL, 0.5, goal)
    run = recorder.run()
    assert run.as_read
    assert ideal_motion(run) is None  # nobody recorded what would have been asked of it
    assert run.time.size == 500
    found = pf.audit(run)
    assert found.verdict == "passive"
    assert found.integration_error < 1e-3
    np.testing.assert_allclose(run["q"][-1], recorder.law.said.unpack(recorder._parts[0][499])["q"])
    level = run["tank_energy"][-1]
    assert level == controller.report.level
    # T + S + Σw of the port tank is what it was, and Σw is what passed by the readings
    assert run["measured_port_energy"][-1] == pytest.approx(run["joint_energy"][-1], abs=1e-9)


@pytest.mark.parametrize(
    ("sensed", "match"),
    [
        (Sensed(dq=[0, 0]), "needs q or theta"),
        (Sensed(q=[0, 0, 0]), r"q of the robot; got \(3,\); needs shape \(2,\)"),
        (Sensed(q=[0, np.nan]), "finite numbers"),
    ],
)
def test_readings_that_are_none_are_refused_at_the_start(sensed: Sensed, match: str) -> None:
    with pytest.raises((SizeError, ValueRangeError), match=match):
        Controller(planar()).start(sensed)


def test_what_cannot_run_on_a_robot_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="the true external torque, which nobody knows on a robot"):
        Controller(world())
    with pytest.raises(ValueRangeError, match="no control rate"):
        Controller(planar(control=None, tank=None))
    with pytest.raises(UnstableLoopError):
        Controller(planar(law={"shaped_inertia": {"ratio": 0.01}}))
    with pytest.raises(SimulationError, match="was not started"):
        Controller(planar()).step(Sensed(q=START))


def test_what_a_robot_does_not_say_is_judged() -> None:
    """Of links alone, the same gains grow; with a fifth of the damping, which the refusal asks for, they hold."""
    arm = ElasticArm("planar2r", START)
    controller = Controller(planar(), WatchSettings(frozen_after=np.inf))
    with pytest.raises(UnstableLoopError, match=r"remedy: D_x times 0\.2"):
        controller.start(arm.said("q"))
    with pytest.raises(SimulationError, match="was not started"):
        controller.step(arm.said("q"))
    for damping, grows in ((100, True), (15, False)):
        law = LAW | {"damping": {"translation": damping}}
        sure = {"allow_unstable": True, "fallback": {"damping": {"translation": 15}}}
        scenario = planar(law=law, control=CONTROL | sure)
        tame = Controller(scenario, WatchSettings(frozen_after=np.inf))
        arm = ElasticArm("planar2r", START)
        tame.start(arm.said("q"))
        assert tame.judgement.stable != grows
        moved(arm, tame, ("q",), 1.5, Setpoint(position=arm.hand + np.array([0, 0, 0.01])))
        assert (np.abs(tame.torque).max() > 20) == grows


@pytest.mark.parametrize("says", [["q", "tau_a"], ["theta"], ["theta", "tau_a"]])
def test_a_simulated_arm_that_says_less_is_controlled_as_a_real_one(says: list[str]) -> None:
    """A scenario says so in its sensors; the run and a controller of that robot agree."""
    scenario = planar(sensors={"says": says, "velocity_filter": 60})
    run = pf.simulate(scenario)
    controller = Controller(planar(sensors={"velocity_filter": 60}), IDEAL, weight_in_readings=False)
    there = {name: run[name] for name in says}

    def said(i: int) -> Sensed:
        return Sensed(**{name: values[i] for name, values in there.items()})

    controller.start(said(0))
    for i in range(run.time.size - 1):
        torque = controller.step(said(i), asked(run, i))
        np.testing.assert_allclose(torque, run["commanded_torque"][i], rtol=1e-8, atol=1e-8)
    assert pf.audit(run).verdict == "passive"
