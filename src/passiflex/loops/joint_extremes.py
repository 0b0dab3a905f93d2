"""How far the joints of a loop went: positions, speeds, motor torques, and when they passed a limit of the robot."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.layout import Field, Layout
from passiflex.robots.flexible import FlexibleJointRobot

SLACK = 1e-9
"""Share of a limit by which rounding may pass it."""


class LimitNumbers(Protocol):
    """The limits of a robot in symbols, as `JointExtremes.limits` says."""

    lower_position_limit: cs.SX
    upper_position_limit: cs.SX
    velocity_limit: cs.SX
    torque_limit: cs.SX


@dataclass(frozen=True)
class JointExtremes:
    """What is remembered of n joints, and how it goes on with every instant.

    Parameters
    ----------
    n: Joints.
    angle, speed, torque: Units of their quantities.
    motors: Whether the motors' torque is known at every instant.
    """

    n: int
    angle: str
    speed: str
    torque: str
    motors: bool

    @property
    def kinds(self) -> tuple[str, ...]:
        """Return the kinds of limits that are watched."""
        return ("position", "speed", *["torque"] * self.motors)

    @cached_property
    def limits(self) -> Layout:
        """Return the robot's limits."""
        n = self.n
        return Layout(
            (
                Field("lower_position_limit", (n,), self.angle, "of the robot"),
                Field("upper_position_limit", (n,), self.angle, "of the robot"),
                Field("velocity_limit", (n,), self.speed, "of the robot"),
                Field("torque_limit", (n,), self.torque, "of the robot"),
            ),
            LimitNumbers,
        )

    def numbers(self, robot: FlexibleJointRobot) -> NDArray[np.float64]:
        """Return the limits of a robot, which may be infinite."""
        low, high = robot.position_limit.T
        return np.concatenate([low, high, robot.velocity_limit, robot.torque_limit]).astype(float)

    @cached_property
    def layout(self) -> Layout:
        """Return what is remembered."""
        n, fields = self.n, []
        fields += [Field("lowest_q", (n,), self.angle, "least link position")]
        fields += [Field("highest_q", (n,), self.angle, "largest link position")]
        fields += [Field("highest_speed", (n,), self.speed, "largest |q̇|")]
        fields += [Field("highest_torque", (n,), self.torque, "largest |τ_m|")] * self.motors
        for kind in self.kinds:
            first = f"first time beyond a joint's {kind} limit, infinite if never"
            fields.append(Field(f"{kind}_time", (), "s", first))
            fields.append(Field(f"{kind}_joint", (), "1", "which joint that was, from 1"))
        return Layout(tuple(fields))

    def after(
        self,
        w: Any,
        time: cs.SX,
        q: cs.SX,
        dq: cs.SX,
        tau_m: cs.SX | None,
        g: LimitNumbers,
        first: cs.SX,
    ) -> dict[str, cs.SX]:
        """Return the memory after an instant; `first` is 1 if it is the first."""
        speed = cs.fabs(dq)
        values = {
            "lowest_q": cs.fmin(cs.if_else(first, q, w.lowest_q), q),
            "highest_q": cs.fmax(cs.if_else(first, q, w.highest_q), q),
            "highest_speed": cs.fmax(w.highest_speed, speed),
        }
        beyond = {
            "position": cs.fmax(g.lower_position_limit - q, q - g.upper_position_limit),
            "speed": speed - (1 + SLACK) * g.velocity_limit,
        }
        if tau_m is not None:
            values["highest_torque"] = cs.fmax(w.highest_torque, cs.fabs(tau_m))
            beyond["torque"] = cs.fabs(tau_m) - (1 + SLACK) * g.torque_limit
        for kind, excess in beyond.items():
            before = cs.if_else(first, np.inf, getattr(w, f"{kind}_time"))
            joint = cs.SX(0)
            for i in reversed(range(self.n)):
                joint = cs.if_else(excess[i] > 0, i + 1, joint)
            begins = cs.logic_and(joint > 0, before == np.inf)
            values[f"{kind}_time"] = cs.if_else(begins, time, before)
            values[f"{kind}_joint"] = cs.if_else(begins, joint, getattr(w, f"{kind}_joint"))
        return values
