"""An arm with elastic joints and a maker's firmware, by the plant's equations alone, that stands in for a robot."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.loops.plant import Plant
from passiflex.native import NativeFunction, compile_functions
from passiflex.native.python_loop import step_function
from passiflex.onboard import Sensed
from passiflex.robots.flexible import FlexibleJointRobot

Array = NDArray[np.float64]
STEPS = 8
"""Of Runge-Kutta in a period."""


@lru_cache
def _functions(name: str) -> tuple[FlexibleJointRobot, Plant, NativeFunction, NativeFunction]:
    """Return a robot, its plant, one step of it, and its weight (q, p) → (n,)."""
    robot = FlexibleJointRobot.load(name)
    plant = Plant(robot, ())
    q, (p, m) = cs.SX.sym("q", robot.n), robot.layout.symbols("p")
    functions = [
        step_function(plant.rhs),
        cs.Function(
            "weight", [q, p], [cs.vertcat(robot.arm.gravity_torque(q, m), robot.arm.potential_energy(q, m))]
        ),
    ]
    library = compile_functions(functions)
    return robot, plant, *(NativeFunction(f, library) for f in functions)


class ElasticArm:
    """A robot that is told torques, and says what it is asked to.

    Parameters
    ----------
    steps: Of Runge-Kutta in a period.
    carries: Whether its firmware holds its weight, as of a torque-controlled arm's; with gravity in either case.
    """

    def __init__(
        self, name: str, q: list[float], period: float = 1e-3, *, carries: bool = True, steps: int = STEPS
    ):
        self.robot, self.plant, self._step, self._weight = _functions(name)
        self.numbers = self.robot.layout.pack(self.robot.nominal())
        self.period, self.carries, self._steps = period, carries, steps
        self._n = self.robot.n
        self.push = np.zeros(6)
        start, K = np.array(q, dtype=float), self.robot.joint_stiffness
        still = np.concatenate([start, start + self.weight(start) / K, np.zeros(2 * self._n)])
        self._y = np.concatenate([still, np.zeros(self.plant.energies.size)])
        self.told = np.zeros(self._n)
        self._potential_start = self.potential(start)

    @property
    def x(self) -> Array:
        """Return q, θ, q̇, θ̇, to be written to as well."""
        return self._y[: 4 * self._n]

    @property
    def given(self) -> float:
        """Return the energy that the joints gave to the links, less what holding their weight took [J]."""
        return float(self._y[4 * self._n + self.plant.energies.slices["joint"].start]) - self._lifted

    @property
    def _lifted(self) -> float:
        return self.potential(self.x[: self._n]) - self._potential_start

    def weight(self, q: Array) -> Array:
        return np.asarray(self._weight(q, self.numbers))[:-1]

    def potential(self, q: Array) -> float:
        return float(np.asarray(self._weight(q, self.numbers))[-1])

    def move(self, torque: Array) -> None:
        """Go on by a period."""
        self.told = np.array(torque)
        for _ in range(self._steps):
            held = self.told + (self.weight(self.x[: self._n]) if self.carries else 0.0)
            self._y = np.asarray(
                self._step(
                    self._y, np.concatenate([held, self.push]), self.numbers, self.period / self._steps
                )
            )

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
