"""Gravity compensation: the torque is the gradient of what it stores, and the set-point is the equilibrium."""

from __future__ import annotations

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings

from loops import GRAVITY, SEEDS, robots
from passiflex.control import AbstractGravity, MotorGravity, RobotGravity, StaticGravity
from passiflex.control.posture import posture
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.simulation import Scenario, resolve
from passiflex.simulation import simulate as simulate_scenario

STEPS = StaticGravity().steps
DISPLACEMENT = np.array([0.03, -0.02, 0.1])
DIFFERENCE = 1e-7
"""Central differences with a step of ε^⅓ miss 4e-11 of the storage and of its third derivative, 600 N m at most."""


def compensation(robot: FlexibleJointRobot, gravity: AbstractGravity) -> cs.Function:
    """Return (φ, q, K_e, m) → torque, storage, −∇storage, V(q) + ½ (φ−q)ᵀ K_e (φ−q)."""
    phi, q, K_e = (cs.SX.sym(s, robot.n) for s in ("phi", "q", "K_e"))
    vector, m = robot.layout.symbols("m")
    torque, storage, _ = gravity.compensation(robot.arm, phi, K_e, m)
    carried = robot.arm.potential_energy(q, m) + cs.dot(phi - q, K_e * (phi - q)) / 2
    return cs.Function(
        "compensation", [phi, q, K_e, vector], [torque, storage, -cs.gradient(storage, phi), carried]
    )


def rest(robot: FlexibleJointRobot, steps: int) -> cs.Function:
    """Return (φ, K_e, m) → q̄ after `steps`, and ∇V there."""
    phi, K_e = cs.SX.sym("phi", robot.n), cs.SX.sym("K_e", robot.n)
    vector, m = robot.layout.symbols("m")
    q = StaticGravity(steps).rest_position(robot.arm, phi, K_e, m)
    return cs.Function("rest", [phi, K_e, vector], [q, robot.arm.gravity_torque(q, m)])


def flat(*values: cs.DM) -> list[np.ndarray]:
    return [np.array(v).ravel() for v in values]


@settings(max_examples=8, deadline=None)
@given(robots(1, 4), SEEDS)
def test_static_torque_balances_the_weight_at_rest(robot: FlexibleJointRobot, seed: int) -> None:
    """τ_g = K_e (φ − q̄) = ∇V(q̄), and one more step of the fixed point moves q̄ by less than 1e-12 rad.

    The random arms weigh at most 4 · 6 kg at 2.5 m, |∇²V| ≤ 600 N m/rad, so it contracts by 600 / 2e4 = 0.03
    and 8 steps leave 0.03⁸ = 7e-13 of the first deflection, 0.03 rad. The torque is K_e times that.
    """
    rng = np.random.default_rng(seed)
    here, further, f = rest(robot, STEPS), rest(robot, STEPS + 1), compensation(robot, StaticGravity())
    m, K_e = robot.layout.pack(robot.nominal(GRAVITY)), robot.joint_stiffness
    for _ in range(4):
        phi = rng.uniform(-3, 3, robot.n)
        (q, weight), (again, _) = flat(*here(phi, K_e, m)), flat(*further(phi, K_e, m))
        assert np.abs(again - q).max() < 1e-12
        torque, *_ = flat(*f(phi, q, K_e, m))
        np.testing.assert_allclose(torque, K_e * (phi - q), rtol=0, atol=1e-15 * 4 * K_e.max())
        np.testing.assert_allclose(torque, weight, rtol=0, atol=1e-12 * K_e.max())


@pytest.mark.parametrize(
    "gravity", [StaticGravity(), MotorGravity(), RobotGravity()], ids=lambda g: type(g).__name__
)
@settings(max_examples=6, deadline=None)
@given(robot=robots(1, 4), seed=SEEDS)
def test_torque_is_the_gradient_of_the_storage(
    gravity: AbstractGravity, robot: FlexibleJointRobot, seed: int
) -> None:
    """By exact derivatives to 1e-9, and by central differences."""
    rng, f = np.random.default_rng(seed), compensation(robot, gravity)
    m, K_e = robot.layout.pack(robot.nominal(GRAVITY)), robot.joint_stiffness
    for _ in range(3):
        phi = rng.uniform(-3, 3, robot.n)
        torque, storage, slope, _ = flat(*f(phi, phi, K_e, m))
        scale = 1 + np.abs(torque).max()
        np.testing.assert_allclose(torque, slope, rtol=0, atol=1e-9 * scale)
        h = 6e-6
        up = [float(f(phi + h * e, phi, K_e, m)[1]) for e in np.eye(robot.n)]
        down = [float(f(phi - h * e, phi, K_e, m)[1]) for e in np.eye(robot.n)]
        differences = -(np.array(up) - np.array(down)) / (2 * h)
        np.testing.assert_allclose(torque, differences, rtol=0, atol=DIFFERENCE * (scale + abs(storage[0])))


@settings(max_examples=8, deadline=None)
@given(robots(1, 4), SEEDS)
def test_static_storage_is_never_negative(robot: FlexibleJointRobot, seed: int) -> None:
    """V(q) + ½ (φ−q)ᵀ K_e (φ−q) − V_γ(φ) ≥ 0 for every q, near rest and far, and zero at q̄."""
    rng, f, here = np.random.default_rng(seed), compensation(robot, StaticGravity()), rest(robot, STEPS)
    m, K_e = robot.layout.pack(robot.nominal(GRAVITY)), robot.joint_stiffness
    for _ in range(3):
        phi = rng.uniform(-3, 3, robot.n)
        q_bar = np.array(here(phi, K_e, m)[0]).ravel()
        for away in (0.0, 1e-6, 1e-3, 0.1, 2.0):
            _, storage, _, carried = flat(*f(phi, q_bar + away * rng.normal(size=robot.n), K_e, m))
            round_off = 1e-14 * (abs(storage[0]) + abs(carried[0]))
            assert carried[0] + storage[0] >= -round_off
            if away == 0.0:
                assert abs(carried[0] + storage[0]) <= round_off


def test_motor_gravity_is_the_weight_at_the_motors() -> None:
    robot = FlexibleJointRobot.load("iiwa14")
    q, m = np.array([0.1, 0.6, -0.3, -1.2, 0.4, 1.0, 0.2]), robot.nominal()
    torque, storage, *_ = flat(
        *compensation(robot, MotorGravity())(q, q, robot.joint_stiffness, robot.layout.pack(m))
    )
    np.testing.assert_allclose(torque, posture(robot, q, m).gravity_torque, rtol=1e-13, atol=1e-13)
    V = sum(9.81 * mass * height for mass, height in zip(m["link_mass"], _heights(robot, q), strict=True))
    assert storage[0] == pytest.approx(-V, rel=1e-12)


def _heights(robot: FlexibleJointRobot, q: np.ndarray) -> np.ndarray:
    """Heights of the centres of mass: ∂V/∂mᵢ / g, where the moment m c of a link grows with its mass."""
    _, m = robot.layout.symbols("m")
    com = np.array([body.com for body in robot.arm.chain.bodies])
    V = robot.arm.potential_energy(cs.SX(q), m)
    slope = cs.gradient(V, m.link_mass) + cs.sum2(cs.gradient(V, m.link_moment) * com)
    f = cs.Function("h", [robot.layout.stack(vars(m))], [slope / 9.81])
    return np.array(f(robot.layout.pack(robot.nominal()))).ravel()


def test_robot_gravity_does_nothing() -> None:
    robot = FlexibleJointRobot.load("planar2r")
    m = robot.layout.pack(robot.nominal())
    torque, storage, *_ = flat(*compensation(robot, RobotGravity())(np.ones(2), np.ones(2), np.ones(2), m))
    assert not torque.any()
    assert storage[0] == 0
    assert not RobotGravity.in_model
    assert StaticGravity.in_model
    assert MotorGravity.in_model


def scenario(gravity: str) -> Scenario:
    return Scenario.model_validate(
        {
            "name": f"set_point_{gravity}",
            "robot": "iiwa14",
            "posture": [0, 0.6, 0, -1.2, 0, 1.0, 0],
            "law": {
                "type": "impedance",
                "task": "pose",
                "gravity": gravity,
                "shaped_stiffness": {"ratio": 10},
                "shaped_inertia": {"ratio": 0.01},
                "stiffness": {"translation": 60, "rotation": 60},
                "damping": {"translation": 20, "rotation": 20},
                "null_space_damping": 5,
            },
            "reference": [{"at": 0.5, "kind": "step", "by": DISPLACEMENT.tolist()}],
            "duration": 24,
            "output_interval": 0.5,
        }
    )


def test_static_gravity_rests_at_the_set_point() -> None:
    """f(φ) = x_d to 1e-6 m.

    The heaviest direction of Λ here is 14 kg, so the slowest mode dies with D_x / 2Λ = 0.71 1/s:
    0.1 m · e^(−0.71 · 23.5) = 6e-9 m is left of the step.
    """
    problem, run = resolve(scenario("static")), simulate_scenario(scenario("static"))
    assert not run.failure
    model = problem.law.robot.layout.unpack(problem.model)
    reached = posture(problem.law.robot, run["phi"][-1], model).pose
    np.testing.assert_allclose(reached.position, problem.home.position + DISPLACEMENT, rtol=0, atol=1e-6)
    np.testing.assert_allclose(reached.rotation, problem.home.rotation, rtol=0, atol=1e-6)
    np.testing.assert_allclose(run["desired_position"][-1], problem.home.position + DISPLACEMENT, atol=1e-15)
    # The links hang from there by what the weight stretches the joints.
    stretch = (
        posture(problem.law.robot, run["q"][-1], model).gravity_torque / problem.law.robot.joint_stiffness
    )
    np.testing.assert_allclose(run["theta"][-1] - run["q"][-1], stretch, rtol=0, atol=1e-9)


def test_motor_gravity_rests_beside_the_set_point() -> None:
    """What τ_g = ∇V(φ) leaves over is Jᵀ ∂U/∂x = ∇V(φ) − ∇V(q), seen from the end effector (J M⁻¹).

    The self-motion goes on drifting under its share of that, at rates that the law's D_x feels by 1e-3 of it.
    """
    problem, run = resolve(scenario("motor")), simulate_scenario(scenario("motor"))
    robot = problem.law.robot
    model = robot.layout.unpack(problem.model)
    at_phi, at_q = (posture(robot, run[k][-1], model) for k in ("phi", "q"))
    error = at_phi.pose.position - run["desired_position"][-1]
    turned = at_phi.pose.rotation @ run["desired_rotation"][-1].T
    torque = (
        60
        * np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
        / 2
    )
    spring = at_phi.jacobian.T @ np.concatenate([60 * error, torque])
    left_over = at_phi.gravity_torque - at_q.gravity_torque
    seen = np.linalg.solve(at_phi.mass_matrix, np.stack([spring, left_over], axis=1))
    ours, expected = (at_phi.jacobian @ seen).T
    np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-3 * np.abs(expected).max())
    assert 1e-6 < np.linalg.norm(error) < 0.01
