"""The reader against Pinocchio, and every message of a document that cannot be used."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from scipy.spatial.transform import Rotation

from arms import random_urdf, serial_chains
from passiflex.errors import NameUnknownError, PassiflexError, PassiflexWarning, RobotError
from passiflex.robots.catalogue import read_description
from passiflex.robots.chain import Body, SerialChain

INERTIA = '<mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
LINK = '<link name="{}"><inertial>' + INERTIA + "</inertial></link>"
JOINT = '<joint name="{0}" type="{3}"><parent link="{1}"/><child link="{2}"/><axis xyz="0 0 1"/></joint>'
REVOLUTE = JOINT.replace("{3}", "revolute")
TWO = (
    '<robot name="two"><link name="base"/>'
    + LINK.format("upper")
    + LINK.format("lower")
    + REVOLUTE.format("shoulder", "base", "upper")
    + REVOLUTE.format("elbow", "upper", "lower")
    + "<!--more--></robot>"
)


def more(xml: str) -> str:
    """Return the arm with something added."""
    return TWO.replace("<!--more-->", xml)


def inertia(text: str) -> str:
    """Return the arm with another Ixx of its first link."""
    return TWO.replace('ixx="1"', text, 1)


def tool(origin: str) -> str:
    """Return the arm with a tool `t` fixed to its last link."""
    joint = JOINT.format("f", "lower", "t", "fixed").replace("<axis", f"<origin {origin}/><axis")
    return more('<link name="t"/>' + joint)


def dynamics(urdf: str, tool: str, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return mass matrix, gravity torque and placement of a frame by Pinocchio."""
    model = pin.buildModelFromXML(urdf)
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    placement = data.oMf[model.getFrameId(tool)].homogeneous.copy()
    mass = pin.crba(model, data, q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    return mass, pin.computeGeneralizedGravity(model, data, q), placement


@settings(deadline=None, max_examples=60)
@given(random_urdf())
def test_lumping_keeps_the_dynamics(urdf):
    chain = SerialChain.from_urdf(urdf, "tool")
    q = np.random.default_rng(1).uniform(-2, 2, chain.n)
    for ours, theirs in zip(dynamics(chain.to_urdf(), "tip", q), dynamics(urdf, "tool", q), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-10 * max(1.0, np.abs(theirs).max()))


@settings(deadline=None, max_examples=60)
@given(serial_chains())
def test_canonical_urdf_reads_back(chain):
    again = SerialChain.from_urdf(chain.to_urdf())
    assert [j.kind for j in again.joints] == [j.kind for j in chain.joints]
    for a, b in zip(again.joints, chain.joints, strict=True):
        np.testing.assert_array_equal(a.xyz, b.xyz)
        np.testing.assert_array_equal(a.rpy, b.rpy)
        np.testing.assert_allclose(a.axis, b.axis, rtol=0, atol=1e-15)
        assert a[5:] == b[5:]
    for a, b in zip(again.bodies, chain.bodies, strict=True):
        assert a.mass == b.mass
        np.testing.assert_array_equal(a.com, b.com)
        np.testing.assert_array_equal(a.inertia, b.inertia)
    np.testing.assert_array_equal(again.tip_xyz, chain.tip_xyz)
    np.testing.assert_allclose(again.tip_rotation, chain.tip_rotation, rtol=0, atol=1e-15)
    assert chain.triangle_defects() == []


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-8])
def test_vertical_pitch_of_a_tool_is_accurate(pitch):
    chain = SerialChain.from_urdf(tool(f'rpy="0.3 {pitch!r} 1.1"'))
    again = SerialChain.from_urdf(chain.to_urdf())
    np.testing.assert_allclose(
        again.tip_rotation, Rotation.from_euler("xyz", [0.3, pitch, 1.1]).as_matrix(), atol=1e-15
    )


def test_origins_without_fixed_joints_pass_through_exactly():
    urdf = read_description("iiwa14").chain.to_urdf()
    assert '<origin xyz="0.0 0.2045 0.0" rpy="1.5707963267948966 0.0 3.141592653589793"/>' in urdf


def test_source_names_stay_behind():
    urdf = SerialChain.from_urdf(TWO).to_urdf()
    names = re.findall(r'name="(.*?)"', urdf)
    assert names == ["arm", "base", "link_1", "joint_1", "link_2", "joint_2", "tip", "tip_joint"]
    assert not re.search("two|upper|lower|shoulder|elbow", re.sub(r' (lower|upper)="', "", urdf))


def test_own_names_are_kept_where_asked_for():
    """Names with marks of XML too; and a joint may be called as the one to the tip usually is."""
    odd = TWO.replace('"shoulder"', '"a &lt;b&gt; &quot;c&quot;"').replace('"elbow"', '"tip_joint"')
    chain = SerialChain.from_urdf(odd)
    again = SerialChain.from_urdf(chain.to_urdf(own_names=True))
    assert again.name == "two"
    assert [j.name for j in again.joints] == ['a <b> "c"', "tip_joint"]
    assert again.to_urdf() == chain.to_urdf()


def test_continuous_is_revolute_without_limits():
    chain = SerialChain.from_urdf(TWO.replace("revolute", "continuous"))
    assert chain.joints[0].kind == "revolute"
    assert (chain.joints[0].lower, chain.joints[0].upper) == (-np.inf, np.inf)
    assert 'lower="-1000000000.0" upper="1000000000.0"' in chain.to_urdf()
    assert pin.buildModelFromXML(chain.to_urdf()).nq == 2


def test_default_axis_and_path(tmp_path: Path):
    file = tmp_path / "arm.urdf"
    file.write_text(TWO.replace('<axis xyz="0 0 1"/>', ""), encoding="utf-8")
    for path in (file, str(file)):
        np.testing.assert_array_equal(SerialChain.from_urdf(path).joints[1].axis, [1, 0, 0])


def test_massless_moving_link_takes_its_inertia_from_a_fixed_one():
    urdf = TWO.replace(LINK.format("lower"), '<link name="lower"/>' + LINK.format("hand"))
    chain = SerialChain.from_urdf(urdf.replace("<!--more-->", JOINT.format("grip", "lower", "hand", "fixed")))
    assert chain.bodies[1].mass == 1.0


def test_end_effector_may_be_any_link_of_the_last_rigid_part():
    urdf = tool('xyz="0 0 0.2"')
    assert SerialChain.from_urdf(urdf).tip_xyz[2] == 0.2
    assert SerialChain.from_urdf(urdf, "t").tip_xyz[2] == 0.2
    assert SerialChain.from_urdf(urdf, "lower").tip_xyz[2] == 0.0


def test_joint_quantities_have_the_units_of_the_joints():
    chain = read_description("planar2r").chain
    turning, sliding = chain.joints[0], chain.joints[1]._replace(kind="prismatic")
    turns, slides, both = (replace(chain, joints=pair) for pair in
                           ((turning, turning), (sliding, sliding), (turning, sliding)))  # fmt: skip
    assert turns.joint_units == ("rad", "rad/s", "N m")
    assert slides.joint_units == ("m", "m/s", "N")
    assert both.joint_units == ("rad or m", "rad/s or m/s", "N m or N")
    assert [both.unit_of(i, "N m or N") for i in (0, 1)] == ["N m", "N"]
    assert [slides.unit_of(i, "N") for i in (0, 1)] == ["N", "N"]


def test_triangle_defects_name_the_joint_and_the_moments():
    chain = read_description("iiwa14_stuerz").chain
    first, second = chain.triangle_defects()
    assert (
        first == "the link moved by joint 'joint_4' has principal moments 0.01138 + 0.03835 < 0.05003 kg m^2"
    )
    assert "'joint_7'" in second


BAD = {
    "malformed": (
        "<robot>\n<link>\n</robot>",
        "the URDF text is not well-formed XML, line 3; got mismatched tag.*; needs URDF",
    ),
    "root": ("<sdf/>", "the URDF text is not a URDF document; got root <sdf>; needs root <robot>"),
    "no joints": (
        '<robot><link name="a"/></robot>',
        "the URDF text has no joints; needs links and the joints between them",
    ),
    "only fixed": (
        '<robot><link name="a"/><link name="b"/>' + JOINT.format("f", "a", "b", "fixed") + "</robot>",
        "the robot has no moving joint; needs revolute, continuous or prismatic ones",
    ),
    "doctype": (
        "<!DOCTYPE robot []>" + TWO,
        "the URDF text has a DOCTYPE or entities; needs plain XML; try removing them",
    ),
    "entity": (
        '<!ENTITY x "y">' + TWO,
        "the URDF text has a DOCTYPE or entities; needs plain XML; try removing them",
    ),
    "xacro tag": (
        more("<xacro:macro/>"),
        "the URDF text is a xacro template; needs plain URDF; try expanding it first: xacro FILE > arm.urdf",
    ),
    "xacro value": (
        TWO.replace("0 0 1", "${axis}"),
        "the URDF text is a xacro template; needs plain URDF; try expanding",
    ),
    "no inertia": (
        TWO.replace(LINK.format("lower"), '<link name="lower"/>'),
        "moving link 'lower' has no inertia; needs <inertial> in it or in a link fixed to it",
    ),
    "zero mass": (
        TWO.replace('value="1"', 'value="0"', 1),
        "the mass of link 'upper' is not positive; got 0 kg; needs more than 0 kg",
    ),
    "negative mass of a part": (
        more(
            LINK.format("t").replace('value="1"', 'value="-0.5"') + JOINT.format("f", "lower", "t", "fixed")
        ),
        "the mass of link 't' is not positive; got -0.5 kg; needs more than 0 kg",
    ),
    "indefinite inertia": (
        inertia('ixx="-1"'),
        "the inertia of link 'upper' is not positive definite; "
        "got principal moments -1, 1, 1 kg m\\^2; needs three positive moments$",
    ),
    "singular inertia": (
        inertia('ixx="0"'),
        "the inertia of link 'upper' is not positive definite; got principal moments 0, 1, 1",
    ),
    "two parents": (
        more(REVOLUTE.format("again", "base", "lower")),
        "closed loop: link 'lower' has two parents; got joints 'elbow' and 'again'; needs a tree",
    ),
    "ring": (
        more(
            '<link name="a"/><link name="b"/>'
            + REVOLUTE.format("x", "a", "b")
            + REVOLUTE.format("y", "b", "a")
        ),
        "closed loop: these links do not hang on a base; got 'a', 'b'; needs a tree",
    ),
    "no root": (
        more(REVOLUTE.format("back", "lower", "base")),
        "closed loop: these links do not hang on a base; got 'base', 'upper', 'lower'; needs a tree",
    ),
    "two roots": (
        more('<link name="stray"/>'),
        "more than one link has no parent; "
        "got 'base', 'stray'; needs one base; try joining them by fixed joints",
    ),
    "of no kind": (
        TWO.replace("revolute", "rotary", 1),
        "joint 'shoulder' is of a kind that URDF does not know; got 'rotary'; needs revolute, continuous, prismatic",
    ),
    "zero axis": (
        TWO.replace("0 0 1", "0 0 0", 1),
        "joint 'shoulder' has a zero axis; got \\[0.0, 0.0, 0.0\\]; needs a direction",
    ),
    "axis size": (
        TWO.replace("0 0 1", "0 1", 1),
        "joint 'shoulder': <axis xyz=...> is wrong; got '0 1'; needs 3 finite numbers",
    ),
    "not finite": (
        TWO.replace("0 0 1", "0 nan 1", 1),
        "joint 'shoulder': <axis xyz=...> is wrong; got '0 nan 1'",
    ),
    "origin": (
        TWO.replace("<axis", '<origin xyz="0 0 inf"/><axis', 1),
        "joint 'shoulder': <origin xyz=...> is wrong; got '0 0 inf'; needs 3 finite numbers",
    ),
    "limit": (
        TWO.replace("<axis", '<limit effort="much"/><axis', 1),
        "joint 'shoulder': <limit effort=...> is wrong; got 'much'; needs 1 number$",
    ),
    "impossible limits": (
        TWO.replace("<axis", '<limit lower="1" upper="-1"/><axis', 1),
        "joint 'shoulder' has impossible limits; "
        "got lower 1, upper -1, velocity inf, effort inf; needs lower < upper",
    ),
    "mass text": (
        TWO.replace('value="1"', 'value="1_0"', 1),
        "link 'upper': <mass value=...> is wrong; got '1_0'; needs 1 finite number$",
    ),
    "mass missing": (
        TWO.replace('<mass value="1"/>', "", 1),
        "link 'upper' lacks <mass value=...>; needs this attribute",
    ),
    "inertia text": (
        inertia('ixx="inf"'),
        "link 'upper': <inertia ixx=...> is wrong; got 'inf'; needs 1 finite number",
    ),
    "inertia missing": (inertia(""), "link 'upper' lacks <inertia ixx=...>; needs this attribute, not empty"),
    "nameless": (more("<link/>"), "a link lacks <link name=...>; needs this attribute, not empty"),
    "no child": (TWO.replace('<child link="lower"/>', ""), "joint 'elbow' lacks <child link=...>"),
    "two links": (
        more('<link name="upper"/>'),
        "two links have the same name; got 'upper'; needs different names",
    ),
    "two joints": (
        more('<link name="t"/>' + REVOLUTE.format("elbow", "lower", "t")),
        "two joints have the same name; got 'elbow'; needs different names",
    ),
    "unknown link": (
        TWO.replace('<parent link="upper"', '<parent link="uper"'),
        "joint 'elbow' refers to an unknown link; got 'uper'; needs one of base, upper, lower; try 'upper'",
    ),
}


@pytest.mark.parametrize(("urdf", "message"), BAD.values(), ids=BAD)
def test_unusable_documents_are_refused_with_reasons(urdf, message):
    with pytest.raises(RobotError, match="^" + message):
        SerialChain.from_urdf(urdf)


def test_missing_file(tmp_path):
    with pytest.raises(
        RobotError,
        match=r"the URDF file '.*none.urdf' cannot be read; got .*No such file.*; needs a text file",
    ):
        SerialChain.from_urdf(tmp_path / "none.urdf")


def test_a_file_is_named_in_its_mistakes(tmp_path):
    (tmp_path / "arm.urdf").write_text("<sdf/>")
    with pytest.raises(RobotError, match=r"arm.urdf is not a URDF document"):
        SerialChain.from_urdf(tmp_path / "arm.urdf")


def test_end_effector_must_exist():
    with pytest.raises(
        NameUnknownError,
        match="unknown end effector; got 'lowr'; needs one of base, lower, upper; try 'lower'",
    ):
        SerialChain.from_urdf(TWO, "lowr")


def test_joints_beyond_the_end_effector_are_held_still_and_it_is_said():
    with pytest.warns(PassiflexWarning, match="held still: joint 'elbow' at 0 rad"):
        chain = SerialChain.from_urdf(TWO, "upper")
    assert chain.n == 1
    assert chain.bodies[0].mass == 2


def test_chains_built_by_hand_are_checked():
    chain = SerialChain.from_urdf(TWO)
    with pytest.raises(
        RobotError,
        match="a chain has one body per joint; got 2 joints and 1 bodies; needs at",
    ):
        SerialChain("x", chain.joints, chain.bodies[:1], chain.tip_xyz, chain.tip_rotation)
    bad = (chain.bodies[0], Body(np.nan, np.zeros(3), np.ones(6)))
    with pytest.raises(
        PassiflexError, match="the mass of the link moved by joint 'elbow' is not positive; got nan kg"
    ):
        SerialChain("x", chain.joints, bad, chain.tip_xyz, chain.tip_rotation)
