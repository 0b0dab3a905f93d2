"""The plant in Pinocchio and NumPy, from sample to sample by `scipy.integrate.solve_ivp`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import plain
from passiflex.problems.problem import SampledProblem
from passiflex.simulation import Problem

Array = NDArray[np.float64]


class ScipyPlant:
    """The robot of a problem, from rest at its start; a call holds torques and wrench for a period."""

    def __init__(self, problem: Problem, method: str, rtol: float, atol: float):
        assert isinstance(problem, SampledProblem)
        robot = problem.law.robot
        self.robot = plain.Robot(robot.arm.chain.to_urdf(), robot.layout.unpack(problem.plant))
        self.n, self.period = robot.n, problem.period
        self.x = np.concatenate([problem.q, problem.theta, np.zeros(2 * robot.n)])
        self.options = {"method": method, "rtol": rtol, "atol": atol}
        self.tau_m, self.F_e, self.calls = np.zeros(robot.n), np.zeros(6), 0

    def state(self) -> tuple[Array, Array, Array, Array]:
        """Return q, θ, q̇, θ̇."""
        q, theta, dq, dtheta = self.x.reshape(4, self.n)
        return q, theta, dq, dtheta

    def slope(self, _t: float, x: Array) -> Array:
        """Return ẋ of (2)."""
        q, theta, dq, dtheta = x.reshape(4, self.n)
        robot = self.robot
        tau_a = robot.K * (theta - q) + robot.D * (dtheta - dq)
        M, bias = robot.dynamics(q, dq)
        tau_e = robot.kinematics(q)[2].T @ self.F_e if self.F_e.any() else 0.0
        ddq = np.linalg.solve(M, tau_a + tau_e - bias)
        return np.concatenate([dq, dtheta, ddq, (self.tau_m - tau_a) / robot.B])

    def __call__(self, tau_m: Array, F_e: Array) -> None:
        self.tau_m, self.F_e = tau_m, F_e
        run = solve_ivp(self.slope, (0.0, self.period), self.x, **self.options)
        if run.status != 0:
            raise RuntimeError(run.message)
        self.x, self.calls = run.y[:, -1].copy(), self.calls + run.nfev
