"""The rigid baseline on a rigid robot gives exactly the target dynamics; damping by ratio gives that ratio."""

from __future__ import annotations

from functools import lru_cache

import casadi as cs
import numpy as np
import pytest
import scipy.linalg
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from loops import GRAVITY, SEEDS, definite, robots, rotation
from passiflex.control import (
    AbstractTask,
    Measurement,
    PoseTask,
    PositionTask,
    Reference,
    RigidImpedanceLaw,
    damping_from_ratio,
)
from passiflex.errors import ValueRangeError
from passiflex.robots.arm import EndEffectorPose
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.robots.linear_algebra import solve_spd

REGULAR = np.array([0, 0.6, 0, -1.2, 0, 1.0, 0])


def target_residual(law: RigidImpedanceLaw) -> cs.Function:
    """Return (q, q̇, F_e, p_d, R_d; m, g, B) → M_x ẍ + D_x ẋ + ∂U/∂x, and cond(J M⁻¹ Jᵀ).

    For a rigid robot, (M + B) q̈ + C q̇ + ∇V = τ + Jᵀ F_e with θ = q.
    """
    arm, n, rows = law.robot.arm, law.robot.n, slice(0, law.task.size)
    q, dq, F_e = cs.SX.sym("q", n), cs.SX.sym("dq", n), cs.SX.sym("F_e", 6)
    p_d, R_d, B = cs.SX.sym("p_d", 3), cs.SX.sym("R_d", 3, 3), cs.SX.sym("B", n)
    model, m = law.robot.layout.symbols("m")
    gains, g = law.layout.symbols("g")
    desired = EndEffectorPose(p_d, R_d)
    y = Measurement(q, q, dq, dq, cs.SX.zeros(n), F_e, cs.SX.zeros(n))
    tau = law.command(y, Reference(desired, cs.SX.zeros(6)), m, g).tau_m
    M, coriolis, gravity = arm.mass_matrix(q, m), arm.coriolis_torque(q, dq, m), arm.gravity_torque(q, m)
    J = arm.jacobian(q, m)
    ddq = solve_spd(M + cs.diag(B), tau + J.T @ F_e - coriolis - gravity)
    dx = (J @ dq)[rows]
    ddx = cs.jtimes(dx, q, dq) + J[rows, :] @ ddq
    spring = law.task.spring(arm.pose(q, m), desired, g.stiffness).gradient[rows]
    wrench = g.target_inertia @ ddx + g.damping @ dx + spring
    mobility = J[rows, :] @ cs.solve(M + cs.diag(B), J[rows, :].T)
    return cs.Function(
        "target", [q, dq, F_e, p_d, R_d, model, gains, B], [wrench, mobility, ddx], {"cse": True}
    )


def rigid_gains(law: RigidImpedanceLaw, rng: np.random.Generator, B: np.ndarray) -> np.ndarray:
    k = law.task.size
    return law.layout.pack(
        {
            "target_inertia": definite(rng, k, 1, 10),
            "stiffness": definite(rng, k, 10, 1000),
            "damping": definite(rng, k, 1, 100),
            "null_space_damping": np.asarray(5.0),
            "regularisation": np.asarray(0.0),
            "carried_inertia": B,
        }
    )


def check_target(law: RigidImpedanceLaw, f: cs.Function, q: np.ndarray, seed: int, carried: bool) -> None:
    """M_x ẍ + D_x ẋ + ∂U/∂x = F_e to 1e-9 of the forces met, while Λ is well conditioned."""
    rng, n, k = np.random.default_rng(seed), law.robot.n, law.task.size
    B = law.robot.motor_inertia if carried else np.zeros(n)
    F_e = rng.uniform(-30, 30, 6)
    args = (q, rng.uniform(-1, 1, n), F_e, rng.normal(size=3), rotation(rng))
    numbers = law.robot.layout.pack(law.robot.nominal(GRAVITY)), rigid_gains(law, rng, B), B
    wrench, mobility, ddx = (np.array(v) for v in f(*args, *numbers))
    assume(np.linalg.cond(mobility) < 1e5)
    scale = 10 * np.abs(ddx).max() + 1e4
    np.testing.assert_allclose(wrench.ravel(), F_e[:k], rtol=0, atol=1e-9 * scale)


@lru_cache
def iiwa(task: AbstractTask) -> tuple[RigidImpedanceLaw, cs.Function]:
    law = RigidImpedanceLaw(FlexibleJointRobot.load("iiwa14"), task)
    return law, target_residual(law)


@pytest.mark.parametrize("carried", [True, False])
@pytest.mark.parametrize("task", [PoseTask(), PositionTask()], ids=lambda t: type(t).__name__)
@settings(max_examples=15, deadline=None)
@given(seed=SEEDS)
def test_iiwa_without_elasticity_is_the_target(task: AbstractTask, carried: bool, seed: int) -> None:
    law, f = iiwa(task)
    q = REGULAR + np.random.default_rng(seed).uniform(-0.5, 0.5, 7)
    check_target(law, f, q, seed, carried)


@settings(max_examples=6, deadline=None)
@given(robots(4, 6), SEEDS)
def test_random_arms_without_elasticity_are_the_target(robot: FlexibleJointRobot, seed: int) -> None:
    law = RigidImpedanceLaw(robot, PositionTask())
    q = np.random.default_rng(seed).uniform(-2, 2, robot.n)
    check_target(law, target_residual(law), q, seed, carried=True)


def test_rigid_law_has_no_tank() -> None:
    assert not RigidImpedanceLaw.has_tank


@given(SEEDS, st.sampled_from([1, 3, 6]), st.floats(0.05, 0.95))
def test_every_mode_has_the_ratio(seed: int, size: int, ratio: float) -> None:
    """The roots of det(Λ s² + D s + K) are −ζω ± iω√(1−ζ²), so −Re s/|s| = ζ; cond(Λ) < 1e3, D is symmetric."""
    rng = np.random.default_rng(seed)
    K, inertia = definite(rng, size, 10, 1000), definite(rng, size, 0.1, 20)
    D = damping_from_ratio(K, inertia, ratio)
    np.testing.assert_array_equal(D, D.T)
    assert np.linalg.eigvalsh(D).min() > 0
    inverse = np.linalg.inv(inertia)
    roots = np.linalg.eigvals(
        np.block([[np.zeros((size, size)), np.eye(size)], [-inverse @ K, -inverse @ D]])
    )
    np.testing.assert_allclose(-roots.real / np.abs(roots), ratio, rtol=0, atol=1e-9)
    undamped = np.sqrt(scipy.linalg.eigh(K, inertia, eigvals_only=True))
    np.testing.assert_allclose(np.sort(np.abs(roots))[::2], undamped, rtol=1e-9)


@given(SEEDS)
def test_modes_can_have_their_own_ratios(seed: int) -> None:
    """One ratio for each mode, slowest first."""
    rng = np.random.default_rng(seed)
    K, inertia, ratios = definite(rng, 3, 10, 1000), definite(rng, 3, 0.1, 20), np.array([0.3, 0.6, 0.9])
    modes = scipy.linalg.eigh(K, inertia)[1]
    diagonal = modes.T @ damping_from_ratio(K, inertia, ratios) @ modes
    frequencies = np.sqrt(np.diag(modes.T @ K @ modes))
    np.testing.assert_allclose(
        diagonal, np.diag(2 * ratios * frequencies), rtol=0, atol=1e-9 * frequencies.max()
    )


def test_critical_damping_is_not_two_root_k() -> None:
    """2√K is critical for one kilogram only; for 4 kg it is twice that, and half of it for a quarter."""
    K = np.diag([100.0, 400.0, 900.0])
    np.testing.assert_allclose(damping_from_ratio(K, np.eye(3), 1.0), 2 * np.sqrt(K), rtol=0, atol=1e-12)
    np.testing.assert_allclose(damping_from_ratio(K, 4 * np.eye(3), 1.0), 4 * np.sqrt(K), rtol=0, atol=1e-12)
    turned = definite(np.random.default_rng(0), 3, 0.5, 10)
    assert np.abs(damping_from_ratio(K, turned, 1.0) - 2 * np.sqrt(K)).max() > 1


@pytest.mark.parametrize(
    ("stiffness", "inertia", "ratio", "message"),
    [
        (
            np.diag([1.0, 0.0]),
            np.eye(2),
            0.7,
            "stiffness is not positive definite; got smallest eigenvalue 0",
        ),
        (
            np.diag([1.0, -2.0]),
            np.eye(2),
            0.7,
            "stiffness is not positive definite; got smallest eigenvalue -2",
        ),
        (np.eye(2), np.diag([1.0, -1.0]), 0.7, "inertia is not positive definite"),
        (
            np.array([[1.0, 0.5], [0.0, 1.0]]),
            np.eye(2),
            0.7,
            "stiffness is not symmetric; got difference 0.5",
        ),
        (np.eye(2), np.array([[1.0, 0.5], [0.0, 1.0]]), 0.7, "inertia is not symmetric"),
        (np.eye(2), np.eye(2), -0.1, "damping ratio is negative; got -0.1"),
    ],
)
def test_wrong_gains_are_refused(
    stiffness: np.ndarray, inertia: np.ndarray, ratio: float, message: str
) -> None:
    with pytest.raises(ValueRangeError, match=message):
        damping_from_ratio(stiffness, inertia, ratio)


def test_not_a_number_is_not_positive_definite() -> None:
    with pytest.raises(ValueRangeError):
        damping_from_ratio(np.full((2, 2), np.nan), np.eye(2), 0.7)
