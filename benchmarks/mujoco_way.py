"""The plant in MuJoCo: a hinge for each link and each motor, and a sprung, damped tendon between the two."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from passiflex.problems.problem import SampledProblem
from passiflex.robots.bodies import from_origin, rotation_of
from passiflex.simulation import Problem

Array = NDArray[np.float64]


class MujocoPlant:
    """The robot of a problem, from rest at its start; a call holds torques and wrench for a period.

    Parameters
    ----------
    integrator: "RK4" or "implicitfast".
    steps: Of the integrator, per period.
    """

    def __init__(self, problem: Problem, integrator: str, steps: int):
        assert isinstance(problem, SampledProblem)
        self.n, self.steps = problem.law.robot.n, steps
        text = mjcf(problem, integrator, problem.period / steps)
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        at = [self.model.joint(f"joint_{i}").qposadr[0] for i in range(1, self.n + 1)]
        self.links, self.motors = np.array(at), np.arange(self.n)
        self.data.qpos[self.links], self.data.qpos[self.motors] = problem.q, problem.theta

    def state(self) -> tuple[Array, Array, Array, Array]:
        """Return q, θ, q̇, θ̇."""
        where, speed = self.data.qpos, self.data.qvel
        return where[self.links], where[self.motors], speed[self.links], speed[self.motors]

    def __call__(self, tau_m: Array, F_e: Array) -> None:
        self.data.ctrl[: self.n], self.data.ctrl[self.n :] = tau_m, F_e
        mujoco.mj_step(self.model, self.data, self.steps)


def mjcf(problem: Problem, integrator: str, step: float) -> str:
    """Return the robot as MJCF. A motor is a rotor of inertia B: half in its body, half as armature."""
    robot = problem.law.robot
    chain, of = robot.arm.chain, robot.layout.unpack(problem.plant)
    out = [
        '<mujoco><compiler angle="radian" autolimits="false" inertiafromgeom="false" balanceinertia="false"/>',
        f'<option integrator="{integrator}" timestep="{step!r}" gravity="{numbers(of["gravity"])}">',
        '<flag contact="disable" constraint="disable" autoreset="disable"/></option><worldbody><site name="world"/>',
    ]
    for i, b in enumerate(of["motor_inertia"].tolist(), start=1):
        out.append(
            f'<body name="rotor_{i}" pos="{i} 0 5" gravcomp="1"><joint name="motor_{i}" axis="0 0 1"'
            f' armature="{b / 2!r}"/><inertial pos="0 0 0" mass="1" diaginertia="{numbers(np.full(3, b / 2))}"/></body>'
        )
    for i, joint in enumerate(chain.joints):
        body = from_origin(of["link_mass"][i], of["link_moment"][i], of["link_inertia"][i])
        xx, xy, xz, yy, yz, zz = body.inertia
        out.append(
            f'<body pos="{numbers(joint.xyz)}" quat="{quaternion(rotation_of(joint.rpy))}">'
            f'<inertial pos="{numbers(body.com)}" mass="{float(body.mass)!r}"'
            f' fullinertia="{numbers(np.array([xx, yy, zz, xy, xz, yz]))}"/>'
            f'<joint name="joint_{i + 1}" type="hinge" axis="{numbers(joint.axis)}"/>'
        )
    tip = f'<site name="tip" pos="{numbers(of["tool_position"])}" quat="{quaternion(of["tool_rotation"])}"/>'
    out.append(tip + "</body>" * chain.n + "</worldbody><tendon>")
    for i, (k, d) in enumerate(zip(of["joint_stiffness"], of["joint_damping"], strict=True), start=1):
        out.append(
            f'<fixed stiffness="{float(k)!r} 0 0" damping="{float(d)!r} 0 0" springlength="0">'
            f'<joint joint="motor_{i}" coef="1"/><joint joint="joint_{i}" coef="-1"/></fixed>'
        )
    out.append("</tendon><actuator>")
    out += [f'<motor joint="motor_{i}"/>' for i in range(1, chain.n + 1)]
    out += [f'<general site="tip" refsite="world" gear="{numbers(axis)}"/>' for axis in np.eye(6)]
    return "\n".join([*out, "</actuator></mujoco>"])


def quaternion(R: Array) -> str:
    q = np.zeros(4)
    mujoco.mju_mat2Quat(q, np.ascontiguousarray(R).ravel())
    return numbers(q)


def numbers(values: Array) -> str:
    return " ".join(repr(float(v)) for v in np.ravel(values))
