"""Singular postures: to start in them, and to pass through them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml

from passiflex.control.posture import held_jacobian, lost_directions, posture
from passiflex.passivity import audit
from passiflex.robots import FlexibleJointRobot
from passiflex.scenarios.law_settings import EXACT, KIND
from passiflex.simulation import parse_scenario, resolve, simulate
from passiflex.simulation.cautions import cautions
from passiflex.studies import shipped_scenario
from worlds import merged

BENT = [0, 0.6, 0, -1.2, 0, 1.0, 0]
SCENARIO: dict[str, Any] = {
    "name": "singular",
    "robot": "iiwa14",
    "posture": BENT,
    "law": {
        "type": "impedance",
        "task": "pose",
        "shaped_stiffness": {"ratio": 1},
        "shaped_inertia": {"ratio": 1},
        "stiffness": {"translation": 300, "rotation": 30},
        "damping": {"translation": 150, "rotation": 15},
        "null_space_damping": 5,
    },
    "control": {"rate": 500, "delay": "2 ms", "external_torque": "none", "allow_unstable": True},
    "sensors": {"velocity": "differences"},
    "motors": {"torque_limit": "robot"},
    "tank": {"kind": "port", "initial": 2.0},
    "duration": 3,
}
STRAIGHT = {
    "iiwa14": [[0.0] * 7, [0.3, 0.6, 0, 0, 0, 1.0, 0]],
    "ur10": [[0, -1.712, 1.712, 0, 0, 0], [0, -1.0, 0, 0.3, 0.8, 0]],
}
"""Stretched arms and stretched wrists."""


def scenario(**changes: Any) -> Any:
    return parse_scenario(yaml.safe_dump(merged(SCENARIO, changes)))


def test_the_default_is_a_share_of_the_mass_that_moves_tool_included() -> None:
    masses = FlexibleJointRobot.load("iiwa14").nominal()["link_mass"].sum()
    for tool in (None, {"mass": 3.0}):
        settled = parse_scenario(resolve(scenario(tool=tool)).text).law.regularisation
        assert settled == pytest.approx(KIND / (masses + (3.0 if tool else 0.0)))


def test_the_rigid_law_stays_exact() -> None:
    law = {"type": "rigid", "task": "pose", "target_inertia": {"damping_ratio": 0.7}}
    rigid = {k: v for k, v in SCENARIO.items() if k != "tank"}
    rigid |= {"law": law | {name: SCENARIO["law"][name] for name in ("stiffness", "damping")}}
    assert parse_scenario(resolve(parse_scenario(yaml.safe_dump(rigid))).text).law.regularisation == EXACT


def test_an_elbow_that_passes_straight_is_no_blow() -> None:
    """Fig. 2 at 9.26 s: with the paper's Λ the null space turns within a millisecond."""
    paper = shipped_scenario("fig2").model_copy(update={"duration": 9.6, "output_interval": 1e-3})
    kind = paper.model_copy(update={"law": paper.law.model_copy(update={"regularisation": None})})
    jumps = []
    for one in (paper, kind):
        run = simulate(one)
        assert np.abs(run["q"][run.time > 7, 3]).min() < 1e-3  # it does pass
        torque = run["tau_m"][run.time > 7.2]
        jumps.append(np.abs(np.diff(torque, axis=0)).max())
    assert jumps[0] > 100  # N m from one row to the next
    assert jumps[1] < 1


@pytest.mark.parametrize(("robot", "q"), [(name, q) for name, qs in STRAIGHT.items() for q in qs])
def test_a_singular_start_is_said_and_survived(robot: str, q: list[float]) -> None:
    arm = FlexibleJointRobot.load(robot)
    low, high = arm.position_limit.T
    events = [{"at": 0.1, "kind": "step", "by": [0.2, -0.2, -0.2], "turn": [0.5, 0.5, 0.5]}]
    start = np.clip(q, low, high).tolist()
    one = scenario(robot=robot, posture=start, reference=events)
    lost = lost_directions(resolve(one).law.task, posture(arm, np.array(start), arm.nominal()))
    assert lost.shape[1] >= 1
    assert len([line for line in cautions(resolve(one)) if "cannot" in line]) == 1
    run = simulate(one)
    assert not run.failure
    assert audit(run).verdict == "passive"
    assert (np.abs(run["tau_m"]) <= arm.torque_limit * (1 + 1e-12)).all()
    assert (np.abs(run["dq"]) <= arm.velocity_limit).all()


def test_lost_directions_are_those_in_which_no_joint_moves_the_end_effector() -> None:
    p = resolve(scenario(posture=[0.0] * 7))
    at = posture(p.law.robot, p.q, p.law.robot.nominal())
    lost = lost_directions(p.law.task, at)
    assert lost.shape[1] == 6 - np.linalg.matrix_rank(at.jacobian)
    np.testing.assert_allclose(lost.T @ at.jacobian, 0, atol=1e-12)
    assert cautions(p)[-1].startswith("the arm starts where its end effector cannot ")
    for wish in ("turn about [1 0 0]", "move along [0 0 1]", "move along [0 1 0]"):
        assert wish in cautions(p)[-1]


def test_a_bent_arm_is_no_matter() -> None:
    p = resolve(scenario())
    assert not [line for line in cautions(p) if "cannot" in line]
    assert (
        np.linalg.matrix_rank(held_jacobian(p.law.task, posture(p.law.robot, p.q, p.law.robot.nominal())))
        == 6
    )


def test_a_ur10_whose_wrist_is_stretched_goes_where_it_is_sent() -> None:
    """Field notes: with operational-space control its error was 1.55 m at 34.7 rad/s and 1.3e4 N m."""
    arm = FlexibleJointRobot.load("ur10")
    goal = [0.6, 0.15, 0.3]
    start = STRAIGHT["ur10"][0]
    by = np.array(goal) - posture(arm, np.array(start), arm.nominal()).pose.position
    step = {"at": 0, "kind": "step", "by": by.tolist(), "turn": [-2.0, 0.5, -0.5]}
    run = simulate(scenario(robot="ur10", posture=start, reference=[step], duration=6))
    assert np.linalg.norm(run["position"][-1] - goal) < 0.02
    assert (np.abs(run["dq"]) <= arm.velocity_limit).all()
    assert (np.abs(run["tau_m"]) <= arm.torque_limit).all()
    assert audit(run).verdict == "passive"
