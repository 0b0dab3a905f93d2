"""Directions of a task without stiffness and damping: they are free, the null space has them, and all else holds."""

# ruff: noqa: E501 - one pinned message per line

from __future__ import annotations

from typing import Any

import casadi as cs
import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from passiflex.control.task import PoseTask
from passiflex.errors import ScenarioError, ValueRangeError
from passiflex.passivity import audit
from passiflex.robots.arm import EndEffectorPose, SerialArm
from passiflex.robots.chain import Body, Joint, SerialChain
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.simulation import Problem, parse_scenario, resolve, simulate_problem
from worlds import merged

LAW: dict[str, Any] = {
    "type": "impedance",
    "task": "pose",
    "gravity": "robot",
    "shaped_stiffness": {"ratio": 1},
    "shaped_inertia": {"ratio": 1},
    "stiffness": {"translation": 400, "rotation": [30, 30, 0]},
    "damping": {"translation": 60, "rotation": [5, 5, 0]},
    "null_space_damping": 5,
}
CONTROL = {"rate": 1000, "delay": 0, "external_torque": "none"}
IIWA = {
    "name": "free",
    "robot": "iiwa14",
    "posture": [0, 0.6, 0, -1.2, 0, 1, 0],
    "law": LAW,
    "control": CONTROL,
    "duration": 2.0,
    "output_interval": 0.01,
}
FULL = {"stiffness": {"rotation": 30}, "damping": {"rotation": 5}}


def five_joints() -> FlexibleJointRobot:
    """Return an arm that points its tool anywhere, but cannot turn about it: shoulder z y, elbow y, wrist z y."""
    axes = ([0, 0, 1], [0, 1, 0], [0, 1, 0], [0, 0, 1], [0, 1, 0])
    rises = (0.1, 0.1, 0.35, 0.3, 0.1)
    none, box = np.zeros(3), np.array([0.02, 0, 0, 0.02, 0, 0.02])
    joints = tuple(
        Joint(f"j{i}", "revolute", np.array([0, 0, h]), none, np.array(a, float), -3.0, 3.0, 2.0, 80.0)
        for i, (a, h) in enumerate(zip(axes, rises, strict=True))
    )
    bodies = tuple(Body(2.0, np.array([0, 0, 0.1]), box) for _ in axes)
    chain = SerialChain("five", joints, bodies, np.array([0, 0, 0.1]), np.eye(3))
    return FlexibleJointRobot(
        name="five",
        arm=SerialArm(chain),
        joint_stiffness=np.full(5, 6000.0),
        joint_damping=np.full(5, 4.0),
        motor_inertia=np.full(5, 0.4),
        torque_limit=np.full(5, 100.0),
        velocity_limit=np.full(5, 2.0),
        position_limit=np.tile([-3.0, 3.0], (5, 1)),
    )


def problem(own: FlexibleJointRobot | None = None, **changes: Any) -> Problem:
    return resolve(parse_scenario(yaml.safe_dump(merged(IIWA, changes))), own)


def mistakes(**law: Any) -> list[str]:
    with pytest.raises(ScenarioError) as error:
        problem(law=law)
    return [m.split(", ", 2)[-1] for m in error.value.mistakes]


def test_a_turn_about_the_free_axis_costs_nothing_from_wherever_the_hand_is() -> None:
    """U(R R_z) = U(R) for K_o = diag(k, k, 0): at random poses, with the gradient 0 about the hand's own axis."""
    task = PoseTask(free=(5,))
    p, R, R_d = cs.SX.sym("p", 3), cs.SX.sym("R", 3, 3), cs.SX.sym("d", 3, 3)
    K = np.diag([1.0, 2, 3, 40, 40, 0])
    at, goal = EndEffectorPose(p, R), EndEffectorPose(cs.SX.zeros(3), R_d)
    f = cs.Function("U", [p, R, R_d], [task.potential(at, goal, K), task.spring(at, goal, K).gradient])
    rng = np.random.default_rng(0)
    for _ in range(20):
        position = rng.normal(size=3)
        now, reference = (r.as_matrix() for r in Rotation.random(2, random_state=rng))
        spin = Rotation.from_rotvec([0, 0, rng.uniform(-3, 3)]).as_matrix()
        U, gradient = (np.array(v).squeeze() for v in f(position, now, reference))
        np.testing.assert_allclose(float(f(position, now @ spin, reference)[0]), U, rtol=1e-12)
        assert abs(gradient[3:] @ now[:, 2]) < 1e-11


def test_a_hand_that_is_turned_about_its_tool_keeps_its_place_and_its_direction() -> None:
    """1 N m about the tool for a second: it turns by far more than 1 N m over 30 N m/rad, and is not held.

    What it is held in, place and direction of the tool, it keeps but for the coupling on the way; a damping of the
    self-motion brings it to rest, 1 N m s/rad at a motor of 0.4 kg m² (k_ns M alone is small where the flange is
    light), and the run is passive.
    """
    home = problem().home.rotation
    push = {"from": 0.1, "to": 1.1, "moment": (1.0 * home[:, 2]).tolist()}
    run = simulate_problem(problem(forces=[push], actions={"posture_damping": 1}, duration=4.0))
    place = np.linalg.norm(run["position"][-1] - run["position"][0])
    turn = Rotation.from_matrix(run["rotation"][-1] @ home.T)
    assert np.degrees(turn.magnitude()) > 20
    assert run["rotation"][-1][:, 2] @ home[:, 2] > np.cos(1e-3)
    assert place < 1e-3
    assert np.abs(run["dq"][-1]).max() < 0.05
    assert audit(run).verdict == "passive"


def test_an_arm_of_five_joints_holds_five_directions() -> None:
    """A step it can follow: x_d − x → 0 in place and tool direction, with Λ of five directions and no regularisation."""
    law = {"regularisation": 0, "damping": {"translation": None, "rotation": None, "ratio": 0.7}}
    step = {"at": 0.1, "kind": "step", "by": [0.0, 0.0, -0.05]}
    posture = [0.3, 0.5, 1.0, 0.4, 0.8]
    p = problem(five_joints(), robot="planar2r", posture=posture, law=law, reference=[step], duration=4.0)
    assert p.law.task.held == (0, 1, 2, 3, 4)
    D = p.law.layout.unpack(p.gains)["damping"]
    assert not D[5].any()
    assert not D[:, 5].any()
    assert np.linalg.eigvalsh(D[:5, :5]).min() > 0
    run = simulate_problem(p)
    np.testing.assert_allclose(run["position"][-1] - run["position"][0], [0, 0, -0.05], rtol=0, atol=1e-4)
    assert run["rotation"][-1][:, 2] @ p.home.rotation[:, 2] > np.cos(1e-3)


def test_the_posture_spring_has_the_free_direction_for_its_own() -> None:
    """A spring on joint 7 alone, which turns the tool: it gets there, and nothing else moves for good."""
    goal = np.array(IIWA["posture"]) + 0.5 * np.eye(7)[6]
    actions = {"posture_stiffness": [0, 0, 0, 0, 0, 0, 20], "posture": goal.tolist()}
    run = simulate_problem(problem(actions=actions, duration=5.0))
    assert run["q"][-1, 6] == pytest.approx(goal[6], abs=5e-3)
    assert np.linalg.norm(run["position"][-1] - run["position"][0]) < 1e-3


def test_the_law_is_that_of_its_closed_loop_with_a_free_translation() -> None:
    """Free along x: a push along it meets no spring, one along y meets 400 N/m."""
    law = {"stiffness": {"translation": [0, 400, 400], "rotation": 30}}
    law["damping"] = {"translation": [0, 60, 60], "rotation": 5}
    runs = [
        simulate_problem(problem(law=law, forces=[{"from": 0.1, "to": 2, "force": force}]))
        for force in ([4, 0, 0], [0, 4, 0])
    ]
    along, across = (run["position"][-1] - run["position"][0] for run in runs)
    assert along[0] > 0.05
    assert across[1] == pytest.approx(4 / 400, rel=0.1)


def test_a_pose_on_five_joints_is_refused_with_what_to_do() -> None:
    with pytest.raises(ValueRangeError) as error:
        problem(five_joints(), posture=[0.3, 0.5, 1.0, 0.4, 0.8], law=FULL)
    assert str(error.value) == (
        "task 'pose' holds 6 directions, more than robot 'five' can move in; got 5 joints; "
        "needs at least as many joints as directions that are held; "
        "try rotation: [0, 30, 30] in stiffness and damping, so that the end effector is free to turn about its x, "
        "about which the arm can turn it least at this start; or task: position"
    )


DAMPS = "a free direction has neither stiffness nor damping: null_space_damping damps it"


@pytest.mark.parametrize(
    ("law", "line"),
    [
        ({"damping": {"rotation": 5}}, f"law.damping: needs zero in rotation z, as the law's stiffness; got zero in none; {DAMPS}"),
        ({"stiffness": {"rotation": 30}}, f"law.damping: needs more than 0 in every direction, as the law's stiffness; got zero in rotation z; {DAMPS}"),
        ({"stiffness": {"translation": 0, "rotation": 0}}, "law.stiffness: is zero in all directions; needs more than 0 in those that are not free"),
        ({"stiffness": {"rotation": [[30, 0, 1], [0, 30, 0], [0, 0, 0]]}}, "law.stiffness.rotation: the matrix is not symmetric: a free axis has zeros in its row and column"),
        ({"stiffness": {"rotation": [[1, 1, 0], [1, 1, 0], [0, 0, 0]]}}, "law.stiffness.rotation: the matrix is not positive definite; got smallest eigenvalue 0; needs > 0 in every direction"),
    ],
)  # fmt: skip
def test_what_is_not_free_in_both_is_refused(law: dict[str, Any], line: str) -> None:
    assert mistakes(**law) == [line]


def test_a_change_of_gains_and_a_fallback_keep_the_directions() -> None:
    """What the law leaves free stays free."""
    changes = {
        "gains": [{"at": 1, "duration": 0.5, "stiffness": {"translation": 300, "rotation": 30}}],
        "control": {"fallback": {"damping": {"translation": 60, "rotation": 5}}},
    }
    with pytest.raises(ScenarioError) as error:
        problem(**changes)
    text = "\n".join(error.value.mistakes)
    for place in ("control.fallback.damping", "gains[0].stiffness"):
        assert f"{place}: needs zero in rotation z, as the law's stiffness; got zero in none; {DAMPS}" in text


def test_the_rigid_law_holds_every_direction() -> None:
    law = {k: v for k, v in LAW.items() if not k.startswith("shaped")} | {"type": "rigid"}
    law["target_inertia"] = {"translation": 3, "rotation": 1}
    data = {k: v for k, v in IIWA.items() if k != "control"} | {"law": law}
    with pytest.raises(ScenarioError) as error:
        parse_scenario(yaml.safe_dump(data))
    (mistake,) = error.value.mistakes
    assert mistake.endswith(
        "law.stiffness: the rigid law gives every direction an inertia, and none can be free; "
        "got rotation z; try law type: impedance"
    )
