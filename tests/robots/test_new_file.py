"""A robot file for a URDF: it loads as it is written, and what it assumes covers what is published."""

from __future__ import annotations

import dataclasses
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
import yaml

from cli.shell import Shell
from passiflex.errors import NameUnknownError, RobotError
from passiflex.robots.catalogue import read_description
from passiflex.robots.drives import DRIVES, drive_of
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.robots.new_file import new_robot_file
from passiflex.robots.once_over import oddities, once_over
from passiflex.robots.xacro import expanded
from robots.test_chain_choice import tree, two_arms

PUBLISHED = {
    "LWR IV": ([320, 320, 176, 176, 110, 40, 40], None, [3.19, 3.05, 1.98, 2.05, 0.787, 0.391, 0.394]),
    "FR3": ([87] * 4 + [12] * 3, 7000.0, [0.605721456] * 2 + [0.462474144] * 2 + [0.205544064] * 3),
    "Gen3": ([39] * 4 + [9] * 3, [4000] * 4 + [3500] * 3, [0.3] * 4 + [0.18, 0.18, 0.2]),
}
"""Torque ratings, K and B of arms with torque sensors (sources: `docs/robots.md`; K of the LWR is not public)."""


@pytest.fixture(autouse=True)
def without_what_it_hangs_on(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out what takes seconds, but for the test that is of it."""
    if "hangs" not in request.node.name:
        monkeypatch.setattr("passiflex.cli.robot_commands._hang", lambda robot: None)


@pytest.mark.parametrize("name", PUBLISHED)
def test_what_is_published_lies_in_the_range_of_an_estimate(name: str) -> None:
    rating, K, B = PUBLISHED[name]
    found = DRIVES["sensed"].estimates(np.array(rating, dtype=float))
    for entry, value in (("joint_stiffness", K), ("motor_inertia", B)):
        if value is not None:
            share = value / found[entry].value
            assert (share >= found[entry].low).all(), (entry, share)
            assert (share <= found[entry].high).all(), (entry, share)


def test_the_class_of_drives_goes_by_the_strongest_joint_unless_it_is_said() -> None:
    assert drive_of(None, np.array([3.0, 1.0]))[0] == "servo"
    assert drive_of(None, np.array([87.0, 12.0]))[0] == "industrial"  # torque sensors are rare
    assert drive_of("direct", np.array([87.0]))[1] is DRIVES["direct"]
    with pytest.raises(NameUnknownError, match="unknown class of drives; got 'spring'; needs one of direct"):
        drive_of("spring", np.ones(1))


def test_a_new_file_loads_and_says_what_it_assumes(tmp_path: Path) -> None:
    (tmp_path / "my arm.urdf").write_text(tree(4))
    made = new_robot_file(tmp_path / "my arm.urdf")
    (tmp_path / "arm.yaml").write_text(made.text)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # all that had to be decided is written down
        warnings.filterwarnings("ignore", message=".*(joint_stiffness|motor_inertia)")
        robot = FlexibleJointRobot.load(tmp_path / "arm.yaml")
    assert robot.name == "my_arm"
    assert robot.n == 4
    for entry, estimate in made.estimates.items():
        np.testing.assert_allclose(getattr(robot, entry), estimate.value, rtol=5e-3)
        assert robot.ranges[entry] == pytest.approx((estimate.low, estimate.high), rel=2e-3)
        assert robot.sources[entry].startswith("assumed: ")
    np.testing.assert_array_equal(robot.torque_limit, [10] * 4)
    np.testing.assert_array_equal(robot.position_limit, [[-2, 2]] * 4)
    assert yaml.safe_load(made.text)["frozen"] == {"close": 0, "follow": 0}
    assert robot.sources["torque_limit"] == "the URDF"


def test_a_urdf_without_torque_limits_gets_those_that_its_weight_needs(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(tree(4).replace('effort="10"', 'effort="0"'))
    made = new_robot_file(tmp_path / "arm.urdf")
    (tmp_path / "arm.yaml").write_text(made.text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        robot = FlexibleJointRobot.load(tmp_path / "arm.yaml")
    np.testing.assert_allclose(robot.torque_limit, np.maximum(2 * once_over(robot).weight, 1), rtol=5e-3)
    assert "assumed" in robot.sources["torque_limit"]


@pytest.mark.parametrize(("low", "high"), [(0, 2), (1.1, 2), (0.5, 0.9), (0.5, float("inf"))])
def test_a_range_that_is_none_is_said(tmp_path: Path, low: float, high: float) -> None:
    (tmp_path / "arm.urdf").write_text(tree(4))
    text = new_robot_file(tmp_path / "arm.urdf").text
    (tmp_path / "arm.yaml").write_text(re.sub(r"range: \[.*", f"range: [{low}, {high}]", text, count=1))
    with pytest.raises(RobotError, match=r"joint_stiffness\.range|entry joint_stiffness"):
        FlexibleJointRobot.load(tmp_path / "arm.yaml")


def test_a_look_at_the_double_pendulum_is_what_its_formulas_say() -> None:
    robot = FlexibleJointRobot.load("planar2r")
    seen, chain = once_over(robot), robot.arm.chain
    (a, b), c = chain.bodies, np.linalg.norm(chain.joints[1].xyz)
    assert seen.mass == pytest.approx(a.mass + b.mass)
    stretched = 9.81 * (a.mass * np.linalg.norm(a.com) + b.mass * (c + np.linalg.norm(b.com)))
    assert stretched * 0.95 < seen.weight[0] <= stretched * (1 + 1e-9)
    assert seen.weight[1] == pytest.approx(9.81 * b.mass * np.linalg.norm(b.com), rel=0.02)
    assert seen.reach == pytest.approx(
        c + np.linalg.norm(chain.tip_xyz), rel=1e-9
    )  # zero is one of the postures
    assert seen.swing < seen.resonance
    assert list(oddities(robot, seen)) == []


def test_the_two_commands_write_a_file_and_look_it_over(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "arm.urdf").write_text(tree(4))
    monkeypatch.chdir(tmp_path)
    shell = Shell(monkeypatch, capsys)
    made = shell("robot", "new", "arm.urdf", "--drive", "direct")
    assert made.status == 0, made.err
    for said in (
        "from 'world' to 'tcp': 4 joints",
        "held still: joint 'close' at 0 m",
        "wrote arm.yaml",
        "swing at",
    ):
        assert said in made.out.replace("\n", " ")
    again = shell("robot", "new", "arm.urdf")
    assert again.status == 2
    assert "is there already" in again.err
    looked = shell("robot", "check", "arm.yaml")
    assert looked.status == 0
    assert "all that moves weighs" in looked.out
    (tmp_path / "two.urdf").write_text(two_arms())
    several = shell("robot", "new", "two.urdf")
    assert several.status == 2
    assert "try left_tool, right_tool" in several.err.replace("\n", " ")
    one = shell("robot", "new", "two.urdf", "--end-effector", "right_tool")
    assert one.status == 0, one.err


def test_a_template_of_xacro_is_expanded_where_its_package_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    pytest.importorskip("xacrodoc")
    head = '<robot name="tree" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    head += '<xacro:property name="most" value="${5 * 2}"/>'
    text = tree(4).replace('<robot name="tree">', head).replace('effort="10"', 'effort="${most}"')
    (tmp_path / "arm.urdf.xacro").write_text(text)
    monkeypatch.chdir(tmp_path)
    made = Shell(monkeypatch, capsys)("robot", "new", "arm.urdf.xacro")
    assert made.status == 0, made.err
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        np.testing.assert_array_equal(FlexibleJointRobot.load(tmp_path / "arm.yaml").torque_limit, [10] * 4)


def test_a_template_takes_arguments_and_meshes_of_other_packages_do_not_matter(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    pytest.importorskip("xacrodoc")
    head = (
        '<robot name="tree" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="most" default="3"/>'
    )
    mesh = '<visual><geometry><mesh filename="package://nowhere/a.stl"/></geometry></visual></link>'
    text = tree(4).replace('<robot name="tree">', head).replace('effort="10"', 'effort="$(arg most)"')
    assert "</link>" in text
    (tmp_path / "arm.urdf.xacro").write_text(text.replace("</link>", mesh, 1))
    (tmp_path / "must.urdf.xacro").write_text(text.replace('<xacro:arg name="most" default="3"/>', ""))
    monkeypatch.chdir(tmp_path)
    shell = Shell(monkeypatch, capsys)
    made = shell("robot", "new", "arm.urdf.xacro", "--xacro", "most:=7")
    assert made.status == 0, made.err
    other = shell("robot", "new", "arm.urdf.xacro", "--xacro", "most=8", "--out", "other.yaml")
    assert other.status == 0, other.err
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, most in (("arm", 7), ("other", 8)):  # each with an expansion of its own
            robot = FlexibleJointRobot.load(tmp_path / f"{name}.yaml")
            assert robot.name == name
            np.testing.assert_array_equal(robot.torque_limit, [most] * 4)
    without = shell("robot", "new", "must.urdf.xacro")
    assert without.status == 2
    assert "try --xacro NAME=VALUE; its arguments and their defaults: none" in " ".join(without.err.split())
    (tmp_path / "there.urdf").write_text("mine")
    there = shell("robot", "new", "arm.urdf.xacro", "--out", "there.yaml")
    assert "would be expanded into a file that is there; got there.urdf" in " ".join(there.err.split())
    assert (tmp_path / "there.urdf").read_text() == "mine"
    bad = shell("robot", "new", "must.urdf.xacro", "--xacro", "most")
    assert bad.status == 2
    assert "needs NAME=VALUE" in " ".join(bad.err.split())


def test_without_the_package_a_template_is_refused_with_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("passiflex.robots.xacro.find_spec", lambda name: None)
    with pytest.raises(RobotError, match=r"is a xacro template; needs plain URDF; try pip install"):
        expanded(tmp_path / "arm.xacro", tmp_path / "arm.urdf")


def test_an_expansion_that_is_no_robot_leaves_nothing_behind(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    pytest.importorskip("xacrodoc")
    head = '<robot name="m" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="kind" default="a"/>'
    (tmp_path / "macro.urdf.xacro").write_text(head + '<xacro:macro name="x"/><link name="base"/></robot>')
    (tmp_path / "arg.urdf.xacro").write_text(head + '<xacro:include filename="$(arg kind).xacro"/></robot>')
    monkeypatch.chdir(tmp_path)
    shell = Shell(monkeypatch, capsys)
    assert shell("robot", "new", "macro.urdf.xacro").status == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["arg.urdf.xacro", "macro.urdf.xacro"]
    assert "defaults: kind=a" in " ".join(shell("robot", "new", "arg.urdf.xacro").err.split())
    assert "there is no such file" in shell("robot", "new", "nowhere.urdf").err


def test_names_that_yaml_takes_for_something_else_are_quoted(tmp_path: Path) -> None:
    for name in ("850", "null", "on"):
        (tmp_path / f"{name}.urdf").write_text(tree(4))
        (tmp_path / f"{name}.yaml").write_text(new_robot_file(tmp_path / f"{name}.urdf").text)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            assert FlexibleJointRobot.load(tmp_path / f"{name}.yaml").name == name


def test_a_slide_has_numbers_by_what_it_carries(tmp_path: Path) -> None:
    """A force of 2000 N is no torque of 2000 N m: it swings at 20 Hz with what it carries."""
    text = tree(4).replace('type="revolute"', 'type="prismatic"', 1)
    (tmp_path / "arm.urdf").write_text(text)
    made = new_robot_file(tmp_path / "arm.urdf")
    chain = made.read.chain
    slide = next(i for i, joint in enumerate(chain.joints) if joint.kind == "prismatic")
    carried = sum(body.mass for body in chain.bodies[slide:])
    K, B = (made.estimates[entry].value[slide] for entry in ("joint_stiffness", "motor_inertia"))
    assert np.sqrt(K / carried) / (2 * np.pi) == pytest.approx(20)
    assert pytest.approx(carried) == B
    assert "slides: 20 Hz" in made.text.replace("\n    ", " ")


def test_placeholders_are_noticed(tmp_path: Path) -> None:
    """Torque limits that are all the same and far off; a speed of 0, which means none, as it stands in a URDF."""
    arm = FlexibleJointRobot.load("ur5e")
    seen = once_over(arm)
    alike = dataclasses.replace(arm, torque_limit=np.full(6, 11 * seen.weight.max()))
    assert "are they placeholders?" in " ".join(oddities(alike, seen))
    assert list(oddities(arm, seen)) == []
    text = arm.arm.chain.to_urdf()
    first = re.search(r'velocity="[^"]+"', text)
    assert first is not None
    (tmp_path / "arm.urdf").write_text(text.replace(first.group(), 'velocity="0"', 1))
    (tmp_path / "arm.yaml").write_text(new_robot_file(tmp_path / "arm.urdf").text)
    robot = FlexibleJointRobot.load(tmp_path / "arm.yaml")
    assert np.isinf(robot.velocity_limit[0])
    name = robot.arm.chain.joints[0].name
    assert f"joint {name!r} has a speed limit of 0 in its URDF" in " ".join(oddities(robot, once_over(robot)))


def test_a_new_file_tells_what_the_answer_hangs_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "arm.urdf").write_text(read_description("so101").chain.to_urdf())
    monkeypatch.chdir(tmp_path)
    made = Shell(monkeypatch, capsys)("robot", "new", "arm.urdf")
    assert made.status == 0, made.err
    said = re.findall(
        r"over its range (\w+) changes the lowest rate for 1000 N/m from (\S+) to (\S+) times", made.out
    )
    assert sorted(entry for entry, *_ in said) == ["joint_damping", "joint_stiffness", "motor_inertia"]
    spans = [float(high) / float(low) for _, low, high in said]
    assert spans == sorted(spans, reverse=True)
    assert spans[0] > 1.5
