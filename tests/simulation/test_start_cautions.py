"""Joints that start within what only the hand touches."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from passiflex.errors import ScenarioError, ValueRangeError
from passiflex.robots.frames import world_frames
from passiflex.simulation import resolve
from passiflex.simulation.start_cautions import heavy_loads, swallowed_joints
from worlds import world


def told(*environment: dict[str, Any]) -> tuple[str, ...]:
    return swallowed_joints(resolve(world(environment=list(environment))))


def joints() -> np.ndarray:
    problem = resolve(world())
    return world_frames(problem.law.robot.arm.chain, problem.q[None]).position[0, 1:-1]


def test_a_sphere_about_a_joint_swallows_it() -> None:
    elbow = joints()[1]
    one = {"kind": "sphere", "name": "ball", "centre": elbow.tolist(), "radius": 0.05, "stiffness": 1e4}
    assert [line[:40] for line in told(one)] == ["joint 2 is within ball at the start: the"]


def test_a_surface_about_all_joints_swallows_the_robot() -> None:
    base, elbow = joints()
    both = {"kind": "sphere", "name": "ball", "centre": ((base + elbow) / 2).tolist(), "stiffness": 1e4}
    reach = float(np.linalg.norm(elbow - base)) / 2
    with pytest.raises(
        ValueRangeError, match="ball swallows the robot; got all 2 joints within it at the start"
    ):
        told(both | {"radius": reach + 2e-3})
    assert told(both | {"radius": reach - 2e-3}) == ()


@pytest.mark.parametrize(("height", "swallows"), [(0.0, False), (-0.01, False), (0.01, True)])
def test_a_base_stands_on_its_table(height: float, swallows: bool) -> None:
    base = joints()[0]
    table = {
        "kind": "plane",
        "point": (base + np.array([0, 0, height])).tolist(),
        "normal": [0, 0, 1],
        "stiffness": 1e4,
    }
    assert bool(told(table)) == swallows


def test_a_joint_beyond_its_end_stop_is_refused() -> None:
    stops = {"kind": "end_stops", "lower": [-1, -1], "upper": [0.4, 2]}
    with pytest.raises(
        ValueRangeError, match=r"joint 1 starts beyond its end stop; got 0.5 rad; needs -1 to 0.4 rad"
    ):
        told(stops)
    assert told(stops | {"upper": [0.5, 2]}) == ()


def test_end_stops_have_no_name_of_their_own() -> None:
    with pytest.raises(
        ScenarioError, match="a run calls them end_stops, as there is one of their kind; remove it"
    ):
        told({"kind": "end_stops", "name": "stops"})


def test_smooth_friction_uses_nothing_of_what_sticks() -> None:
    with pytest.raises(
        ScenarioError, match=r"motors.static_friction: friction that is smooth does not use it"
    ):
        world(motors={"coulomb_friction": 1, "static_friction": 2})


def test_a_load_that_no_motor_holds_is_said() -> None:
    """By hand: the weight at the end of two links, and their own, about the first joint, which bears 50 N m or less."""
    problem = resolve(world())
    robot = problem.law.robot
    hand = world_frames(robot.arm.chain, problem.q[None]).position[0, -1]
    lever = float(np.hypot(hand[0], hand[1]))
    limit = float(robot.torque_limit[0])

    def said(mass: float) -> tuple[str, ...]:
        load = {"kind": "load", "mass": mass, "from": 0.1, "to": 0.3}
        return heavy_loads(resolve(world(environment=[load])))

    assert said(0.01) == ()
    (line,) = said(3 * limit / (9.81 * lever))
    assert line.startswith("to hold load, ")
    assert "a real arm sinks" in line
    person = {"kind": "person", "mass": 500, "from": 0.1, "to": 0.3}
    assert heavy_loads(resolve(world(environment=[person]))) == ()
