"""The model that is made of a robot: its mass matrix and bias torques are those of the robot, to round-off."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import casadi as cs
import mujoco
import numpy as np
import pytest
from hypothesis import given, settings

from cli.shell import Shell
from loops import robots
from passiflex.engines.mjcf import Options, possible
from passiflex.engines.mujoco_model import mujoco_model, require_recent
from passiflex.exports.model_file import export_model
from passiflex.extras import MissingExtraError
from passiflex.files import OutputError
from passiflex.robots.bodies import matrix
from passiflex.robots.catalogue import catalogue
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.simulation import resolve
from worlds import world

ROUND_OFF = 1e-10


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(monkeypatch, capsys)


def differences(robot: FlexibleJointRobot, numbers: dict[str, Any], seed: int = 0) -> float:
    """Return the largest difference between robot and model, of mass matrix, bias and pose, each by its own size."""
    rng, n = np.random.default_rng(seed), robot.n
    model = mujoco_model(robot, numbers, Options(1e-3))
    data = mujoco.MjData(model)
    q, dq, (p, m) = cs.SX.sym("q", n), cs.SX.sym("dq", n), robot.layout.symbols("p")
    arm = robot.arm
    truth = [arm.mass_matrix(q, m), arm.bias_torque(q, dq, m), *arm.pose(q, m)]
    ours = cs.Function("f", [q, dq, p], truth)
    worst = 0.0
    for _ in range(5):
        here, speed = rng.uniform(-2, 2, n), rng.uniform(-2, 2, n)
        data.qpos[n:], data.qvel[n:], data.qpos[:n] = here, speed, rng.uniform(-2, 2, n)
        mujoco.mj_forward(model, data)
        M = np.zeros((2 * n, 2 * n))
        mujoco.mj_fullM(model, data, M)
        want = np.zeros_like(M)
        mass, bias, position, rotation = (np.array(v) for v in ours(here, speed, robot.layout.pack(numbers)))
        want[:n, :n], want[n:, n:] = np.diag(numbers["motor_inertia"]), mass
        tip = data.site("tip")
        worst = max(
            worst,
            np.abs(M - want).max() / np.abs(want).max(),
            np.abs(data.qfrc_bias - data.qfrc_gravcomp - np.concatenate([np.zeros(n), bias[:, 0]])).max()
            / max(1.0, np.abs(bias).max()),
            np.abs(tip.xpos - position[:, 0]).max(),
            np.abs(tip.xmat.reshape(3, 3) - rotation).max(),
        )
    return worst


@pytest.mark.parametrize("name", catalogue())
def test_the_model_of_a_robot_is_the_robot(name: str) -> None:
    """Also of those with inertias that no body has, which MuJoCo's own compiler refuses."""
    robot = FlexibleJointRobot.load(name)
    assert differences(robot, robot.nominal()) < ROUND_OFF


@given(robot=robots(1, 4))
@settings(max_examples=25, deadline=None)
def test_so_is_that_of_any_robot(robot: FlexibleJointRobot) -> None:
    """Of turning and sliding joints, hung up anyhow."""
    assert differences(robot, robot.nominal((0.7, -0.4, -9.81))) < ROUND_OFF


def test_what_the_robot_carries_and_deviates_by_is_in_its_model() -> None:
    changed = world(
        payload={"mass": 1, "centre": [0.1, 0, 0.02]},
        tool={"mass": 0.5, "centre": [0, 0, 0.1], "position": [0, 0.1, 0.05], "rotation_vector": [0.3, 0, 1]},
        deviations={"joint_stiffness": -0.2},
    )
    problem = resolve(changed)
    robot = problem.law.robot
    numbers = robot.layout.unpack(problem.plant[: robot.layout.size])
    assert np.abs(numbers["link_mass"] - robot.nominal()["link_mass"]).max() > 1
    assert differences(robot, numbers) < ROUND_OFF


def test_an_impossible_inertia_is_cut_to_what_a_body_has() -> None:
    moments = np.linalg.eigvalsh(matrix(possible(np.array([1.0, 0.1, 0, 1.1, 0, 2.5]))))
    assert moments[2] == pytest.approx(moments[0] + moments[1])
    sound = np.array([1.0, 0.1, 0, 1.1, 0, 1.5])
    assert possible(sound) is sound


def test_a_model_is_written_for_a_robot_and_for_a_scenario(shell: Shell, tmp_path: Path) -> None:
    out = tmp_path / "model.xml"
    result = shell("export-model", "iiwa14_stuerz", "--out", out)
    assert result.status == 0
    assert "joint 'joint_4' has principal moments that no body has" in result.out.replace("\n", " ")
    model = mujoco.MjModel.from_xml_path(str(out))
    assert (model.nq, model.nu, model.ntendon) == (14, 13, 7)
    problem = resolve(world())
    assert export_model(problem, out) == []
    model = mujoco.MjModel.from_xml_path(str(out))
    np.testing.assert_allclose(model.key_qpos[0], np.concatenate([problem.theta, problem.q]))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(100):
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(data.qpos, model.key_qpos[0], atol=1e-9)  # without weight here: it stays


def test_the_file_of_a_model_ends_as_such(tmp_path: Path) -> None:
    with pytest.raises(
        OutputError, match=r"the file of a model; got .*m\.mjb; needs a name that ends in \.xml"
    ):
        export_model(FlexibleJointRobot.load("planar2r"), tmp_path / "m.mjb")


def test_an_old_mujoco_is_refused() -> None:
    with pytest.raises(
        MissingExtraError, match=r"needs a newer MuJoCo; got 3\.9\.0; needs 4\.0 or newer; try pip"
    ):
        require_recent("3.9.0")
