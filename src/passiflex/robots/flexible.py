"""The flexible-joint robot (2): a rigid arm whose motors act through springs and dampers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import NamedTuple, Protocol

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.errors import SizeError, ValueRangeError
from passiflex.layout import Field, Layout
from passiflex.robots.arm import ArmNumbers, SerialArm, TipWrench
from passiflex.robots.catalogue import RobotDescription, read_description
from passiflex.robots.linear_algebra import solve_spd


class RobotNumbers(ArmNumbers, Protocol):
    """The physical parameters of a robot in symbols, as `FlexibleJointRobot.layout` says."""

    joint_stiffness: cs.SX
    joint_damping: cs.SX
    motor_inertia: cs.SX


class RobotState(NamedTuple):
    """Link and motor coordinates and their velocities, each (n,)."""

    q: cs.SX
    theta: cs.SX
    dq: cs.SX
    dtheta: cs.SX


class Acceleration(NamedTuple):
    """Link and motor accelerations, and the joint torque that couples them."""

    ddq: cs.SX
    ddtheta: cs.SX
    tau_a: cs.SX


@dataclass(frozen=True, eq=False)
class FlexibleJointRobot:
    """A serial arm with elastic, damped joints: Spong's model (2).

        M(q) q̈ + C(q, q̇) q̇ + ∇V(q) = τ_a + τ_e
        B θ̈ + τ_a = τ_m
        τ_a = K (θ − q) + D (θ̇ − q̇)

    τ_a is the torque through the joint, positive on the link. K, D, B are diagonal.

    Attributes
    ----------
    arm: The rigid links.
    joint_stiffness, joint_damping, motor_inertia: K [N m/rad], D [N m s/rad], B [kg m²], (n,).
    torque_limit, velocity_limit, position_limit: [N m], [rad/s], [rad]; (n,), (n,), (n, 2).
    sources: Where each number comes from, or the word *assumed*.
    ranges: Shares of an entry's numbers between which the true ones may be, where that was said.
    sensed: Whether it measures the torque in its joints.
    """

    name: str
    arm: SerialArm
    joint_stiffness: NDArray[np.float64]
    joint_damping: NDArray[np.float64]
    motor_inertia: NDArray[np.float64]
    torque_limit: NDArray[np.float64]
    velocity_limit: NDArray[np.float64]
    position_limit: NDArray[np.float64]
    sources: Mapping[str, str] = field(default_factory=dict)
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    sensed: bool = True

    def __post_init__(self) -> None:
        for name in ("joint_stiffness", "joint_damping", "motor_inertia"):
            value, unit = getattr(self, name), {f.name: f.unit for f in self.layout}[name]
            if np.shape(value) != (self.n,):
                raise SizeError(
                    f"{name} of robot {self.name!r}", got=np.shape(value), needs=f"({self.n},) in {unit}"
                )
            if not (np.isfinite(value) & (np.asarray(value) > 0)).all():
                raise ValueRangeError(
                    f"{name} of robot {self.name!r}", got=value, needs=f"positive numbers in {unit}"
                )

    @classmethod
    def load(cls, name: str | Path = "iiwa14") -> FlexibleJointRobot:
        """Return a robot of the catalogue by name, or the user's own by the path of its file.

        It is the same object, with read-only arrays, until one of its files changes.

        Raises
        ------
        NameUnknownError, RobotError
            If there is no such robot, or its description is not usable.
        """
        return _built(read_description(name))

    def assumed(self, entry: str) -> bool:
        """Return whether an entry of the robot file is an assumption: its source begins with that word."""
        return self.sources.get(entry, "").lower().startswith("assumed")

    @property
    def n(self) -> int:
        """Return the number of joints."""
        return self.arm.n

    @cached_property
    def layout(self) -> Layout:
        """Return all physical parameters: the arm's, then K, D, B."""
        n = self.n
        joints = (
            Field("joint_stiffness", (n,), "N m/rad", "K"),
            Field("joint_damping", (n,), "N m s/rad", "D"),
            Field("motor_inertia", (n,), "kg m^2", "B, reflected through the gear"),
        )
        return Layout(self.arm.layout.fields + joints, RobotNumbers)

    def nominal(self, gravity: tuple[float, float, float] | None = None) -> dict[str, np.ndarray]:
        """Return the robot's own numbers for `layout`, with the gravity [m/s²] of its mount unless another is given."""
        return self.arm.nominal(gravity) | {
            "joint_stiffness": np.array(self.joint_stiffness),
            "joint_damping": np.array(self.joint_damping),
            "motor_inertia": np.array(self.motor_inertia),
        }

    def joint_torque(self, x: RobotState, m: RobotNumbers) -> cs.SX:
        """Return τ_a = K (θ − q) + D (θ̇ − q̇) [N m], the last line of (2)."""
        return m.joint_stiffness * (x.theta - x.q) + m.joint_damping * (x.dtheta - x.dq)

    def acceleration(
        self,
        x: RobotState,
        tau_m: cs.SX,
        external: cs.SX | TipWrench,
        m: RobotNumbers,
        beside: cs.SX | float = 0,
    ) -> Acceleration:
        """Return q̈, θ̈ of (2) under the motor torque τ_m [N m] and what acts from outside.

        Parameters
        ----------
        external: The joint torque τ_e (n,) [N m]; or the wrench on the end effector that makes it, which is cheaper.
        beside: Joint torque that acts on the links beside it (n,) [N m].
        """
        tau_a, arm = self.joint_torque(x, m), self.arm
        at_tip = external if isinstance(external, TipWrench) else None
        driving = tau_a - arm.bias_torque(x.q, x.dq, m, at_tip) + (0 if at_tip else external) + beside
        ddq = solve_spd(arm.mass_matrix(x.q, m), driving)
        return Acceleration(ddq, (tau_m - tau_a) / m.motor_inertia, tau_a)


@lru_cache(maxsize=32)
def _built(d: RobotDescription) -> FlexibleJointRobot:
    """Return the robot of a description; the same for the same one, as functions are compiled for its arm."""
    return FlexibleJointRobot(
        name=d.name,
        arm=SerialArm(d.chain),
        joint_stiffness=d.stiffness,
        joint_damping=d.damping,
        motor_inertia=d.motor_inertia,
        torque_limit=d.torque_limit,
        velocity_limit=d.velocity_limit,
        position_limit=d.position_limit,
        sources=d.sources,
        ranges=d.ranges,
        sensed=d.sensed,
    )
