"""A flexible-joint robot as MJCF, the model files of MuJoCo: exact in every number.

World axes are those of the robot's base, as everywhere here; gravity is tilted where the base is. A link is a body in
the tree. A motor is a rotor beside it, and turns in the joint's own coordinate, seen through the gear: of its inertia B
half is in its body and half is armature. Between the two is a tendon θ − q with stiffness K and damping D.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from passiflex.robots.bodies import Body, components, from_origin, matrix, rotation_of, triangle_defect
from passiflex.robots.chain import SerialChain
from passiflex.robots.flexible import FlexibleJointRobot

Array = NDArray[np.float64]

RK4, IMPLICIT = "RK4", "implicitfast"
TOUCHING = 1e-9
"""Share by which a principal moment stays below the sum of the others, so that rounding does not pass it."""
APART = 0.15
"""From one rotor to the next, where they stand for the eye [m]."""
THIN, DOT = 0.03, 0.015
"""Radii of what is drawn of links and end effector [m]."""


class Options(NamedTuple):
    """How MuJoCo takes its steps.

    Attributes
    ----------
    step: [s].
    contact: Whether anything can touch.
    """

    step: float
    integrator: str = RK4
    contact: bool = False


class Piece(NamedTuple):
    """What an element adds to a model.

    Attributes
    ----------
    world: Bodies and geoms in the world.
    tip: Geoms in the axes of the end effector.
    rest: Tags of their own at the top level, as pairs of geoms that touch.
    """

    world: str = ""
    tip: str = ""
    rest: str = ""


def mjcf(
    robot: FlexibleJointRobot,
    numbers: Mapping[str, Any],
    options: Options,
    pieces: Sequence[Piece] = (),
    start: tuple[Array, Array] | None = None,
) -> str:
    """Return the model file of a robot.

    Coordinates are the motors' θ, then the links' q, then those of the pieces; controls are the motor torques, then
    F_e, the wrench on the end effector in world axes.

    Parameters
    ----------
    numbers: Of the robot, as `FlexibleJointRobot.layout` has them.
    start: q and θ (n,) of a keyframe "start".
    """
    chain = robot.arm.chain
    touch = "enable" if options.contact else "disable"
    out = [
        f'<mujoco model="{_escaped(robot.name)}">',
        '<compiler angle="radian" autolimits="false" inertiafromgeom="false" balanceinertia="false"/>',
        f'<option integrator="{options.integrator}" timestep="{options.step!r}" gravity="{said(numbers["gravity"])}"'
        ' cone="elliptic" impratio="1e6">',
        f'  <flag contact="{touch}" constraint="{touch}" autoreset="disable"/>',
        "</option>",
        '<default><geom density="0" contype="0" conaffinity="0"/></default>',
        "<worldbody>",
        '  <light pos="0 0 3" dir="0 0 -1"/>',
        '  <site name="world"/>',
    ]
    out += _rotors(chain, numbers)
    out += _links(chain, numbers)
    tip = f'pos="{said(numbers["tool_position"])}" quat="{quaternion(numbers["tool_rotation"])}"'
    out += [
        f'<site name="tip" {tip} size="{DOT}"/>',
        f'<body name="hand" {tip}>{"".join(piece.tip for piece in pieces)}</body>',
        "</body>" * chain.n,
        *(piece.world for piece in pieces),
        "</worldbody>",
        "<tendon>",
    ]
    for i, (k, d) in enumerate(
        zip(numbers["joint_stiffness"], numbers["joint_damping"], strict=True), start=1
    ):
        out.append(
            f'<fixed name="spring_{i}" stiffness="{said(k)}" damping="{said(d)}" springlength="0">'
            f'<joint joint="motor_{i}" coef="1"/><joint joint="joint_{i}" coef="-1"/></fixed>'
        )
    out += ["</tendon>", *(piece.rest for piece in pieces), "<actuator>"]
    out += [f'<motor name="tau_m_{i}" joint="motor_{i}"/>' for i in range(1, chain.n + 1)]
    for name, axis in zip(("fx", "fy", "fz", "mx", "my", "mz"), np.eye(6), strict=True):
        out.append(f'<general name="{name}" site="tip" refsite="world" gear="{said(axis)}"/>')
    out.append("</actuator>")
    if start is not None:
        q, theta = start
        out.append(f'<keyframe><key name="start" qpos="{said(np.concatenate([theta, q]))}"/></keyframe>')
    return "\n".join([*out, "</mujoco>"]) + "\n"


def _rotors(chain: SerialChain, numbers: Mapping[str, Any]) -> list[str]:
    out = []
    for i, (joint, b) in enumerate(zip(chain.joints, numbers["motor_inertia"], strict=True), start=1):
        kind = "slide" if joint.kind == "prismatic" else "hinge"
        mass, turning = (b / 2, 1.0) if kind == "slide" else (1.0, b / 2)
        out.append(
            f'<body name="rotor_{i}" pos="{said([-0.3, APART * i, 0])}" gravcomp="1">'
            f'<joint name="motor_{i}" type="{kind}" axis="0 0 1" armature="{said(b / 2)}"/>'
            f'<inertial pos="0 0 0" mass="{said(mass)}" diaginertia="{said([turning] * 3)}"/>'
            f'<geom type="box" size="0.03 0.05 0.01" rgba="0.8 0.5 0.2 1"/></body>'
        )
    return out


def _links(chain: SerialChain, numbers: Mapping[str, Any]) -> list[str]:
    out = []
    nexts = [*(joint.xyz for joint in chain.joints[1:]), numbers["tool_position"]]
    for i, (joint, ahead) in enumerate(zip(chain.joints, nexts, strict=True)):
        body = link_body(numbers, i)
        xx, xy, xz, yy, yz, zz = possible(body.inertia)
        kind = "slide" if joint.kind == "prismatic" else "hinge"
        out.append(
            f'<body name="link_{i + 1}" pos="{said(joint.xyz)}" quat="{quaternion(rotation_of(joint.rpy))}">'
            f'<joint name="joint_{i + 1}" type="{kind}" axis="{said(joint.axis)}"/>'
            f'<inertial pos="{said(body.com)}" mass="{said(body.mass)}"'
            f' fullinertia="{said([xx, yy, zz, xy, xz, yz])}"/>'
        )
        if np.linalg.norm(ahead) > THIN:
            out.append(f'<geom type="capsule" fromto="0 0 0 {said(ahead)}" size="{THIN}"/>')
    return out


def link_body(numbers: Mapping[str, Any], i: int) -> Body:
    """Return a link, counted from 0, of the numbers of a robot."""
    return from_origin(numbers["link_mass"][i], numbers["link_moment"][i], numbers["link_inertia"][i])


def cut_inertias(robot: FlexibleJointRobot, numbers: Mapping[str, Any]) -> list[str]:
    """Return a line on each link whose inertia is not that of its `possible` one."""
    out = []
    for i, joint in enumerate(robot.arm.chain.joints):
        if moments := triangle_defect(link_body(numbers, i)):
            out.append(
                f"the link moved by joint {joint.name!r} has principal moments that no body has, {moments}"
            )
    return out


def possible(inertia: Array) -> Array:
    """Return an inertia that MuJoCo takes: itself, or with its largest principal moment cut to the sum of the others.

    Descriptions of real arms have some that no distribution of mass has.
    """
    moments, axes = np.linalg.eigh(matrix(inertia))
    if moments[2] <= (most := (moments[0] + moments[1]) * (1 - TOUCHING)):
        return inertia
    moments[2] = most
    return components(axes @ np.diag(moments) @ axes.T)


def quaternion(R: Array) -> str:
    """Return a rotation matrix as MJCF has it."""
    x, y, z, w = Rotation.from_matrix(R).as_quat()
    return said([w, x, y, z])


def said(values: ArrayLike) -> str:
    """Return numbers that read back exactly."""
    return " ".join(repr(float(v)) for v in np.ravel(values))


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
