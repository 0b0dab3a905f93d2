"""The same files give the same robot, which nobody can change; a changed file gives another."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import passiflex.robots
from passiflex.errors import RobotError
from passiflex.robots import FlexibleJointRobot
from passiflex.robots.catalogue import read_description

DATA = Path(passiflex.robots.__file__).parent / "data"


@pytest.fixture
def robot_file(tmp_path: Path) -> Path:
    """Return a copy of planar2r with its URDF beside it."""
    text = (DATA / "planar2r.yaml").read_text(encoding="utf-8")
    urdf = next(line.split(":")[1].strip() for line in text.splitlines() if line.startswith("urdf:"))
    (tmp_path / "arm.urdf").write_bytes((DATA / urdf).read_bytes())
    (tmp_path / "arm.yaml").write_text(text.replace(f"urdf: {urdf}", "urdf: arm.urdf"), encoding="utf-8")
    return tmp_path / "arm.yaml"


def arrays(name: str | Path) -> Iterator[np.ndarray]:
    robot = FlexibleJointRobot.load(name)
    yield from (v for v in vars(robot).values() if isinstance(v, np.ndarray))
    chain = robot.arm.chain
    yield from (v for part in (*chain.joints, *chain.bodies) for v in part if isinstance(v, np.ndarray))
    yield from (chain.tip_xyz, chain.tip_rotation)


@pytest.mark.parametrize("name", ["iiwa14", "planar2r"])
def test_a_robot_of_the_catalogue_is_one_object(name: str) -> None:
    robot = FlexibleJointRobot.load(name)
    assert FlexibleJointRobot.load(name) is robot
    assert FlexibleJointRobot.load(name).arm is robot.arm
    assert read_description(name) is read_description(name)
    assert FlexibleJointRobot.load("iiwa14_stuerz") is not robot


@pytest.mark.parametrize("name", ["iiwa14", "planar2r"])
def test_nothing_of_a_shared_robot_can_be_written_to(name: str) -> None:
    found = list(arrays(name))
    assert len(found) >= 6 + 2 + 2
    for array in found:
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


def test_nominal_numbers_are_the_callers_own() -> None:
    robot = FlexibleJointRobot.load("planar2r")
    numbers = robot.nominal()
    for value in numbers.values():
        value[...] = 0.0
    assert all(
        (robot.nominal()[name] > 0).all() for name in ("joint_stiffness", "motor_inertia", "link_mass")
    )


def test_a_file_that_changes_is_read_again(robot_file: Path) -> None:
    """By what it holds: the sizes are the same, and the times may be."""
    before = FlexibleJointRobot.load(robot_file)
    assert FlexibleJointRobot.load(str(robot_file)) is before
    text = robot_file.read_text(encoding="utf-8")
    other = text.replace("name: planar2r", "name: planar2x")
    assert len(other) == len(text)
    robot_file.write_text(other, encoding="utf-8")
    assert (before.name, FlexibleJointRobot.load(robot_file).name) == ("planar2r", "planar2x")
    robot_file.write_text(text, encoding="utf-8")
    assert FlexibleJointRobot.load(robot_file).name == "planar2r"


def test_a_urdf_that_changes_is_read_again(robot_file: Path) -> None:
    urdf = robot_file.with_name("arm.urdf")
    before = FlexibleJointRobot.load(robot_file)
    text = urdf.read_text(encoding="utf-8")
    mass = next(part for part in text.split() if part.startswith("value=")).rstrip("/>")
    urdf.write_text(text.replace(mass, 'value="7"', 1), encoding="utf-8")
    after = FlexibleJointRobot.load(robot_file)
    assert after.nominal()["link_mass"][0] == 7
    assert before.nominal()["link_mass"][0] != 7
    assert FlexibleJointRobot.load(robot_file) is after


def test_a_file_that_is_spoilt_or_gone_is_refused_though_it_was_known(robot_file: Path) -> None:
    FlexibleJointRobot.load(robot_file)
    urdf = robot_file.with_name("arm.urdf")
    urdf.rename(urdf.with_suffix(".away"))
    with pytest.raises(RobotError, match="entry urdf: no such file"):
        FlexibleJointRobot.load(robot_file)
    urdf.with_suffix(".away").rename(urdf)
    robot_file.write_text("- 1\n", encoding="utf-8")
    with pytest.raises(RobotError, match=r"is not a robot file; got .*not a mapping"):
        FlexibleJointRobot.load(robot_file)
    robot_file.unlink()
    with pytest.raises(RobotError, match=r"cannot be read; got .*No such file"):
        FlexibleJointRobot.load(robot_file)
