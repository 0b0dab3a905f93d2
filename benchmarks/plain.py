"""The same closed loop as a user would write it without passiflex: NumPy, Pinocchio and SciPy.

Flexible-joint arm (2), inner loop (5), Cartesian impedance (12) with null-space damping (32), tank (23) in the
paper's accounting; references are set-points, K_x is without coupling of translation and rotation. The state
is (q, θ, q̇, θ̇, T); names are those of the theory note.
"""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from passiflex.robots.bodies import from_origin, matrix
from passiflex.simulation import Problem

Array = NDArray[np.float64]


def smoothstep(x: float) -> float:
    y = min(max(x, 0.0), 1.0)
    return y * y * (3 - 2 * y)


class Robot:
    """Pinocchio's model of the arm with the numbers of one parameter set, and the joints' K, D, B."""

    def __init__(self, urdf: str, numbers: dict[str, Array]):
        model = pin.buildModelFromXML(urdf)
        for i, mass in enumerate(numbers["link_mass"]):
            body = from_origin(float(mass), numbers["link_moment"][i], numbers["link_inertia"][i])
            model.inertias[i + 1] = pin.Inertia(body.mass, body.com, matrix(body.inertia))
        model.gravity.linear = numbers["gravity"]
        self.tip = model.getFrameId("tip")
        model.frames[self.tip].placement = pin.SE3(numbers["tool_rotation"], numbers["tool_position"])
        self.model, self.data = model, model.createData()
        self.K, self.D, self.B = (numbers[k] for k in ("joint_stiffness", "joint_damping", "motor_inertia"))

    def kinematics(self, q: Array) -> tuple[Array, Array, Array]:
        """Return position, rotation and Jacobian (6, n) of the end effector, in world axes."""
        pin.computeJointJacobians(self.model, self.data, q)
        pose = pin.updateFramePlacement(self.model, self.data, self.tip)
        J = pin.getFrameJacobian(self.model, self.data, self.tip, pin.LOCAL_WORLD_ALIGNED)
        return pose.translation, pose.rotation, J

    def dynamics(self, q: Array, dq: Array) -> tuple[Array, Array]:
        """Return M(q) and C(q, q̇) q̇ + ∇V(q)."""
        return pin.crba(self.model, self.data, q), pin.nonLinearEffects(self.model, self.data, q, dq)


class PlainLoop:
    """The vector field of the closed loop for one problem; set-points only, no tank that runs dry."""

    def __init__(self, problem: Problem):
        law = problem.law
        urdf, layout = law.robot.arm.chain.to_urdf(), law.robot.layout
        self.plant = Robot(urdf, layout.unpack(problem.plant))
        exact = np.array_equal(problem.plant, problem.model)  # then the law shares the plant's M and C
        self.believed = self.plant if exact else Robot(urdf, layout.unpack(problem.model))
        gains = law.layout.unpack(problem.gains)
        self.fill, _, _, self.cap, self.band, _ = map(float, problem.tank_gains)
        K, B = self.believed.K, self.believed.B
        self.K_e, B_e = gains["shaped_stiffness"], gains["shaped_inertia"]
        self.D_e = self.believed.D / K * self.K_e
        self.share = K / self.K_e
        self.K_H = B / K * self.K_e / B_e
        self.K_F = B / K * (self.K_e - K)
        self.K_t, K_o = gains["stiffness"][:3, :3], gains["stiffness"][3:, 3:]
        self.G = np.trace(K_o) / 2 * np.eye(3) - K_o
        self.D_x, self.k_ns = gains["damping"], float(gains["null_space_damping"])
        self.epsilon = float(gains["regularisation"]) * np.eye(6)
        self.n = law.robot.n
        self.p_d, self.R_d = problem.home
        self.F_e, self.noise = np.zeros(6), np.zeros(self.n)

    def potential(self, x: Array) -> float:
        """Return U of the Cartesian spring at the shaped motor position [J]."""
        q, theta = x[: self.n], x[self.n : 2 * self.n]
        p, R, _ = self.believed.kinematics(q + self.share * (theta - q))
        e = p - self.p_d
        return float(e @ self.K_t @ e / 2 + np.trace(self.G @ (np.eye(3) - self.R_d.T @ R)))

    def __call__(self, _t: float, x: Array) -> Array:
        """Return ẋ."""
        q, theta, dq, dtheta = x[:-1].reshape(4, self.n)
        plant, believed = self.plant, self.believed

        # What the law sees and computes.
        tau_a = plant.K * (theta - q) + plant.D * (dtheta - dq)
        seen = tau_a + self.noise
        phi, dphi = q + self.share * (theta - q), dq + self.share * (dtheta - dq)  # (11)
        M, bias = believed.dynamics(q, dq)
        J_q = believed.kinematics(q)[2]
        p, R, J = believed.kinematics(phi)
        dx = J @ dphi
        A = R @ self.G @ self.R_d.T
        S = A - A.T
        spring = np.concatenate([self.K_t @ (p - self.p_d), [S[2, 1], S[0, 2], S[1, 0]]])
        damper = self.D_x @ dx
        tau_e = J_q.T @ self.F_e
        solved = np.linalg.solve(M, np.column_stack([J_q.T, seen + tau_e - bias]))
        mobility = J_q @ solved[:, :6] + self.epsilon
        tau_null = -self.k_ns * (M @ dphi - J_q.T @ np.linalg.solve(mobility, J_q @ dphi))  # (32)
        tau_u = -J.T @ (spring + damper) + tau_null  # (12)
        tau_m = -self.K_F * solved[:, 6] - (self.K_H - 1) * seen + self.K_H * tau_u  # (5)

        # What the robot does (2), and the tank (23); a set-point draws nothing.
        if plant is believed:
            ddq = np.linalg.solve(M, tau_a + tau_e - bias) if self.noise.any() else solved[:, 6]
        else:
            M, bias = plant.dynamics(q, dq)
            ddq = np.linalg.solve(M, tau_a + plant.kinematics(q)[2].T @ self.F_e - bias)
        stretch = dphi - dq
        dissipated = stretch @ (self.D_e * stretch) + dx @ damper - dphi @ tau_null
        fill = self.fill * (1 - smoothstep((x[-1] - self.cap) / self.band + 1))
        return np.concatenate([dq, dtheta, ddq, (tau_m - tau_a) / plant.B, [fill * dissipated]])


@dataclasses.dataclass
class PlainRun:
    """Rows of the state at the output's instants, and how often the vector field was evaluated."""

    states: Array
    calls: int


def simulate(problem: Problem, *, rtol: float = 1e-6, atol: float = 1e-8, method: str = "BDF") -> PlainRun:
    """Integrate by SciPy, restarted at every event and at every new sample of the noise."""
    loop, noise = PlainLoop(problem), problem.noise
    x = np.concatenate([problem.q, problem.theta, np.zeros(2 * loop.n), [problem.tank.initial]])
    starts = {round(event.time, 9): event for event in problem.events}
    times = {*starts, problem.duration}
    if noise:
        generator = np.random.default_rng(problem.seed)
        periods = round(problem.duration / noise.hold)
        samples = generator.normal(0.0, np.sqrt(noise.variance), size=(periods, loop.n))
        times |= {round(k * noise.hold, 9) for k in range(periods)}
    ordered, rows, calls = sorted(times), [x], 0
    for begin, end in pairwise(ordered):
        if (event := starts.get(begin)) is not None:
            loop.F_e = event.F_e
            if event.motion is not None:
                rates = ("sine", "cosine", "turn")
                if event.motion["polynomial"][:, 1:].any() or any(np.any(event.motion[k]) for k in rates):
                    raise ValueError("the plain loop knows set-points only")
                before = loop.potential(x)
                loop.p_d, loop.R_d = event.motion["polynomial"][:, 0], event.motion["rotation"]
                x[-1] -= abs(loop.potential(x) - before)  # the jump's own charge
                rows[-1] = x
        if noise:
            loop.noise = samples[round(begin / noise.hold)]
        instants = np.linspace(begin, end, max(1, round((end - begin) / problem.output_interval)) + 1)[1:]
        run = solve_ivp(loop, (begin, end), x, method=method, rtol=rtol, atol=atol, t_eval=instants)
        if run.status != 0:
            raise RuntimeError(f"{method} stopped at {run.t[-1]:.4g} s: {run.message}")
        x, calls = run.y[:, -1].copy(), calls + run.nfev
        rows.extend(run.y.T)
    return PlainRun(np.array(rows), calls)
