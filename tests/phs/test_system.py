"""Port-Hamiltonian values on closed forms, on broken structures, and the robot (3)–(4) against (2)."""

from __future__ import annotations

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from loops import GRAVITY, SEEDS, robots
from passiflex.phs import PortHamiltonianSystem, flexible_robot_system
from passiflex.robots.flexible import FlexibleJointRobot, RobotState

NUMBERS = st.floats(-5, 5)


def mass_spring_damper(
    interconnection: list[list[float]] | None = None, dissipation: cs.SX | None = None
) -> PortHamiltonianSystem:
    """x = (stretch, momentum), u = force; parameters (k, d, m)."""
    x, u, p = cs.SX.sym("x", 2), cs.SX.sym("u"), cs.SX.sym("p", 3)
    k, d, m = cs.vertsplit(p)
    return PortHamiltonianSystem(
        state=x,
        inputs=u,
        parameters=p,
        hamiltonian=k * x[0] ** 2 / 2 + x[1] ** 2 / (2 * m),
        interconnection=cs.SX(cs.DM(interconnection or [[0, 1], [-1, 0]])),
        dissipation=cs.diag(cs.vertcat(0, d)) if dissipation is None else dissipation,
        input_map=cs.SX(cs.DM([0, 1])),
    )


@given(NUMBERS, NUMBERS, NUMBERS, st.tuples(*[st.floats(0.1, 10)] * 3))
def test_mass_spring_damper_has_its_closed_forms(r: float, v: float, F: float, p: tuple[float, ...]) -> None:
    k, d, m = p
    s = mass_spring_damper()
    f = s.function(s.vector_field, s.output, s.supplied_power, s.dissipated_power, s.hamiltonian_rate)
    field, y, supplied, dissipated, rate = (np.array(o).ravel() for o in f([r, m * v], F, p))
    close = {"rtol": 1e-14, "atol": 1e-13 * (1 + abs(k * r) + abs(F) + d * abs(v)) * (1 + abs(v))}
    np.testing.assert_allclose(field, [v, -k * r - d * v + F], **close)
    np.testing.assert_allclose(y, [v], **close)
    np.testing.assert_allclose(supplied, [F * v], **close)
    np.testing.assert_allclose(dissipated, [d * v**2], **close)
    np.testing.assert_allclose(rate, [F * v - d * v**2], **close)
    assert s.structure([r, m * v], F, p).holds()


def test_the_oscillator_turns_by_its_frequency() -> None:
    """Without damper and force, ẍ = −(k/m) x: eigenvalues ±i√(k/m)."""
    s = mass_spring_damper()
    A = np.array(s.function(cs.jacobian(s.vector_field, s.state))(np.zeros(2), 0, [8.0, 0.0, 2.0]))
    np.testing.assert_allclose(sorted(np.linalg.eigvals(A).imag), [-2, 2], rtol=1e-14)


def test_a_broken_interconnection_is_reported() -> None:
    structure = mass_spring_damper(interconnection=[[0, 1], [-0.9, 0]]).structure([1, 1], 0, [1, 1, 1])
    assert structure.skew_defect == pytest.approx(0.1)
    assert not structure.holds()


def test_negative_dissipation_is_reported() -> None:
    structure = mass_spring_damper().structure([1, 1], 0, [1, -0.5, 1])
    assert structure.least_dissipation == pytest.approx(-0.5)
    assert not structure.holds()


def test_asymmetric_dissipation_is_reported() -> None:
    """An antisymmetric part of R would loose no energy; the structure is broken all the same."""
    twisted = cs.SX(cs.DM([[1, 0.2], [-0.2, 1]]))
    structure = mass_spring_damper(dissipation=twisted).structure([1, 1], 0, [1, 1, 1])
    assert structure.symmetry_defect == pytest.approx(0.4)
    assert not structure.holds()


def test_a_defect_of_round_off_is_none() -> None:
    assert (
        mass_spring_damper(interconnection=[[0, 1], [-1 - 1e-15, 0]]).structure([1, 1], 0, [1, 1, 1]).holds()
    )
    assert (
        mass_spring_damper(interconnection=[[0, 1], [-1 - 1e-9, 0]])
        .structure([1, 1], 0, [1, 1, 1])
        .holds(1e-8)
    )


def test_a_state_that_is_not_finite_does_not_hold() -> None:
    assert not mass_spring_damper().structure([np.nan, 1], 0, [1, 1, 1]).holds()


def euler_lagrange(robot: FlexibleJointRobot) -> cs.Function:
    """Return (q, θ, q̇, θ̇; τ_e, τ_m; m) → the state of (3) and its rate by (2), ṗ = Ṁ q̇ + M q̈."""
    n = robot.n
    x, u = cs.SX.sym("x", 4 * n), cs.SX.sym("u", 2 * n)
    vector, m = robot.layout.symbols("m")
    state = RobotState(*cs.vertsplit(x, n))
    a = robot.acceleration(state, u[n:], u[:n], m)
    M = robot.arm.mass_matrix(state.q, m)
    paper = cs.vertcat(state.q, state.theta, M @ state.dq, m.motor_inertia * state.dtheta)
    rate = cs.jtimes(paper, x, cs.vertcat(state.dq, state.dtheta, a.ddq, a.ddtheta))
    return cs.Function("spong", [x, u, vector], [paper, rate])


@settings(max_examples=12, deadline=None)
@given(robots(1, 4), SEEDS)
def test_robot_as_a_system_is_spongs_model(robot: FlexibleJointRobot, seed: int) -> None:
    """(3)–(4) = (2), with its structure and balance.

    Both are round-off of exact derivatives; M of a random arm is solved for once, cond(M) < 1e5 or so,
    so 1e-9 of the largest entry of each block is generous.
    """
    rng, n = np.random.default_rng(seed), robot.n
    system, spong = flexible_robot_system(robot), euler_lagrange(robot)
    f = system.function(
        system.vector_field, system.hamiltonian_rate, system.supplied_power, system.dissipated_power
    )
    m = robot.layout.pack(robot.nominal(GRAVITY))
    for _ in range(4):
        q = rng.uniform(-2, 2, n)
        velocities = rng.uniform(-2, 2, 2 * n)
        u = rng.uniform(-50, 50, 2 * n)
        x = np.concatenate([q, q + rng.uniform(-0.02, 0.02, n), velocities])
        state, expected = (np.array(v).ravel() for v in spong(x, u, m))
        field, rate, supplied, dissipated = (np.array(v).ravel() for v in f(state, u, m))
        for ours, theirs in zip(np.split(field, 4), np.split(expected, 4), strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9 * np.abs(theirs).max())
        assert system.structure(state, u, m).holds()
        stretch = velocities[n:] - velocities[:n]
        throughput = np.abs(field).max() * np.abs(velocities).max() * n + abs(supplied[0])
        np.testing.assert_allclose(dissipated, stretch @ (robot.joint_damping * stretch), rtol=1e-9)
        np.testing.assert_allclose(supplied, velocities @ u, rtol=0, atol=1e-9 * np.abs(u).sum())
        np.testing.assert_allclose(rate, supplied - dissipated, rtol=0, atol=1e-9 * throughput)
