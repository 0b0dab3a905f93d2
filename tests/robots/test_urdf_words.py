"""What a document or a caller means but does not say so that it can be read: refused by name, never defaulted."""

# ruff: noqa: E501 - one pinned message per line

from __future__ import annotations

import io
import os
import re
from pathlib import Path

import numpy as np
import pytest

from passiflex.errors import NameUnknownError, RobotError
from passiflex.robots.chain import SerialChain
from work import calls

ARM = """<robot name="arm">
<link name="base"/>
<joint name="hip" type="revolute"><parent link="base"/><child link="leg"/><origin xyz="0 0 1" rpy="0 0 1"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="2" effort="3"/></joint>
<link name="leg"><inertial><origin xyz="0 0 0.2" rpy="0 0 0"/><mass value="2"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
<joint name="ankle" type="fixed"><parent link="leg"/><child link="foot"/></joint><link name="foot"/>
</robot>
"""
AXIS, ORIGIN, COM = (
    '<axis xyz="0 1 0"/>',
    '<origin xyz="0 0 1" rpy="0 0 1"/>',
    '<origin xyz="0 0 0.2" rpy="0 0 0"/>',
)
LIMIT = '<limit lower="-1" upper="1" velocity="2" effort="3"/>'


def with_(old: str, new: str) -> str:
    assert ARM.count(old) == 1, old
    return ARM.replace(old, new)


UNREAD = {
    "<axis/>": (AXIS, "joint 'hip' lacks <axis xyz=...>; needs this attribute, not empty"),
    '<axis xzy="0 1 0"/>': (AXIS, "joint 'hip': <axis xzy=...> cannot be read; needs xyz=..., if anything; try xyz=..."),
    '<axis XYZ="0 1 0"/>': (AXIS, "joint 'hip': <axis XYZ=...> cannot be read"),
    '<axis x="0" y="1" z="0"/>': (AXIS, "joint 'hip': <axis x=...> cannot be read"),
    "<axis>0 1 0</axis>": (AXIS, "joint 'hip': the text '0 1 0' in <axis> cannot be read"),
    "<axis><xyz>0 1 0</xyz></axis>": (AXIS, "joint 'hip': <xyz> in <axis> cannot be read"),
    '<Axis xyz="0 1 0"/>': (AXIS, "joint 'hip': <Axis> in <joint> cannot be read; needs <axis>, if anything; try <axis>"),
    '<dir xyz="0 1 0"/>': (AXIS, "joint 'hip': <dir> in <joint> cannot be read; needs <axis>, if anything; try <axis>"),
    '<rotation_axis xyz="0 1 0"/>': (AXIS, "joint 'hip': <rotation_axis> in <joint> cannot be read"),
    '<placement rpy="0 1 0"/>': (ORIGIN, "joint 'hip': <placement> in <joint> cannot be read; needs <origin>, if anything; try <origin>"),
    '<center xyz="0 0 0.2"/>': (COM, "link 'leg': <center> in <inertial> cannot be read"),
    '<bounds lower="-1"/>': (LIMIT, "joint 'hip': <bounds> in <joint> cannot be read; needs <limit>, if anything; try <limit>"),
    '<axes xyz="0 1 0"/>': (AXIS, "joint 'hip': <axes> in <joint> cannot be read"),
    f'{AXIS}<Mimic joint="ankle"/>': (AXIS, "joint 'hip': <Mimic> in <joint> cannot be read"),
    '<origin xyz="0 0 1" rot="0 0 1"/>': (ORIGIN, "joint 'hip': <origin rot=...> cannot be read; needs rpy=... or quat_xyzw=..., if anything; try rpy=..."),
    '<origin xyz="0 0 1" wxyz="1 0 0 0"/>': (ORIGIN, "joint 'hip': <origin wxyz=...> cannot be read"),
    '<origin xyz="0 0 1" quat-xyzw="0 0 0 1"/>': (ORIGIN, "joint 'hip': <origin quat-xyzw=...> cannot be read; .*; try quat_xyzw=..."),
    '<origin position="0 0 1"/>': (ORIGIN, "joint 'hip': <origin position=...> cannot be read; .*; try xyz=..."),
    "<origin>0 0 1</origin>": (ORIGIN, "joint 'hip': the text '0 0 1' in <origin> cannot be read"),
    "<pose>0 0 1 0 0 1</pose>": (ORIGIN, "joint 'hip': <pose> in <joint> cannot be read; needs <origin>, if anything; try <origin>"),
    '<orgin xyz="0 0 1"/>': (ORIGIN, "joint 'hip': <orgin> in <joint> cannot be read"),
    '<origin xyz="0 0 1" rpy="0 0 57" units="deg"/>': (ORIGIN, "joint 'hip': <origin units=...> is not known to URDF; needs m and rad, and no such attribute"),
    '<origin xyz="0 0 1" rpy="0 0 1" quat_xyzw="0 0 0 1"/>': (ORIGIN, "joint 'hip': <origin quat_xyzw=...> stands beside rpy; needs one of them"),
    '<origin xyz="0 0 1" quat_xyzw="0 0 0 1"/>': (ORIGIN, "joint 'hip': <origin quat_xyzw=...> came with URDF 1.1; got version 1.0; needs <robot version=\"1.1\" ...>, or rpy"),
    '<limit lover="-1" upper="1" velocity="2" effort="3"/>': (LIMIT, "joint 'hip': <limit lover=...> cannot be read; needs lower=..., if anything; try lower=..."),
    '<limit min="-1" upper="1"/>': (LIMIT, "joint 'hip': <limit min=...> cannot be read; .*; try lower=..."),
    '<limits lower="-1"/>': (LIMIT, "joint 'hip': <limits> in <joint> cannot be read"),
    '<com xyz="0 0 0.2"/>': (COM, "link 'leg': <com> in <inertial> cannot be read; needs <origin>, if anything; try <origin>"),
    '<origin xzy="0 0 0.2"/>': (COM, "link 'leg': <origin xzy=...> cannot be read"),
    '<mass>2</mass>': ('<mass value="2"/>', "link 'leg' lacks <mass value=...>; got '2'; needs this attribute"),
    '<mass Value="2"/>': ('<mass value="2"/>', "link 'leg' lacks <mass value=...>; got Value; needs this attribute"),
    '<link name="foot"><Inertial><mass value="1"/></Inertial></link>': ('<link name="foot"/>', "link 'foot': <Inertial> in <link> cannot be read; needs <inertial>, if anything"),
    '<link name="foot"><mass value="1"/></link>': ('<link name="foot"/>', "link 'foot': <mass> in <link> cannot be read"),
    '<link name="foot"/><Joint/>': ('<link name="foot"/>', "the URDF text: <Joint> cannot be read; needs <link> and <joint>; try <joint>"),
    '<robot version="2.0"': ("<robot", "the URDF text is of an unknown version of URDF; got '2.0'; needs 1.0, 1.1 or 1.2"),
    '<origin xyz="0 0 1e200"/>': (ORIGIN, "joint 'hip': <origin xyz=...> is too large; got '0 0 1e200'; needs at most 1e\\+09"),
    '<origin xyz="0 0 ١"/>': (ORIGIN, "joint 'hip': <origin xyz=...> is wrong; got '0 0 ١'; needs 3 finite numbers"),
    f'<origin xyz="{"1" * 5000} 0 0"/>': (ORIGIN, "joint 'hip': <origin xyz=...> is wrong; got '111"),
}  # fmt: skip


@pytest.mark.parametrize("new", UNREAD)
def test_what_is_there_but_cannot_be_read_is_refused_by_name(new: str) -> None:
    old, message = UNREAD[new]
    with pytest.raises(RobotError, match=f"^{message}"):
        SerialChain.from_urdf(with_(old, new))


def test_an_attribute_in_place_of_an_element_is_refused_where_that_is_absent() -> None:
    urdf = with_(AXIS, "").replace('<joint name="hip"', '<joint axis="0 1 0" name="hip"')
    with pytest.raises(RobotError, match=r"^joint 'hip': <joint axis=...> cannot be read; .*; try <axis>$"):
        SerialChain.from_urdf(urdf)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (AXIS, '<axis xyz="0 1 0" rpy="0 0 0"/>'),
        (AXIS, f'{AXIS}<safety_controller k_velocity="1"/><drake:thing/><calibration rising="0"/>'),
        (ORIGIN, '<origin xyz="0 0 1" name="here" rpy="0 0 1"/>'),
        (ORIGIN, '<origin xyz="0 0 1" rpy="0 0 1" vendor:id="3"/>'),
        (LIMIT, '<limit lower="-1" upper="1" velocity="2" effort="3" acceleration="7" jerk="5"/>'),
        (
            '<link name="foot"/>',
            '<link name="foot"><contact/><visual/><sensor/><self_collide>1</self_collide></link>',
        ),
        (
            '<link name="foot"/>',
            '<link name="foot"/><material name="a"/><transmission/><loop_joint/><sensor/>',
        ),
        (
            '<link name="foot"/>',
            '<link name="foot"/><point/><linkage/><limit/><group/>',
        ),
    ],
)
def test_what_says_nothing_of_a_part_that_is_absent_does_no_harm(old: str, new: str) -> None:
    assert SerialChain.from_urdf(with_(old, new)).to_urdf() == SerialChain.from_urdf(ARM).to_urdf()


def test_an_axis_of_any_length_is_a_direction() -> None:
    for length in ("1e200", "1e-9", "-3"):
        axis = SerialChain.from_urdf(with_(AXIS, f'<axis xyz="0 {length} 0"/>')).joints[0].axis
        np.testing.assert_array_equal(axis, [0, np.sign(float(length)), 0])


@pytest.mark.parametrize("source", [None, b"<robot/>", b"", "", "  ", 3, {}, io.StringIO(ARM), io.BytesIO()])
def test_what_is_neither_text_nor_path_is_an_error_of_the_package(source: object) -> None:
    with pytest.raises(
        RobotError, match=r"^no URDF document; got .*; needs its text, or the path of its file"
    ):
        SerialChain.from_urdf(source)


def test_what_is_no_urdf_is_said_with_what_to_do(tmp_path: Path) -> None:
    robot = tmp_path / "robot.yaml"
    robot.write_text("name: a\nurdf: arm.urdf\n", encoding="utf-8")
    latin = tmp_path / "latin.urdf"
    latin.write_bytes(ARM.replace("leg", "Fuß").encode("latin-1"))
    os.mkfifo(tmp_path / "pipe")
    for path, message in {
        robot: "not well-formed XML, line 1; .*; try FlexibleJointRobot.load for a robot file",
        latin: "cannot be read; got not UTF-8 text; needs a text file; try naming its encoding in its first line",
        tmp_path / "pipe": "cannot be read; got not a regular file",
        tmp_path: "cannot be read; got Is a directory",
        tmp_path / "a\0b": "cannot be read; got embedded null byte",
    }.items():
        with pytest.raises(RobotError, match=re.escape(repr(str(path)))[1:-1] + f".*{message}"):
            SerialChain.from_urdf(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<robot>" + "<!--" * 200_000, "not well-formed XML, line 1"),
        ("<robot>" + "<a>" * 300_000, "more than 200000 elements"),
        ("<robot>" + "<a/>" * 300_000, "more than 200000 elements"),
        ("<robot>" + " " * 10_000_000, "the URDF text is too long"),
        ("<robot " + "".join(f'a{i}="1" ' for i in range(100_000)) + "/>", "has no joints"),
        ("<robot>" + "<joint/>" * 150_000 + "</robot>", "a joint lacks <joint name=...>"),
    ],
)
def test_no_document_takes_long_to_refuse(text: str, message: str) -> None:
    """Some of these took minutes or the whole memory."""
    with pytest.raises(RobotError, match=message):
        SerialChain.from_urdf(text)


def test_the_work_grows_as_the_number_of_links() -> None:
    """Chains of fixed links of 500 and 2000: four times the calls, not sixteen."""

    def taken(links: int) -> int:
        parts = "".join(
            f'<link name="l{i}"/><joint name="j{i}" type="fixed"><parent link="{f"l{i - 1}" if i else "leg"}"/>'
            f'<child link="l{i}"/><origin xyz="0 0 0.001" rpy="0.1 0 0"/></joint>'
            for i in range(links)
        )
        urdf = with_("</robot>", parts + "</robot>")
        return calls(lambda: SerialChain.from_urdf(urdf, f"l{links - 1}"))

    assert taken(2000) < 5 * taken(500)


def test_of_very_many_names_the_first_are_listed() -> None:
    links = "".join(f'<link name="l{i}"/><joint name="j{i}" type="fixed"><parent link="leg"/><child link="l{i}"/></joint>'
                    for i in range(1000))  # fmt: skip
    with pytest.raises(NameUnknownError) as error:
        SerialChain.from_urdf(with_("</robot>", links + "</robot>"), "l1001")
    assert ", ...; try 'l" in str(error.value)
    assert len(str(error.value)) < 1000


def test_a_chain_of_very_many_moving_joints_is_refused() -> None:
    inertial = ARM[ARM.index("<inertial>") : ARM.index("</inertial>")] + "</inertial>"
    more = "".join(
        f'<link name="l{i}">{inertial}</link><joint name="j{i}" type="revolute">'
        f'<parent link="{f"l{i - 1}" if i else "foot"}"/><child link="l{i}"/></joint>'
        for i in range(100)
    )
    with pytest.raises(RobotError, match="the robot has too many moving joints; needs at most 100"):
        SerialChain.from_urdf(with_("</robot>", more + "</robot>"))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('type="revolute"', 'type="{}"'),
        ('<parent link="base"/>', '<parent link="{}"/>'),
        (AXIS, '<axis xyz="{}"/>'),
        (AXIS, '<axis {}="1"/>'),
        (ORIGIN, '<origin xyz="0 0 1" rpy="{}"/>'),
        ('<mass value="2"/>', '<mass value="{}"/>'),
    ],
)
def test_a_word_of_a_megabyte_is_not_repeated_whole(old: str, new: str) -> None:
    with pytest.raises(RobotError) as error:
        SerialChain.from_urdf(with_(old, new.format("x" * 10**6)))
    assert len(str(error.value)) < 20_000
