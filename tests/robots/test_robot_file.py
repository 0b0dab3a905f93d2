"""A robot file is read as a scenario is: by the same rules, with the same units, and every mistake at its place."""

# ruff: noqa: E501 - one pinned message per line

from __future__ import annotations

import os
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings

from arms import serial_chains
from passiflex.errors import PassiflexWarning, RobotError
from passiflex.robots import FlexibleJointRobot, SerialChain
from passiflex.robots.catalogue import catalogue, read_description
from passiflex.robots.doubts import doubts, moved_inertia
from passiflex.simulation import parse_scenario, simulate

BODY = '<inertial><origin xyz="0.2 0 0"/><mass value="3"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
URDF = f"""<robot name="two"><link name="base"/>
<link name="upper">{BODY}</link><link name="lower">{BODY}</link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" velocity="3" effort="80"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" velocity="0" effort="0"/></joint>
<link name="hand"/><joint name="grip" type="fixed"><origin xyz="0.4 0 0"/><parent link="lower"/><child link="hand"/></joint></robot>
"""
ROBOT = """\
name: two
description: two joints
urdf: two.urdf
end_effector: hand
source: assumed
joint_stiffness: {value: 8000, unit: N m/rad, source: assumed}
joint_damping: {value: 4, unit: N m s/rad, source: assumed}
motor_inertia: {value: [0.6, 0.3], unit: kg m^2, source: assumed}
torque_limit: {value: 80, unit: N m, source: assumed}
velocity_limit: {value: 3, unit: rad/s, source: assumed}
position_limit: {value: 2, unit: rad, source: assumed}
"""
K = "{value: 8000, unit: N m/rad, source: assumed}"


@pytest.fixture
def write(tmp_path: Path):
    (tmp_path / "two.urdf").write_text(URDF, encoding="utf-8")

    def _write(old: str = "", new: str = "", encoding: str = "utf-8") -> Path:
        assert not old or ROBOT.count(old) == 1, old
        path = tmp_path / "two.yaml"
        path.write_text(ROBOT.replace(old, new), encoding=encoding)
        return path

    return _write


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("name: two", "name: two\nname: three", "line 2, column 1, name: twice in one mapping, first in line 1; remove one"),
        (K, K + "\njoint_stiffness: {value: 80, unit: N m/rad, source: a}", "line 7, column 1, joint_stiffness: twice in one mapping, first in line 6; remove one"),
        (K, K.replace("8000", "8000, value: 80"), "line 6, column 32, joint_stiffness.value: twice in one mapping, first in line 6; remove one"),
        ("joint_stiffness:", "joint_stifness:", "line 6, column 1, joint_stifness: unknown name; try 'joint_stiffness'"),
        (K, K.replace("unit", "units"), "line 6, column 32, joint_stiffness.units: unknown name; try 'unit'"),
        (K, "8000", "line 6, column 18, joint_stiffness: needs a unit and a source; got 8000; try {value: 8000, unit: N m/rad, source: ...}"),
        (K, "[8000, 1000]", "line 6, column 18, joint_stiffness: needs a unit and a source; got \\[8000, 1000\\]"),
        (K, "8000 N m/rad", "line 6, column 18, joint_stiffness: needs a source; got '8000 N m/rad'; try {value: 8000 N m/rad, source: ...}"),
        (K, "[8000 N m/rad, 5]", "line 6, column 18, joint_stiffness: needs a source; got \\['8000 N m/rad', 5\\]; try {value: \\['8000 N m/rad', 5\\], source: ...}"),
        (K, "{value: 0x10, unit: N m/rad, source: a}", "expected N m/rad, one number; got {'value': '0x10', 'unit': 'N m/rad'} \\(not a number\\)"),
        (K, "{value: 1_000, unit: N m/rad, source: a}", "got {'value': '1_000', 'unit': 'N m/rad'} \\(not a number\\)"),
        (K, "{value: 1:30, unit: N m/rad, source: a}", "got {'value': '1:30', 'unit': 'N m/rad'} \\(not a number\\)"),
        (K, "{value: 8 N m/rad, unit: N m/rad, source: a}", "\\(two units\\)"),
        (K, "{value: 8000, unit: 5, source: a}", "joint_stiffness.unit: expected text, or one for each joint; got 5"),
        (K, "{value: 8000, unit: [N m/rad, 5], source: a}", "joint_stiffness.unit: expected text, or one for each joint; got \\['N m/rad', 5\\]"),
        ("urdf: two.urdf", 'urdf: ""', "line 3, column 7, urdf: expected text; got ''"),
        (K, "{value: 8000, source: a}", "line 6, column 26, joint_stiffness.value: needs a unit; got 8000; try unit: N m/rad"),
        (K, "{value: [8000, 1 kN m/rad], source: a}", "line 6, column 26, joint_stiffness.value: needs a unit; got \\[8000, '1 kN m/rad'\\]"),
        ("name: two", "name: 2001-99-99\nnmae: 3", "line 2, column 1, nmae: unknown name; try 'name'"),
        ("source: assumed\njoint", "source: !!str assumed\nsource: x\njoint", "line 6, column 1, source: twice"),
        ("value: 4", "value: 0x10", "line 7, column 24: entry joint_damping.value is wrong at joint 1: .*got .*'0x10'"),
        ("value: 4", "value: yes", "line 7, column 24: entry joint_damping.value is wrong at joint 1"),
        ("value: 4", "value: true", "line 7, column 24: entry joint_damping.value is wrong at joint 1: .*not a number"),
        ("value: 4", "value: 1:30", "line 7, column 24: entry joint_damping.value is wrong at joint 1"),
        ("value: 4", "value: 2001-01-01", "line 7, column 24: entry joint_damping.value is wrong at joint 1"),
        ("value: 4", "value: '3 N m s/rad'", "line 7, column 24: entry joint_damping.value is wrong at joint 1: .*two units"),
        ("value: 4", "value: [[4, 4], [4]]", "line 7, column 24: entry joint_damping.value has the wrong size"),
        ("N m s/rad", "N s/m", "line 7, column 33: entry joint_damping.unit does not fit revolute joint 1; got 'N s/m'; needs one of N m s/rad, N m s/deg"),
        ("rad/s", "Hz", "line 10, column 34: entry velocity_limit.unit does not fit revolute joint 1; got 'Hz'"),
        ("urdf: two.urdf", 'urdf: "two\\0.urdf"', "line 3, column 7: entry urdf: no such file"),
        ("urdf: two.urdf", "urdf: ''", "line 3, column 7, urdf: expected text; got"),
    ],
)  # fmt: skip
def test_a_mistake_is_at_its_line_and_column(write, old: str, new: str, message: str) -> None:
    with pytest.raises(RobotError, match=message):
        read_description(write(old, new))


def test_all_mistakes_are_said_at_once(write) -> None:
    path = write(K, "8000\ncolour: red\nname: x")
    with pytest.raises(
        RobotError, match=r"6, column 18, .*; line 7, column 1, colour: .*; line 8, column 1, name: twice"
    ):
        read_description(path)


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("{value: 07000, unit: Nm/rad, source: a}", 7000),
        ("{value: 1e4, unit: N·m/rad, source: a}", 1e4),
        ("{value: [8, 9], unit: kNm/rad, source: a}", [8e3, 9e3]),
        ("{value: 8 kN m/rad, source: a}", 8e3),
        ("{value: [8 kN m/rad, 100 Nm/deg], source: a}", [8e3, 18e3 / np.pi]),
        ("{value: 100, unit: [Nm/°, N m/rad], source: a}", [18e3 / np.pi, 100]),
    ],
)
def test_quantities_are_those_of_a_scenario(write, written: str, value: object) -> None:
    np.testing.assert_allclose(
        read_description(write(K, written)).stiffness, np.broadcast_to(value, 2), rtol=1e-14
    )


def test_other_units_of_a_data_sheet(write) -> None:
    d = read_description(write("value: [0.6, 0.3], unit: kg m^2", "value: [6000, 3000], unit: kg·cm²"))
    np.testing.assert_allclose(d.motor_inertia, [0.6, 0.3], rtol=1e-15)
    d = read_description(write("value: 3, unit: rad/s", "value: [20, 10], unit: rpm"))
    np.testing.assert_allclose(d.velocity_limit, [2 * np.pi / 3, np.pi / 3], rtol=1e-15)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig"])
def test_a_byte_order_mark_says_the_encoding(write, encoding: str) -> None:
    d = read_description(write("two joints", "zwei Gelenke, größer", encoding))
    assert d.description == "zwei Gelenke, größer"


@pytest.mark.parametrize("name", [None, "", " ", b"iiwa14", 3, {}])
def test_what_is_no_name_or_path_is_an_error_of_the_package(name: object) -> None:
    with pytest.raises(
        RobotError, match=r"^no robot; got .*; needs a name of the catalogue, or the path of a robot file"
    ):
        FlexibleJointRobot.load(name)


def test_a_urdf_in_place_of_a_robot_file_is_said_with_what_to_do(write, tmp_path: Path) -> None:
    (tmp_path / "wrong.yaml").write_text(URDF, encoding="utf-8")
    write()
    for name in (tmp_path / "two.urdf", "two.urdf", "arm.urdf.xacro", URDF, tmp_path / "wrong.yaml"):
        with pytest.raises(
            RobotError,
            match=r"is a URDF, which knows nothing of motors .*; try passiflex robot new .*, which writes one",
        ):
            FlexibleJointRobot.load(name)


def test_a_file_may_say_what_commands_the_robot(write) -> None:
    assert read_description(write()).commanded is None
    by = read_description(
        write("urdf: two.urdf", "commanded: {rate: 1 kHz, by: RTDE}\nurdf: two.urdf")
    ).commanded
    assert (by.rate, by.by) == (1000.0, "RTDE")
    for wrong in ("{rate: 0 Hz, by: x}", "{rate: 1 ms, by: x}", "{rate: 1 kHz}", "1 kHz"):
        with pytest.raises(RobotError, match="commanded"):
            read_description(write("urdf: two.urdf", f"commanded: {wrong}\nurdf: two.urdf"))


def test_only_regular_files_of_bearable_size_are_read(write, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    (tmp_path / "large.yaml").write_bytes(b"#" * 1_000_001)
    for name, message in {"pipe.yaml": "not a regular file", "large.yaml": "larger than 1 MB"}.items():
        with pytest.raises(RobotError, match=f"robot file .*{name}' cannot be read; got {message}"):
            read_description(tmp_path / name)
    for urdf, message in {"/dev/zero": "not a regular file", str(tmp_path): "Is a directory"}.items():
        with pytest.raises(RobotError, match=f"the URDF file '{urdf}' cannot be read; got {message}"):
            read_description(write("urdf: two.urdf", f"urdf: {urdf}"))


# What can hardly be meant


@settings(deadline=None, max_examples=20)
@given(serial_chains())
def test_what_a_joint_moves_is_the_diagonal_of_pinocchios_mass_matrix(chain: SerialChain) -> None:
    model = pin.buildModelFromXML(chain.to_urdf())
    postures = np.vstack([np.zeros(chain.n), np.random.default_rng(0).uniform(-2, 2, (3, chain.n))])
    M = [np.diag(pin.crba(model, model.createData(), q)) for q in postures]
    np.testing.assert_allclose(moved_inertia(chain, postures), M, rtol=1e-10)
    np.testing.assert_array_equal(moved_inertia(chain), moved_inertia(chain, postures[:1]))


@pytest.mark.parametrize("name", catalogue())
@pytest.mark.parametrize("limited", [True, False])
@pytest.mark.parametrize(
    ("entry", "factor"), [("stiffness", 1e3), ("stiffness", 1e-3), ("motor_inertia", 1e-4)]
)
def test_a_number_of_one_joint_that_is_far_off_is_doubted(
    name: str, limited: bool, entry: str, factor: float
) -> None:
    """Of any joint, in both directions; 1e-4 is a gear of 1:100 that was forgotten."""
    robot = read_description(name)
    if not limited:
        robot = replace(robot, torque_limit=np.full(robot.chain.n, np.inf))
    for i in range(robot.chain.n):
        values = getattr(robot, entry) * np.where(np.arange(robot.chain.n) == i, factor, 1)
        said = [text for text in doubts(replace(robot, **{entry: values})) if entry in text]
        assert len(said) == 1
        assert repr(robot.chain.joints[i].name) in said[0]


@pytest.mark.parametrize("name", [n for n in catalogue() if n != "iiwa14_stuerz"])
def test_nothing_is_doubted_of_the_catalogue(name: str) -> None:
    assert list(doubts(read_description(name))) == []


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "[0.6, 0.3]",
            "[0.6e-4, 0.3e-4]",
            "motor_inertia of 'shoulder', 'elbow' is far below what the joint moves: 6e-05 against 1.4 kg m\\^2 at "
            "'shoulder'; it counts behind the gear, as rotor inertia times the square of the ratio",
        ),
        (
            "8000",
            "8",
            "joint_stiffness of 'shoulder' is very soft: 8 lets its links swing at 0.38 Hz; is it 1000 times off",
        ),
        (
            "8000",
            "8e6",
            "joint_stiffness of 'shoulder' is very hard: 8e\\+06 lets its links swing at 3.8e\\+02 Hz, and those",
        ),
        (
            "8000",
            "[8000, 8]",
            "joint_stiffness of 'elbow' does not fit the motor: the largest torque, 80, bends 'elbow' by 10 rad; "
            "is one of them 1000 times off",
        ),
        (
            "8000",
            "[8000, 8e6]",
            "joint_stiffness of 'elbow' does not fit the motor: .* by 1e-05 rad; is one of",
        ),
        (
            "8000",
            "[8e8, 8000]",
            "joint_stiffness of 'shoulder' does not fit the motor: .* by 1e-07 rad; is one",
        ),
        (
            "8000",
            "[8000, 1e308]",
            "joint_stiffness of 'elbow' does not fit the motor: .* by 8e-307 rad; is one",
        ),
        ("8000", "[4000, 790000]", None),
        ("value: 80,", "value: [80, 81],", None),
        (
            "value: 80,",
            "value: [87, 81],",
            "torque_limit of joint 'shoulder' contradicts the URDF: 87 against 80",
        ),
        (
            "value: 3,",
            "value: [3.1, 9],",
            "velocity_limit of joint 'shoulder' contradicts the URDF: 3.1 against 3",
        ),
        (
            "value: 2,",
            "value: 6,",
            "position_limit of joint 'shoulder' contradicts the URDF: -6 to 6 against -2 to 2",
        ),
        ("value: 2,", "value: [[-1, 1], [-2, 1.5]],", None),
        (
            "value: 2,",
            "value: [[-1, 1], [-2, 115]],",
            "position_limit of joint 'elbow' contradicts the URDF: -2 to 115",
        ),
    ],
)
def test_numbers_that_can_hardly_be_meant_are_said_once(
    write, old: str, new: str, message: str | None
) -> None:
    path = write(old, new)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", PassiflexWarning)
        for _ in range(2):
            FlexibleJointRobot.load(path)
    assert len(said) == (message is not None)
    if message is not None:
        with pytest.raises(PassiflexWarning, match=f"two.yaml: {message}"):
            raise said[0].message


def test_workers_of_a_process_leave_it_to_say_so(write, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        sys.modules["passiflex.robots.catalogue"], "parent_process", lambda: "the one that has said it"
    )
    FlexibleJointRobot.load(write("8000", "8"))  # a warning is an error in these tests


def test_what_a_urdf_can_hardly_mean_is_said_when_a_robot_is_loaded_or_simulated(
    write, tmp_path: Path
) -> None:
    (tmp_path / "two.urdf").write_text(URDF.replace('izz="0.1"', 'izz="1"', 1), encoding="utf-8")
    scenario = parse_scenario(
        "{name: a, robot: two.yaml, posture: [0.3, 0.9], duration: 10 ms, law: {type: impedance, task: position, "
        "gravity: robot, shaped_stiffness: {ratio: 1}, shaped_inertia: {ratio: 1}, stiffness: {translation: [60, 0, 60]}, "
        "damping: {translation: [9, 0, 9]}}}",
        base_dir=write().parent,
    )
    with pytest.warns(
        PassiflexWarning, match=r"two.yaml: link 'upper' has principal moments that no body has"
    ) as said:
        simulate(scenario)
    assert len([w for w in said if issubclass(w.category, PassiflexWarning)]) == 1
