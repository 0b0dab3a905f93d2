"""Loads, people, end stops, stiction and brakes: honest, as closed forms say, and in runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import passiflex as pf
from honest import require_honest
from passiflex.control.posture import posture
from passiflex.elements import AbstractElement, EndStops, Held, SpeedBrake, StickingFriction
from passiflex.errors import PassiflexError
from passiflex.passivity import audit, environment_balance
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.simulation import Run, parse_scenario
from worlds import world

ELEMENTS = (Held(), Held(anchored=True), EndStops(), StickingFriction(), SpeedBrake())


@pytest.mark.parametrize("element", ELEMENTS, ids=lambda e: type(e).__name__)
def test_it_gives_nothing_of_its_own(element: AbstractElement) -> None:
    require_honest(element)


def ran(**changes: Any) -> Run:
    run = pf.simulate(world(**{"reference": [], "duration": 3.0, "output_interval": 0.005} | changes))
    assert not run.failure
    assert audit(run).ledger_residual < 1e-5
    return run


LOAD: dict[str, Any] = {"kind": "load", "from": 0.5, "to": 2.0, "mass": 0.5}
FALLING = 9.81 * 0.5


def test_an_unknown_load_pulls_the_hand_down_by_its_weight_and_no_further() -> None:
    """By m g/K_x, and what the joints give way; set down, the hand goes back, and the lift is what the load keeps."""
    run = ran(environment=[LOAD], law={"stiffness": {"translation": 400}, "damping": {"translation": 60}})
    robot = FlexibleJointRobot.load("planar2r")
    before, during = run.time < 0.5, (run.time > 1.9) & (run.time < 2.0)
    J = posture(robot, run["q"][during][-1], robot.nominal()).jacobian[2]
    softness = 1 / 400 + J @ (J / robot.joint_stiffness)
    sunk = run["position"][before][-1, 2] - run["position"][during][-1, 2]
    assert sunk == pytest.approx(FALLING * softness, rel=0.01)
    assert run["wrench"][during][-1, 2] == pytest.approx(-FALLING, rel=1e-3)
    assert np.abs(run["position"][-1] - run["position"][0]).max() < 1e-3
    assert not run["wrench"][before].any()
    assert not run["wrench"][run.time > 2.01].any()
    assert environment_balance(run).worst < 1e-6
    assert audit(run).verdict == "passive"


def test_a_known_load_is_held_up_as_far_as_the_tank_pays() -> None:
    law = {"stiffness": {"translation": 400}, "damping": {"translation": 60}}
    known, unknown = (ran(environment=[LOAD | {"known": known}], law=law) for known in (True, False))
    during = (known.time > 1.9) & (known.time < 2.0)

    def sunk(run: Run) -> float:
        return float(run["position"][0, 2] - run["position"][during][-1, 2])

    assert abs(sunk(known)) < 0.05 * sunk(unknown)
    assert audit(known).verdict == "passive"


def test_lifting_a_load_is_work_that_the_books_know() -> None:
    """The load keeps m g h of the lift, whatever the way, until it is set down, and then too."""
    lift = [{"kind": "move", "at": 0.8, "by": [0, 0, 0.1], "duration": 0.5}]
    run = ran(environment=[LOAD], reference=lift, tank={"initial": 10})
    way, stored = run["load_way"][-1, 2], run["load_storage"][-1]
    assert way > 0.05
    assert stored == pytest.approx(FALLING * way, rel=1e-6)
    assert environment_balance(run).worst < 1e-6


PERSON: dict[str, Any] = {
    "kind": "person", "from": 0.5, "to": 2.5, "mass": 1, "arm_stiffness": 100, "arm_damping": 20,
    "pushes": [{"from": 0.5, "to": 2.5, "force": [0, 0, 10]}],
}  # fmt: skip


def test_a_person_pushes_against_two_springs() -> None:
    """In rest the push is shared by the person's own arm and the law's spring; let go, the hand goes back."""
    run = ran(
        environment=[PERSON],
        law={"stiffness": {"translation": 300}, "damping": {"translation": 60}},
        duration=4.0,
    )
    robot = FlexibleJointRobot.load("planar2r")
    during = (run.time > 2.4) & (run.time < 2.5)
    J = posture(robot, run["q"][during][-1], robot.nominal()).jacobian[2]
    spring = 1 / (1 / 300 + J @ (J / robot.joint_stiffness))
    pushed = run["position"][during][-1, 2] - run["position"][0, 2]
    assert pushed == pytest.approx(10 / (100 + spring), rel=0.02)
    assert run["person_supplied_energy"][-1] > 0.05
    assert np.abs(run["position"][-1] - run["position"][0]).max() < 2e-3
    assert environment_balance(run).worst < 1e-6


def test_a_joint_stops_at_its_end() -> None:
    """The law pulls on; the link rests where its stop gives way, and the torque through it is the law's."""
    stops = {"kind": "end_stops", "stiffness": 5000, "lower": [-3, -3], "upper": [0.53, 3]}
    run = ran(
        environment=[stops], reference=[{"kind": "step", "at": 0.1, "by": [-0.3, 0, 0]}], tank={"initial": 20}
    )
    free = ran(reference=[{"kind": "step", "at": 0.1, "by": [-0.3, 0, 0]}], tank={"initial": 20})
    assert free["q"][:, 0].max() > 0.56
    beyond = run["q"][:, 0].max() - 0.53
    assert 0 < beyond < 0.02
    rest = run["tau_a"][-1, 0]
    assert rest == pytest.approx(5000 * (run["q"][-1, 0] - 0.53), rel=1e-3)
    assert run["tau_e"][-1, 0] == pytest.approx(-rest, rel=1e-3)
    assert run["end_stops_energy"][-1] > 0
    assert environment_balance(run).worst < 1e-5
    assert audit(run).verdict == "passive"


STUCK = {"coulomb_friction": 4.0, "friction": "sticks"}
"""A 2 cm step asks at most 200 N/m · 2 cm · 0.6 m = 2.4 N m of a joint."""


def test_friction_that_sticks_leaves_the_error_that_smooth_friction_hides() -> None:
    small = {"reference": [{"kind": "step", "at": 0.1, "by": [0, 0, 0.02]}], "duration": 10}
    small |= {"law": {"shaped_inertia": {"ratio": 1}}}  # a smaller one lets the law overcome more, by B/B_e
    stuck = ran(motors=STUCK, **small)
    crept = ran(motors=STUCK | {"friction": "smooth"}, **small)
    left = np.linalg.norm(stuck["position"] - stuck["desired_position"], axis=1)
    assert left[-1] > 0.0195  # but for what the bristles give way
    assert abs(left[-1] - left[len(left) // 2]) < 1e-7  # a thousandth of what a bristle gives way
    assert np.linalg.norm(crept["position"][-1] - crept["desired_position"][-1]) < 0.8 * left[-1]


def test_friction_that_sticks_slides_as_coulomb_says_and_is_static_before() -> None:
    """A large step overcomes it; what is left is no more than it holds, more with static friction."""
    large = [{"kind": "step", "at": 0.1, "by": [0, 0, 0.1]}]
    slid = ran(motors={"coulomb_friction": 0.8, "friction": "sticks"}, reference=large, duration=6)
    assert slid["friction_energy"][-1] > 0.1
    robot = FlexibleJointRobot.load("planar2r")
    J = posture(robot, slid["q"][-1], robot.nominal()).jacobian[[0, 2]]
    error = (slid["position"] - slid["desired_position"])[-1, [0, 2]]
    assert 1e-4 < np.abs(J.T @ (200 * error)).max() < 0.8 * 1.02
    assert slid["friction_storage"].max() <= 2 * 0.8 * 1e-4 / 2 * 1.05
    static = ran(motors=STUCK | {"coulomb_friction": 2.0, "static_friction": 2}, reference=large[:0])
    assert not static["friction_energy"].max() > 1e-6


def test_a_motor_is_braked_beyond_its_speed() -> None:
    step = [{"kind": "step", "at": 0.1, "by": [0, 0, 0.2]}]
    free = ran(reference=step, tank={"initial": 20})
    braked = ran(reference=step, tank={"initial": 20}, motors={"speed_limit": 0.3, "torque_limit": 20})
    robot = FlexibleJointRobot.load("planar2r")
    assert np.abs(free["dtheta"]).max() > 0.8
    assert np.abs(braked["dtheta"]).max() < 0.3 + 20 * 0.01 / robot.motor_inertia.min()
    assert braked["speed_brake_energy"][-1] > 0.05
    assert audit(braked).verdict == "passive"


def test_limits_of_torque_and_rate_are_numbers_too() -> None:
    step = [{"kind": "step", "at": 0.1, "by": [0, 0, 0.2]}]
    run = ran(
        reference=step, tank={"initial": 20}, motors={"torque_limit": [9, 4], "torque_rate_limit": [200, 100]}
    )
    steps = np.abs(np.diff(run["tau_m"], axis=0)).max(axis=0) / 0.005
    assert (np.abs(run["tau_m"]).max(axis=0) <= [9, 4]).all()
    assert (steps <= np.array([200, 100]) * (1 + 1e-9)).all()
    assert np.abs(run["tau_m"][:, 1]).max() == 4


REFUSED = {
    "two": (
        [{"kind": "end_stops"}, {"kind": "end_stops"}],
        r"there is another entry of kind end_stops; there can be one",
    ),
    "joints": (
        [{"kind": "end_stops", "lower": [-1, -1, -1]}],
        "lower of end_stops does not fit robot 'planar2r'",
    ),
    "late": (
        [PERSON | {"to": 2.0}],
        r"within the time in which it holds the arm, 0.5 to 2 s; got 0.5 to 2.5 s",
    ),
    "massless": ([LOAD | {"mass": 0}], "mass"),
    "never": ([LOAD | {"from": 9, "to": 10}], "needs to be earlier than the end"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_makes_no_sense_is_refused(case: str) -> None:
    environment, said = REFUSED[case]
    with pytest.raises(PassiflexError, match=said):
        ran(environment=environment)


def test_a_scenario_with_them_is_written_whole() -> None:
    scenario = world(
        environment=[LOAD, PERSON, {"kind": "end_stops"}], motors=STUCK | {"speed_limit": "robot"}, duration=3
    )
    assert parse_scenario(scenario.to_yaml()) == scenario
