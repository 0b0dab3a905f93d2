"""An arm with elastic joints and a maker's firmware, by the plant's equations alone, that stands in for a robot."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.loops.plant import Plant
from passiflex.native import NativeFunction
from passiflex.onboard import Sensed
from passiflex.robots.flexible import FlexibleJointRobot

Array = NDArray[np.float64]
STEPS = 8
"""Of Runge-Kutta in a period."""


class ElasticArm:
    """A robot that is told torques, and says what it is asked to.

    Parameters
    ----------
    carries: Whether its firmware holds its weight, as of a torque-controlled arm's; with gravity in either case.
    """

    def __init__(self, name: str, q: list[float], period: float = 1e-3, *, carries: bool = True):
        self.robot = FlexibleJointRobot.load(name)
        self.plant = Plant(self.robot, ())
        self.numbers = self.robot.layout.pack(self.robot.nominal())
        self.period, self.carries = period, carries
        self._rhs = NativeFunction(self.plant.rhs)
        self._n = self.robot.n
        self.push = np.zeros(6)
        start, K = np.array(q, dtype=float), self.robot.joint_stiffness
        self.x = np.concatenate([start, start + self.weight(start) / K, np.zeros(2 * self._n)])
        self.told = np.zeros(self._n)

    def weight(self, q: Array) -> Array:
        from passiflex.control.posture import posture

        return posture(self.robot, q, self.robot.layout.unpack(self.numbers)).gravity_torque

    def move(self, torque: Array) -> None:
        """Go on by a period."""
        self.told = np.array(torque)
        n, h = self._n, self.period / STEPS

        def slope(x: Array) -> Array:
            given = self.told + (self.weight(x[:n]) if self.carries else 0.0)
            rate, _ = self._rhs(x, np.concatenate([given, self.push]), self.numbers)
            return rate

        for _ in range(STEPS):
            a = slope(self.x)
            b = slope(self.x + h / 2 * a)
            c = slope(self.x + h / 2 * b)
            d = slope(self.x + h * c)
            self.x = self.x + h / 6 * (a + 2 * b + 2 * c + d)

    def said(self, *names: str) -> Sensed:
        """Return what it says of itself, by names."""
        n = self._n
        q, theta, dq, dtheta = (self.x[i * n : (i + 1) * n] for i in range(4))
        K, D = self.robot.joint_stiffness, self.robot.joint_damping
        everything: dict[str, Any] = {
            "q": q,
            "theta": theta,
            "dq": dq,
            "dtheta": dtheta,
            "tau_a": K * (theta - q) + D * (dtheta - dq),
            "applied": self.told,
        }
        return Sensed(**{name: everything[name].copy() for name in names})

    @property
    def hand(self) -> Array:
        from passiflex.control.posture import posture

        return posture(self.robot, self.x[: self._n], self.robot.layout.unpack(self.numbers)).pose.position
