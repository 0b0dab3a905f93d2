"""A start by its pose: joint angles that have it, within their limits, or a clear refusal."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import passiflex as pf
from passiflex.control.motion import Pose
from passiflex.control.posture import posture
from passiflex.errors import PassiflexError, ScenarioError
from passiflex.problems.placed import posture_at
from passiflex.simulation import Problem, parse_scenario, resolve
from worlds import world

STILL: dict[str, Any] = {"control": None, "tank": None, "noise": None, "reference": [], "duration": 0.1}
THERE = {"position": [0.5, 0.1, "60 cm"], "rotation_vector": ["180 deg", 0, 0]}


def at(pose: dict[str, Any], robot: str = "iiwa14", **more: Any) -> Problem:
    data = world(**STILL).model_dump(by_alias=True, exclude_none=True)
    start = {"posture": {"pose": pose} | more.pop("near", {})}
    return resolve(parse_scenario(yaml.safe_dump(data | {"robot": robot} | start | more)))


@pytest.mark.parametrize("name", ["iiwa14", "ur5e", "so101"])
def test_a_pose_of_some_posture_is_found_again(name: str) -> None:
    robot, rng = pf.FlexibleJointRobot.load(name), np.random.default_rng(4)
    numbers, low, high = robot.nominal(), *np.clip(robot.position_limit, -np.pi, np.pi).T
    for _ in range(4):
        goal = posture(robot, rng.uniform(low, high), numbers).pose
        turned = robot.n >= 6
        q = posture_at(robot, numbers, goal, turned=turned)
        found = posture(robot, q, numbers).pose
        np.testing.assert_allclose(found.position, goal.position, atol=2e-9)
        if turned:
            np.testing.assert_allclose(found.rotation, goal.rotation, atol=5e-9)
        assert (q >= robot.position_limit[:, 0]).all()
        assert (q <= robot.position_limit[:, 1]).all()


def test_a_run_begins_there_and_says_with_which_angles() -> None:
    problem = at(THERE)
    np.testing.assert_allclose(problem.home.position, [0.5, 0.1, 0.6], atol=1e-8)
    np.testing.assert_allclose(problem.home.rotation, np.diag([1, -1, -1]), atol=1e-7)
    again = resolve(parse_scenario(problem.text))
    np.testing.assert_array_equal(again.q, problem.q)


def test_the_tool_is_where_the_pose_is() -> None:
    problem = at(THERE, tool={"position": [0, 0, 0.2]})
    np.testing.assert_allclose(problem.home.position, [0.5, 0.1, 0.6], atol=1e-8)
    assert np.abs(problem.q - at(THERE).q).max() > 0.05


def test_without_an_orientation_any_will_do_and_near_says_where_to_begin() -> None:
    q = np.array([0.3, 0.5, -0.2, -1.2, 0.1, 0.8, 0.4])
    robot = pf.FlexibleJointRobot.load("iiwa14")
    there = posture(robot, q, robot.nominal()).pose
    full = {"position": there.position.tolist()}
    full["rotation_vector"] = Rotation.from_matrix(there.rotation).as_rotvec().tolist()
    beside = (q + 0.05).tolist()
    np.testing.assert_allclose(at(full, near={"near": beside}).q, q, atol=0.3)
    free = at({"position": there.position.tolist()})
    np.testing.assert_allclose(free.home.position, there.position, atol=1e-8)
    assert np.abs(free.home.rotation - there.rotation).max() > 1e-3


def test_what_is_out_of_reach_is_refused_with_how_near_it_comes() -> None:
    robot = pf.FlexibleJointRobot.load("so101")
    goal = Pose(np.array([2.0, 0, 0]), np.eye(3))
    with pytest.raises(PassiflexError, match=r"no posture of 'so101' .*; got the nearest of 25 .* mm off"):
        posture_at(robot, robot.nominal(), goal, turned=False)


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ({"pose": {"positon": [1, 2, 3]}}, r"posture\.pose\.positon: unknown name; try 'position'"),
        ({"pose": {"position": [1, 2]}}, r"posture\.pose\.position: expected m, 3 numbers"),
        ({"pos": 1}, r"posture\.pos: unknown name; try 'pose'"),
        ([1, 2, "x"], r"posture: expected rad, a list of numbers"),
        (
            {"pose": {"position": [0.5, 0, 0.5]}, "near": [1, 2, 3]},
            "posture.near does not fit robot 'planar2r'",
        ),
    ],
)
def test_mistakes_are_said_at_their_place(written: Any, message: str) -> None:
    data = world(**STILL).model_dump(by_alias=True, exclude_none=True)
    with pytest.raises((ScenarioError, PassiflexError), match=message):
        resolve(parse_scenario(yaml.safe_dump(data | {"posture": written})))
