"""Documents as they are in the world, each with one oddity and one with all: as Pinocchio reads the original file."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import reduce
from pathlib import Path

import casadi as cs
import numpy as np
import pinocchio as pin
import pytest

from passiflex.robots.arm import SerialArm
from passiflex.robots.chain import SerialChain, read_chain

PLAIN = """<?xml version="1.0"?>
<robot name="odd">
  <link name="floor"/>
  <joint name="turn" type="revolute"><parent link="floor"/><child link="column"/>
    <origin xyz="0.02 -0.01 0.25" rpy="0.1 -0.2 0.3"/><axis xyz="0 0 1"/>
    <limit lower="-2.5" upper="2.5" velocity="2" effort="60"/></joint>
  <link name="column"><inertial><origin xyz="0.01 0.04 0.09" rpy="0.2 0.1 -0.3"/><mass value="3.1"/>
    <inertia ixx="0.031" ixy="0.002" ixz="-0.001" iyy="0.029" iyz="0.003" izz="0.017"/></inertial></link>
  <joint name="lift" type="prismatic"><parent link="column"/><child link="boom"/>
    <origin xyz="0.1 0 0.2" rpy="-0.4 0.7 0.2"/><axis xyz="1 -2 0.5"/>
    <limit lower="-0.3" upper="0.4" velocity="1" effort="400"/></joint>
  <link name="boom"><inertial><origin xyz="0.15 -0.02 0.01" rpy="0 0 0"/><mass value="2.2"/>
    <inertia ixx="0.011" ixy="-0.001" ixz="0.002" iyy="0.025" iyz="0" izz="0.026"/></inertial></link>
  <joint name="bend" type="revolute"><parent link="boom"/><child link="wrist"/>
    <origin xyz="0.3 0.05 -0.02" rpy="0.3 -0.4 0.7"/><axis xyz="0 -1 0"/>
    <limit lower="-2" upper="2" velocity="3" effort="20"/></joint>
  <link name="wrist"><inertial><origin xyz="0 0.03 0.06" rpy="0.5 -0.6 0.1"/><mass value="0.9"/>
    <inertia ixx="0.004" ixy="0.0003" ixz="0.0002" iyy="0.0045" iyz="-0.0001" izz="0.003"/></inertial></link>
  <joint name="mount" type="fixed"><parent link="wrist"/><child link="tool"/>
    <origin xyz="0.01 0.02 0.12" rpy="0.3 0.2 0.1"/></joint>
  <link name="tool"><inertial><origin xyz="0.01 0 0.03" rpy="0 0.2 0"/><mass value="0.4"/>
    <inertia ixx="0.0004" ixy="0" ixz="0" iyy="0.0005" iyz="0" izz="0.0003"/></inertial></link>
</robot>
"""
Change = Callable[[str], str]


def put(old: str, new: str) -> Change:
    """Return the change of the one place where `old` stands."""

    def change(urdf: str) -> str:
        assert urdf.count(old) == 1, old
        return urdf.replace(old, new)

    return change


def before_the_end(xml: str) -> Change:
    return put("</robot>", f"{xml}</robot>")


ODDITIES: dict[str, Change] = {
    "quaternion of a joint": lambda urdf: put('rpy="-0.4 0.7 0.2"', 'quat_xyzw="0.1 -0.3 0.5 0.8"')(
        urdf.replace("<robot ", '<robot version="1.1" ')
    ),
    "quaternion of a mass": lambda urdf: put('rpy="0.5 -0.6 0.1"', 'quat_xyzw="1 2 -3 4"')(
        urdf.replace("<robot ", '<robot version="1.2" ')
    ),
    "quaternion of a tool": lambda urdf: put('rpy="0.3 0.2 0.1"', 'quat_xyzw="0 0 0.6 0.8"')(
        urdf.replace("<robot ", '<robot version="1.1" ')
    ),
    "version": put("<robot ", '<robot version="1.0" '),
    "default namespace": put("<robot ", '<robot xmlns="http://www.ros.org" '),
    "prefix without declaration": put(
        '<limit lower="-2.5"', '<drake:gear ratio="${g}"/><limit drake:acceleration="3" lower="-2.5"'
    ),
    "simulator": before_the_end(
        '<gazebo reference="tool"><sensor:camera name="$(find it)"/><xacro:old p="${q}"/><link name="no"/></gazebo>'
    ),
    "drivers": before_the_end(
        '<ros2_control name="x" type="system"><param name="p">${2*pi}</param></ros2_control>'
    ),
    "comment": before_the_end(
        "<!-- <!DOCTYPE robot [<!ENTITY a 'b'>]> ${x} $(find y) <xacro:if> <joint> -->"
    ),
    "literal text": before_the_end("<gazebo><![CDATA[<!DOCTYPE x> ${y} </link>]]></gazebo>"),
    "meshes": put(
        '<link name="tool">',
        '<link name="tool"><visual><origin xyz="1 1" rpi="0"/><geometry><mesh filename="${HOME}/a b.stl"/>'
        "</geometry></visual><collision><pose>1</pose></collision>",
    ),
    "mimic of a fixed joint": put('type="fixed">', 'type="fixed"><mimic joint="turn" multiplier="2"/>'),
    "limit of a fixed joint": put(
        'type="fixed">', 'type="fixed"><limit lower="1" upper="-1" effort="0" velocity="0"/>'
    ),
    "no axis": put('<axis xyz="0 0 1"/>', ""),
    "no origin": put('<origin xyz="0.3 0.05 -0.02" rpy="0.3 -0.4 0.7"/>', ""),
    "empty origin": put('<origin xyz="0.01 0.02 0.12" rpy="0.3 0.2 0.1"/>', "<origin/>"),
    "half an origin": put(' rpy="0.2 0.1 -0.3"', ""),
    "long axis": put('xyz="1 -2 0.5"', 'xyz="1e3 -2e3 5e2"'),
    "signs and exponents": put('value="2.2"', 'value="+22.e-1"'),
    "spaces": put('xyz="0.15 -0.02 0.01"', 'xyz="  0.15   -0.02 0.01 "'),
    "order": lambda urdf: put("</robot>", '<link name="floor"/></robot>')(
        put('  <link name="floor"/>\n', "")(urdf)
    ),
    "two origins": put(
        '</joint>\n  <link name="tool">', '<origin xyz="9 9 9"/></joint>\n  <link name="tool">'
    ),
    "degrees": put('rpy="0.3 -0.4 0.7"', 'rpy="0 90 -45"'),
    "damping": put(
        '<axis xyz="0 -1 0"/>', '<axis xyz="0 -1 0" rpy="0 0 0"/><dynamics damping="2" friction="1"/>'
    ),
    "names": lambda urdf: urdf.replace('"boom"', '"Arm größer &lt; 2"').replace('"turn"', '"joint/1 (q₁)"'),
    "side branch": before_the_end(
        '<link name="camera"><inertial><mass value="0.2"/><origin xyz="0 0.1 0"/><inertia ixx="0.001" ixy="0" ixz="0" '
        'iyy="0.001" iyz="0" izz="0.001"/></inertial></link><joint name="eye" type="fixed"><origin rpy="1 2 3"/>'
        '<parent link="boom"/><child link="camera"/></joint>'
    ),
}
ALONE = {"quaternion of a mass", "quaternion of a tool", "version", "names", "order", "no axis", "no origin"}
"""What cannot be put together with another one that is there."""


def ours(chain: SerialChain, q: np.ndarray, dq: np.ndarray) -> dict[str, np.ndarray]:
    arm = SerialArm(chain)
    x, dx, vector = cs.SX.sym("q", arm.n), cs.SX.sym("dq", arm.n), arm.layout.pack(arm.nominal())
    symbols, m = arm.layout.symbols("m")
    pose = arm.pose(x, m)
    named = {
        "M": arm.mass_matrix(x, m),
        "gravity": arm.gravity_torque(x, m),
        "C dq": arm.coriolis_torque(x, dx, m),
        "position": pose.position,
        "rotation": pose.rotation,
        "J": arm.jacobian(x, m),
    }
    f = cs.Function("f", [x, dx, symbols], list(named.values()))
    return dict(zip(named, (np.array(v) for v in f(q, dq, vector)), strict=True))


def theirs(file: Path, q: np.ndarray, dq: np.ndarray) -> dict[str, np.ndarray]:
    model = pin.buildModelFromUrdf(str(file))
    data, tool = model.createData(), model.getFrameId("tool")
    M = pin.crba(model, data, q)
    gravity = pin.computeGeneralizedGravity(model, data, q).copy()
    coriolis = pin.nonLinearEffects(model, data, q, dq) - gravity
    J = pin.computeFrameJacobian(model, data, q, tool, pin.LOCAL_WORLD_ALIGNED)
    pin.framesForwardKinematics(model, data, q)
    return {
        "M": np.triu(M) + np.triu(M, 1).T,
        "gravity": gravity[:, None],
        "C dq": coriolis[:, None],
        "position": data.oMf[tool].translation[:, None],
        "rotation": data.oMf[tool].rotation,
        "J": J,
    }


def check(source: str | Path, original: Path) -> None:
    """Compare what is made of a source with what Pinocchio makes of a file."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        chain = SerialChain.from_urdf(source, "tool")
    rng = np.random.default_rng(3)
    q, dq = rng.uniform(-1.5, 1.5, (2, 3))
    found, right = ours(chain, q, dq), theirs(original, q, dq)
    for name, value in right.items():
        np.testing.assert_allclose(
            found[name], value, rtol=0, atol=1e-12 * max(1, np.abs(value).max()), err_msg=name
        )


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "odd.urdf"


@pytest.mark.parametrize("change", [*ODDITIES.values(), lambda urdf: urdf], ids=[*ODDITIES, "none"])
def test_a_document_with_one_oddity_is_read_as_pinocchio_reads_it(change: Change, file: Path) -> None:
    file.write_text(change(PLAIN), encoding="utf-8")
    check(file, file)
    check(file.read_text(encoding="utf-8"), file)


def test_so_is_one_with_all_of_them(file: Path) -> None:
    together = [change for name, change in ODDITIES.items() if name not in ALONE]
    assert len(together) >= 18
    file.write_text(reduce(lambda urdf, change: change(urdf), together, PLAIN), encoding="utf-8")
    check(file, file)


@pytest.mark.parametrize(
    ("encoding", "declared"),
    [
        ("iso-8859-1", "ISO-8859-1"),
        ("cp1252", "windows-1252"),
        ("gb2312", "gb2312"),
        ("utf-8-sig", None),
        ("utf-8-sig", "UTF-8"),
        ("utf-16", "UTF-8"),  # as PowerShell writes what xacro prints
        ("utf-16-be", None),
        ("utf-16-le", "UTF-16"),
        ("utf-8", "UTF-16"),
    ],
)
def test_the_encoding_of_a_file_is_of_no_consequence(encoding: str, declared: str | None, file: Path) -> None:
    """Pinocchio is given the same text in UTF-8, the only encoding that TinyXML knows."""
    name = "关节" if encoding == "gb2312" else "größer"
    urdf = PLAIN.replace('"boom"', f'"{name}"')
    file.write_text(urdf, encoding="utf-8")
    head = f'<?xml version="1.0" encoding="{declared}"?>' if declared else ""
    other = file.with_name("other.urdf")
    other.write_bytes(urdf.replace('<?xml version="1.0"?>', head).replace("\n", "\r\n").encode(encoding))
    check(other, file)


@pytest.mark.parametrize("before", ["\n\n  ", "\ufeff", "\ufeff \n"])
def test_a_text_may_begin_with_what_an_editor_puts_there(before: str, file: Path) -> None:
    file.write_text(PLAIN, encoding="utf-8")
    check(before + PLAIN, file)


@pytest.mark.parametrize(
    ("changes", "remarks"),
    [
        (("degrees",), ["joint 'bend': rpy looks like degrees, and is read as rad"]),
        (
            ("damping",),
            [
                "joint 'bend': <dynamics> is ignored; joint_damping of the robot file and friction of a "
                "scenario's motors stand for it"
            ],
        ),
        (
            ("two origins",),
            ["joint 'mount' has 2 <origin>: the first one counts, as for other readers of URDF"],
        ),
        ((), []),
        (("meshes", "mimic of a fixed joint", "limit of a fixed joint", "version"), []),
    ],
)
def test_what_a_document_can_hardly_mean_is_said(changes: tuple[str, ...], remarks: list[str]) -> None:
    urdf = reduce(lambda urdf, name: ODDITIES[name](urdf), changes, PLAIN)
    assert list(read_chain(urdf).remarks) == remarks


def test_moments_that_no_body_has_are_said_with_the_name_of_their_link() -> None:
    urdf = put('izz="0.026"', 'izz="26"')(PLAIN)
    with pytest.warns(
        match="^link 'boom' has principal moments that no body has: .* a decimal point may be missing"
    ):
        SerialChain.from_urdf(urdf)
    plate = 'ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.02{}"'
    inertia = PLAIN[PLAIN.index('ixx="0.011"') : PLAIN.index('izz="0.026"') + len('izz="0.026"')]
    for digits, said in (
        ("", 0),
        ("002", 0),
        ("003", 1),
    ):  # a few digits, as they are printed, are no mistake
        assert len(read_chain(put(inertia, plate.format(digits))(PLAIN)).remarks) == said
