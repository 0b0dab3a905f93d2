"""The arm in a tree: what hangs beside it is held still, as Pinocchio's reduced model has it; and what is said."""

from __future__ import annotations

import warnings
from typing import Any

import casadi as cs
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from passiflex.errors import NameUnknownError, RobotError
from passiflex.robots.arm import SerialArm
from passiflex.robots.chain import ReadChain, SerialChain, read_chain


def link(name: str, rng: np.random.Generator | None = None) -> str:
    """Return a link, with a random inertia that a body can have."""
    if rng is None:
        return f'<link name="{name}"/>'
    a, b, c = rng.uniform(0.01, 0.1, 3)
    tensor = f'ixx="{b + c}" iyy="{a + c}" izz="{a + b}" ixy="0" ixz="0" iyz="0"'
    xyz, rpy = vector(rng), vector(rng)
    mass = f'<mass value="{rng.uniform(0.1, 3)}"/>'
    return f'<link name="{name}"><inertial><origin xyz="{xyz}" rpy="{rpy}"/>{mass}<inertia {tensor}/></inertial></link>'


def vector(rng: np.random.Generator) -> str:
    return " ".join(map(str, rng.uniform(-0.5, 0.5, 3)))


def joint(
    name: str, parent: str, child: str, rng: np.random.Generator, kind: str = "revolute", inside: str = ""
) -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    axis = "" if kind in ("fixed", "floating") else f'<axis xyz="{vector(rng)}"/>'
    limit = (
        '<limit lower="-2" upper="2" effort="10" velocity="1"/>' if kind in ("revolute", "prismatic") else ""
    )
    origin = f'<origin xyz="{vector(rng)}" rpy="{vector(rng)}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{origin}{axis}{limit}{inside}</joint>'


def tree(seed: int, n: int = 4, mimic: bool = True) -> str:
    """Return an arm of n joints on a cart with wheels, a head beside it, and a gripper whose finger leads another."""
    rng = np.random.default_rng(seed)
    parts = [link("world"), link("cart", rng), joint("on", "world", "cart", rng, "fixed")]
    for i in range(2):
        parts += [link(f"wheel{i}", rng), joint(f"roll{i}", "cart", f"wheel{i}", rng, "continuous")]
    parts += [link("head", rng), joint("nod", "cart", "head", rng)]
    last = "cart"
    for i in range(1, n + 1):
        kind = "prismatic" if rng.random() < 0.2 else "revolute"
        parts += [link(f"link{i}", rng), joint(f"joint{i}", last, f"link{i}", rng, kind)]
        parts += [link(f"cover{i}", rng), joint(f"bolts{i}", f"link{i}", f"cover{i}", rng, "fixed")]
        last = f"link{i}"
    follow = '<mimic joint="close" multiplier="-1"/>' if mimic else ""
    parts += [link("palm", rng), joint("wrist", last, "palm", rng, "fixed")]
    parts += [link("left", rng), joint("close", "palm", "left", rng, "prismatic")]
    parts += [link("right", rng), joint("follow", "palm", "right", rng, "prismatic", follow)]
    parts += [link("tcp"), joint("grasp", "palm", "tcp", rng, "fixed")]
    return f'<robot name="tree">{"".join(parts)}</robot>'


def numbers(read: ReadChain, q: np.ndarray, gravity: Any = None) -> list[np.ndarray]:
    """Return M, ∇V, position and rotation of the end effector in the base."""
    arm = SerialArm(read.chain)
    p, m = arm.layout.symbols("p")
    x = cs.SX.sym("q", arm.n)
    pose = arm.pose(x, m)
    f = cs.Function("f", [x, p], [arm.mass_matrix(x, m), arm.gravity_torque(x, m), *pose])
    return [np.array(v) for v in f(q, arm.layout.pack(arm.nominal(gravity)))]


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    n=st.integers(3, 7),
    base=st.sampled_from([None, "world", "cart", "link1"]),
    held=st.floats(-1.5, 1.5),
)
def test_what_is_beside_the_arm_is_held_still_as_pinocchio_has_it(
    seed: int, n: int, base: str | None, held: float
) -> None:
    text = tree(seed, n)
    frozen = {"close": held, "nod": -held}
    read = read_chain(text, "tcp", base=base, frozen=frozen)
    names = [e.joint.name for e in read.choice.moving]
    assert names == [f"joint{i}" for i in range(2 if base == "link1" else 1, n + 1)]
    model = pin.buildModelFromXML(text.replace('<mimic joint="close" multiplier="-1"/>', ""))
    still, where = (
        [model.getJointId(name) for name in model.names[1:] if name not in names],
        pin.neutral(model),
    )
    for name, value in (frozen | {"follow": -held}).items():  # it goes where the other one is, the other way
        where[model.joints[model.getJointId(name)].idx_q] = value
    reduced = pin.buildReducedModel(model, still, where)
    data, rng = reduced.createData(), np.random.default_rng(seed)
    q = rng.uniform(-2, 2, len(names))
    pin.forwardKinematics(reduced, data, q)
    pin.updateFramePlacements(reduced, data)
    root = data.oMf[reduced.getFrameId(read.choice.base, pin.FrameType.BODY)]
    tip = root.inverse() * data.oMf[reduced.getFrameId("tcp", pin.FrameType.BODY)]
    M = pin.crba(reduced, data, q)
    expected = np.triu(M) + np.triu(M, 1).T, pin.computeGeneralizedGravity(reduced, data, q), tip.translation
    np.testing.assert_allclose(read.chain.mount, root.rotation, atol=1e-13)
    for ours, theirs in zip(numbers(read, q), [*expected, tip.rotation], strict=True):
        np.testing.assert_allclose(np.squeeze(ours), theirs, atol=1e-11)


@pytest.mark.parametrize("mimic", [True, False])
def test_without_names_it_is_the_longest_chain_without_the_gripper(mimic: bool) -> None:
    """Of fingers of their own, what they have in common is the arm; one that another follows is no joint of it."""
    read = read_chain(tree(3, mimic=mimic))
    assert [e.joint.name for e in read.choice.moving] == [f"joint{i}" for i in range(1, 5)]
    assert read.choice.tip == "tcp"
    assert read.remarks == (
        "the arm goes from 'world' to 'tcp': 4 joints",
        "held still: joint 'close' at 0 m, joint 'follow' at 0 m",
    )


def test_a_range_without_zero_is_held_in_its_middle() -> None:
    text = tree(3).replace('name="close" type="prismatic"', 'name="close" type="prismatic" id="c"')
    first, second = text.split('id="c"')
    text = first + 'id="c"' + second.replace('lower="-2" upper="2"', 'lower="0.01" upper="0.05"', 1)
    assert "held still: joint 'close' at 0.03 m, joint 'follow' at -0.03 m" in read_chain(text, "tcp").remarks


def two_arms() -> str:
    rng = np.random.default_rng(0)
    parts = [link("torso")]
    for side in ("left", "right"):
        last = "torso"
        for i in range(4):
            name = f"{side}_{i}"
            parts += [link(name, rng), joint(f"{side}_joint{i}", last, name, rng)]
            last = name
        parts += [link(f"{side}_tool"), joint(f"{side}_bolts", last, f"{side}_tool", rng, "fixed")]
    return f'<robot name="two">{"".join(parts)}</robot>'


def test_several_candidates_are_listed() -> None:
    message = "several chains .* the longest, with 4 joints; got .*; try left_tool, right_tool"
    with pytest.raises(RobotError, match=message):
        read_chain(two_arms())
    read = read_chain(two_arms(), "right_tool")
    assert [e.joint.name for e in read.choice.moving] == [f"right_joint{i}" for i in range(4)]
    assert read.remarks == ()  # nothing that hangs on the arm had to be decided


def test_what_cannot_be_driven_is_refused_by_name_where_it_is_in_the_chain() -> None:
    with pytest.raises(RobotError, match="joint 'follow' mimics joint 'close'; needs joints that are driven"):
        read_chain(tree(1), "right")
    assert read_chain(tree(1), "left").chain.n == 5
    inside = tree(1).replace(
        '<parent link="link2"/><child link="link3"/>',
        '<parent link="link2"/><child link="link3"/><mimic joint="joint2"/>',
    )
    with pytest.raises(RobotError, match="joint 'joint3' mimics joint 'joint2'"):
        read_chain(inside)
    floating = tree(1).replace('name="on" type="fixed"', 'name="on" type="floating"')
    read = read_chain(floating, "tcp")
    assert read.choice.base == "cart"
    assert read.remarks[0] == "the arm goes from 'cart' to 'tcp': 4 joints"
    with pytest.raises(RobotError, match="joint 'on' is floating: nothing drives it"):
        read_chain(floating, "tcp", base="world")


def test_what_is_wrong_beside_the_arm_is_not_asked_for() -> None:
    """As the limits of a finger, the axis of a wheel, the inertia of a head."""
    text = tree(2)
    i = text.index('<link name="head">')
    j = text.index("</link>", i)
    text = text[:i] + '<link name="head"><inertial><mass value="much"/></inertial>' + text[j:]
    for name in ("close", "roll0"):
        i = text.index(f'<joint name="{name}"')
        j = text.index("</joint>", i)
        text = (
            text[:i]
            + text[i:j].replace("<axis xyz", "<axis xzy").replace('upper="2"', 'upper="-9"')
            + text[j:]
        )
    good, odd = read_chain(tree(2), "tcp"), read_chain(text, "tcp")
    for ours, theirs in zip(numbers(odd, np.ones(4)), numbers(good, np.ones(4)), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    with pytest.raises(RobotError, match=r"joint 'close': <axis xzy=\.\.\.>"):
        read_chain(text, "left")


def test_names_that_do_not_fit_are_said() -> None:
    for arguments, error, message in (
        ({"base": "car"}, NameUnknownError, "unknown base; got 'car'"),
        ({"base": "head", "end_effector": "tcp"}, RobotError, "'head' does not carry the end effector"),
        ({"frozen": {"clos": 0.1}}, NameUnknownError, "unknown joint that is not the arm's; got 'clos'"),
        ({"frozen": {"joint1": 0.1}}, NameUnknownError, "got 'joint1'"),
        ({"end_effector": "cart"}, RobotError, "the robot has no moving joint"),
    ):
        with pytest.raises(error, match=message):
            read_chain(tree(0), **arguments)


def test_a_tilted_base_is_kept_in_what_is_written_of_the_chain() -> None:
    chain = read_chain(tree(5), "tcp", base="cart").chain
    again = read_chain(chain.to_urdf(), base="base").chain
    np.testing.assert_allclose(again.gravity, chain.gravity, atol=1e-14)
    assert np.abs(np.array(chain.gravity) - [0, 0, -9.81]).max() > 0.1
    np.testing.assert_allclose(again.tip_xyz, chain.tip_xyz, atol=1e-14)
    np.testing.assert_allclose(again.joints[0].xyz, chain.joints[0].xyz, atol=1e-14)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert "world" not in SerialChain.from_urdf(two_arms(), "left_tool").to_urdf()


def test_a_mount_turns_gravity(tmp_path: Any) -> None:
    """A ceiling turns it over; on a wall the x of the base points down; gravity in the base's axes says the same."""
    from passiflex.robots.robot_entries import Mount

    down = np.array([0, 0, -9.81])
    for said, expected in (
        ({"on": "floor"}, [0, 0, -9.81]),
        ({"on": "ceiling"}, [0, 0, 9.81]),
        ({"on": "wall"}, [9.81, 0, 0]),
        ({"gravity": [1, 2, 3]}, 9.81 * np.array([1, 2, 3]) / np.sqrt(14)),
        ({"rpy": ["30 deg", 0, 0]}, Rotation.from_euler("x", -30, degrees=True).apply(down)),
    ):
        R = Mount.model_validate(said).rotation(np.eye(3))
        np.testing.assert_allclose(R.T @ down, expected, atol=1e-12)
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
