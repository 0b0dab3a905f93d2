"""What a robot says in a period, completed to what its law is told, without the weight that its firmware carries."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

import casadi as cs

from passiflex.control.signals import Measurement
from passiflex.layout import Field, Layout
from passiflex.onboard.sensed import Sensed
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.sampled.said import Given, filled
from passiflex.sampled.sayable import SAYABLE

SAID = Sensed._fields
"""What a robot may say."""


def said_layout(robot: FlexibleJointRobot) -> Layout:
    """Return what a robot says in one period; what it does not say is not looked at."""
    n, (angle, speed, torque) = robot.n, robot.arm.chain.joint_units
    return Layout(
        (
            Field("q", (n,), angle, "link position"),
            Field("theta", (n,), angle, "motor position, seen from the link"),
            Field("dq", (n,), speed, "link velocity"),
            Field("dtheta", (n,), speed, "motor velocity"),
            Field("tau_a", (n,), torque, "torque through the joint, positive on the link"),
            Field("F_e", (6,), "N, N m", "wrench on the end effector, world axes", axes=("component",)),
            Field("applied", (n,), torque, "torque that the motors were really given in the period before"),
            Field("elapsed", (), "s", "since the last period"),
        )
    )


def robot_layout(n: int) -> Layout:
    """Return the numbers that say what a robot says."""
    says = (Field(f"says_{name}", (), "1", f"1 if the robot says {name}") for name in SAID)
    return Layout(
        (
            *says,
            Field("weight", (3,), "m/s^2", "gravity that its readings contain and the law does not know"),
            Field("velocity_pole", (), "rad/s", "of the low-pass of differences"),
        )
    )


class Completed(NamedTuple):
    """A whole measurement, what is remembered of it, and the weight that was taken out of it (n,) N m."""

    measured: Measurement
    state: cs.SX
    weight: cs.SX


def completed(said: Any, robot: FlexibleJointRobot, model: Any, g: Any, s: Any, applied: cs.SX) -> Completed:
    """Return what a law is told of what a robot says.

    Parameters
    ----------
    said: By name, as `said_layout`.
    model, g: Numbers of the law's model, and of `robot_layout`, by name.
    s: State, by name.
    applied: Torque that the motors were last told (n,) N m.
    """
    weighed = SimpleNamespace(**{**vars(model), "gravity": g.weight})
    near = cs.if_else(g.says_q > 0, said.q, said.theta)  # the weight hardly differs by the joints' give
    weight = robot.arm.gravity_torque(near, weighed)
    says = {name: getattr(g, f"says_{name}") for name in SAYABLE}
    joints = filled(
        said, says, Given(model.joint_stiffness, weight, g.velocity_pole, said.elapsed, applied), s
    )
    F_e = cs.if_else(g.says_F_e > 0, said.F_e, 0)
    tau_e = robot.arm.jacobian(joints.q, model).T @ F_e
    told = {name: getattr(joints, name) for name in SAYABLE}
    return Completed(Measurement(**told, F_e=F_e, tau_e=tau_e), joints.state, weight)
