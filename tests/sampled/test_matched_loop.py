"""The matched inner loop: the joint's motion in closed form, and the paper's law as the period shrinks."""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace

import casadi as cs
import numpy as np
import pytest
import scipy.linalg
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from loops import SEEDS
from passiflex.control import ImpedanceLaw, PositionTask
from passiflex.control.signals import Measurement, Reference
from passiflex.robots import FlexibleJointRobot
from passiflex.robots.arm import EndEffectorPose
from passiflex.sampled.inner_loop import AbstractInnerLoop
from passiflex.sampled.matched_loop import MatchedInnerLoop, joint_flow


@settings(max_examples=30, deadline=None)
@given(st.floats(10, 1e5), st.floats(0.01, 5e3), st.floats(0.01, 10), st.floats(1e-5, 5e-3))
def test_the_joint_moves_as_the_matrix_exponential_says(K: float, D: float, B: float, T: float) -> None:
    """Under- and overdamped; as T → 0, δ stays and δ̇ keeps."""
    exact = scipy.linalg.expm(T * np.array([[0, 1], [-K / B, -D / B]]))
    flow = [float(v) for v in joint_flow(*(cs.DM(v) for v in (K, D, B, T)))]
    stay, push, keep = flow
    found = np.array([[stay, push], [-K / B * push, keep]])
    scale = np.abs(exact).max() * (1 + D / B * T)  # s·push and the mean nearly cancel if overdamped
    np.testing.assert_allclose(found, exact, rtol=1e-7, atol=1e-9 * scale + 1e-8 * np.abs(exact).max())


@lru_cache
def commands() -> tuple[cs.Function, ImpedanceLaw]:
    """(q, θ, q̇, θ̇, a, reference, T, model, gains) → τ_m of the matched loop without delay, and of the law."""
    robot = FlexibleJointRobot.load("planar2r")
    law, n = ImpedanceLaw(robot, PositionTask()), robot.n
    q, theta, dq, dtheta, goal = (cs.SX.sym(s, 2) for s in ("q", "t", "dq", "dt", "x"))
    T = cs.SX.sym("T")
    (model, m), (gains, g) = robot.layout.symbols("m"), law.layout.symbols("g")
    tau_a = m.joint_stiffness * (theta - q) + m.joint_damping * (dtheta - dq)
    y = Measurement(q, theta, dq, dtheta, tau_a, cs.SX.zeros(6), cs.SX.zeros(n))
    desired = EndEffectorPose(cs.vertcat(goal[0], 0, goal[1]), cs.SX.eye(3))
    reference = Reference(desired, cs.SX.zeros(6))
    acceleration = cs.solve(robot.arm.mass_matrix(q, m), tau_a - robot.arm.bias_torque(q, dq, m))
    seen = SimpleNamespace(seen_ddq=acceleration, in_flight=cs.SX.zeros(1, n))
    i = AbstractInnerLoop.layout.view(cs.vertcat(T, 0.3, 0.05, 1))
    matched = MatchedInnerLoop(0).command(law, y, reference, m, g, cs.SX.zeros(n), seen, i)
    plain = law.command(y, reference, m, g)
    inputs = [q, theta, dq, dtheta, goal, T, model, gains]
    return cs.Function("commands", inputs, [matched.tau_m, plain.tau_m]), law


@pytest.mark.parametrize("stiffening", [0.5, 1.0, 2.0, 10.0])
@settings(max_examples=10, deadline=None)
@given(seed=SEEDS)
def test_as_the_period_shrinks_it_is_the_papers_law(stiffening: float, seed: int) -> None:
    """The known link acceleration stands for M⁻¹ of (6): the difference to (5) falls with T, whatever K_e is."""
    f, law = commands()
    rng, robot = np.random.default_rng(seed), law.robot
    q = rng.uniform(-1, 1, 2) + 1.5
    numbers = robot.nominal((0.0, 0.0, 0.0))
    inertia = rng.uniform(0.1, 1, 2) * robot.motor_inertia
    gains = law.layout.pack(
        {
            "shaped_stiffness": stiffening * robot.joint_stiffness,
            "shaped_inertia": inertia,
            "stiffness": 200 * np.eye(3),
            "damping": 40 * np.eye(3),
            "null_space_damping": 0.0,
            "regularisation": 1e-2,
        }
    )
    state = (q, q + rng.uniform(-5e-3, 5e-3, 2), *rng.uniform(-1, 1, (2, 2)), rng.uniform(-1, 1, 2))
    q, theta, dq, dtheta, _ = state
    felt = robot.joint_stiffness * (theta - q) + robot.joint_damping * (dtheta - dq)
    term = np.abs(felt * robot.motor_inertia / inertia).max()
    errors = []
    for T in (1e-6, 5e-7):
        matched, plain = (np.array(v).ravel() for v in f(*state, T, robot.layout.pack(numbers), gains))
        assume(
            np.abs(plain).max() > term
        )  # a relative error says nothing where the terms of a command cancel
        errors.append(np.abs(matched - plain).max() / np.abs(plain).max())
    assert errors[0] < 0.02
    assert errors[1] == pytest.approx(errors[0] / 2, rel=0.1) or errors[1] < 1e-7
