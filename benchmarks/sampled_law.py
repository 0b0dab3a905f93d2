"""The plain inner loop once per period as a user would write it first: NumPy and Pinocchio in Python, with a port tank.

Laws (12), (32) and (5) for joints that stay as stiff as they are (K_e = K, so φ = θ), set-points for the
reference, books of the tank at the joint port. Left out, in favour of the alternatives that use it: sensors and
their filters, the matched inner loop, the governor's search and the valve (a reference is granted whole), the fallback,
motor limits, the ledger of energies, guards against what is no number, and all recording but of the state.
"""

from __future__ import annotations

from importlib import resources
from typing import NamedTuple, Protocol

import numpy as np
import pinocchio as pin
import yaml
from numpy.typing import NDArray

import plain
from passiflex.scenarios.scenario_file import parse_scenario
from passiflex.simulation import Problem, resolve

Array = NDArray[np.float64]

SHAPED = 0.4
"""B_e / B of the plain inner loop, which is stable at 1 kHz and a delay of 1 ms."""


class Order(NamedTuple):
    """From `time` on [s]: where the reference is, and the wrench on the end effector (6,)."""

    time: float
    position: Array
    rotation: Array
    F_e: Array


class Motion(NamedTuple):
    """q, θ at the samples (N + 1, 2n) [rad] and the level of the tank after each sample (N,) [J]."""

    positions: Array
    levels: Array


def comparable(duration: float) -> Problem:
    """Return the shipped task within `duration` [s], without noise and sensor errors and with the plain inner loop."""
    shipped = resources.files("passiflex.studies") / "scenarios" / "fig1_sampled.yaml"
    data = yaml.safe_load(shipped.read_text(encoding="utf-8"))
    for left_out in ("sensors", "noise", "motors"):
        del data[left_out]
    data["name"], data["duration"] = "comparable", duration
    data["law"]["shaped_inertia"] = {"ratio": SHAPED}
    data["control"]["inner_loop"] = "plain"
    data["reference"][0]["at"] = round(duration / 10, 3)
    data["forces"][0] |= {"from": round(duration / 2, 3), "to": round(duration * 0.8, 3)}
    return resolve(parse_scenario(yaml.safe_dump(data)))


def orders(problem: Problem) -> list[Order]:
    """Return what the loop is told, in the order of time."""
    told: list[Order] = []
    (position, rotation), rates = problem.home, ("sine", "cosine", "turn")
    for event in problem.events:
        if event.motion is not None:
            if event.motion["polynomial"][:, 1:].any() or any(np.any(event.motion[k]) for k in rates):
                raise ValueError("the plain law knows set-points only")
            position, rotation = event.motion["polynomial"][:, 0], event.motion["rotation"]
        told.append(Order(event.time, position, rotation, event.F_e))
    return told


class SampledLaw:
    """The law and its tank, called once per period; the command arrives a period later."""

    def __init__(self, problem: Problem):
        law = problem.law
        self.robot = plain.Robot(law.robot.arm.chain.to_urdf(), law.robot.layout.unpack(problem.model))
        gains = law.layout.unpack(problem.gains)
        if not np.allclose(gains["shaped_stiffness"], self.robot.K, rtol=1e-12):
            raise ValueError("the plain law keeps the joints' stiffness")
        self.B_e = gains["shaped_inertia"]
        self.K_H = self.robot.B / self.B_e
        self.K_t, K_o = gains["stiffness"][:3, :3], gains["stiffness"][3:, 3:]
        self.G = np.trace(K_o) / 2 * np.eye(3) - K_o
        self.D_x, self.k_ns = gains["damping"], float(gains["null_space_damping"])
        self.epsilon = float(gains["regularisation"]) * np.eye(6)
        self.p_d, self.R_d = problem.home
        self.level, self.cap = problem.tank.initial, problem.tank.cap
        self.storage: float | None = None
        self.last: tuple[Array, Array] = (np.zeros(0), np.zeros(0))

    def potential(self, p: Array, R: Array) -> float:
        """Return U of the Cartesian spring [J]."""
        e = p - self.p_d
        return float(e @ self.K_t @ e / 2 + np.trace(self.G @ (np.eye(3) - self.R_d.T @ R)))

    def __call__(self, q: Array, theta: Array, dq: Array, dtheta: Array, order: Order) -> Array:
        """Return τ_m [N m] and keep the tank's books."""
        robot = self.robot
        tau_a = robot.K * (theta - q) + robot.D * (dtheta - dq)
        J_q = robot.kinematics(q)[2].copy()
        p, R, J = robot.kinematics(theta)
        own = float(dtheta @ (self.B_e * dtheta) + (theta - q) @ (robot.K * (theta - q))) / 2
        before = self.potential(p, R)
        if self.storage is not None:  # −ΔS − w of the period that ends now
            q_last, tau_last = self.last
            flow = self.storage - own - before - float((tau_a + tau_last) @ (q - q_last)) / 2
            self.level = min(self.level + flow, max(self.cap, self.level))
        self.p_d, self.R_d = order.position, order.rotation
        stored = self.potential(p, R)
        self.level -= stored - before
        self.storage, self.last = own + stored, (q.copy(), tau_a)

        A = R @ self.G @ self.R_d.T
        S = A - A.T
        spring = np.concatenate([self.K_t @ (p - self.p_d), [S[2, 1], S[0, 2], S[1, 0]]])
        M = pin.crba(robot.model, robot.data, q)
        mobility = J_q @ np.linalg.solve(M, J_q.T) + self.epsilon
        tau_null = -self.k_ns * (M @ dtheta - J_q.T @ np.linalg.solve(mobility, J_q @ dtheta))  # (32)
        tau_u = -J.T @ (spring + self.D_x @ (J @ dtheta)) + tau_null  # (12)
        return -(self.K_H - 1) * tau_a + self.K_H * tau_u  # (5)


class HeldPlant(Protocol):
    """A robot at rest at its start."""

    def state(self) -> tuple[Array, Array, Array, Array]:
        """Return q, θ, q̇, θ̇."""

    def __call__(self, tau_m: Array, F_e: Array) -> None:
        """Go on for a period under these held torques and this wrench."""


def through_samples(problem: Problem, advance: HeldPlant, seconds: float) -> Motion:
    """Return the motion of a plant under the law."""
    s = problem
    assert s is not None
    law, told, periods = SampledLaw(problem), orders(problem), round(seconds / s.period)
    first = [int(np.ceil(order.time / s.period - 1e-6)) for order in told]
    assert first[0] == 0
    late, line = round(s.delay / s.period), [s.held] * round(s.delay / s.period)
    positions, levels, at = [], [], 0
    for k in range(periods):
        while at + 1 < len(told) and first[at + 1] <= k:
            at += 1
        state = advance.state()
        positions.append(np.concatenate(state[:2]))
        line.append(law(*state, told[at]))
        levels.append(law.level)
        advance(line[-1 - late], told[at].F_e)
    positions.append(np.concatenate(advance.state()[:2]))
    return Motion(np.array(positions), np.array(levels))
