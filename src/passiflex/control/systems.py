"""The closed loops of the paper as port-Hamiltonian systems: (9)–(10), (13)–(14), (24)–(28), (34)–(36).

Each is written from its own Hamiltonian and matrices, independently of the law; that both are the same
vector field is Propositions 1–3, and a test. (24) is the corrected one (theory note 2.5).
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import casadi as cs

from passiflex.control.inner_loop import shaped_damping
from passiflex.control.law import ImpedanceGains, ImpedanceLaw
from passiflex.control.null_space import null_space_damping
from passiflex.layout import Field, Layout
from passiflex.phs.mechanics import (
    elastic_energy,
    kinetic_energy,
    two_body_dissipation,
    two_body_interconnection,
)
from passiflex.phs.system import PortHamiltonianSystem
from passiflex.robots.arm import EndEffectorPose
from passiflex.robots.flexible import FlexibleJointRobot, RobotNumbers

SHAPING = ("shaped_stiffness", "shaped_inertia")
DESIRED = Layout((Field("desired_position", (3,), "m"), Field("desired_rotation", (3, 3), "1")))
FILL = Layout((Field("tank_fill", (), "1"),))


class ShapingGains(Protocol):
    """What the inner loop makes of joints and motors, in symbols."""

    shaped_stiffness: cs.SX
    shaped_inertia: cs.SX


def _gains(n: int) -> Layout:
    return Layout((Field(SHAPING[0], (n,), "N m/rad"), Field(SHAPING[1], (n,), "kg m^2")))


def shaped_hamiltonian(
    robot: FlexibleJointRobot,
    q: cs.SX,
    phi: cs.SX,
    p: cs.SX,
    z: cs.SX,
    m: RobotNumbers,
    g: ShapingGains,
) -> cs.SX:
    """Return 𝓗 of (10) [J]."""
    M = robot.arm.mass_matrix(q, m)
    return (
        kinetic_energy(M, p)
        + cs.dot(z, z / g.shaped_inertia) / 2
        + elastic_energy(g.shaped_stiffness, phi - q)
        + robot.arm.potential_energy(q, m)
    )


def shaped_system(robot: FlexibleJointRobot) -> PortHamiltonianSystem:
    """Return (9) with (10): state (q, φ, p, z), inputs (τ_e, τ_u); parameters: the robot's, K_e, B_e."""
    n = robot.n
    state, inputs = cs.SX.sym("x", 4 * n), cs.SX.sym("u", 2 * n)
    model, m = robot.layout.symbols("m")
    gains, g = _gains(n).symbols("g")
    q, phi, p, z = cs.vertsplit(state, n)
    D_e = cs.diag(shaped_damping(m.joint_stiffness, m.joint_damping, g.shaped_stiffness))
    return PortHamiltonianSystem(
        state=state,
        inputs=inputs,
        parameters=cs.vertcat(model, gains),
        hamiltonian=shaped_hamiltonian(robot, q, phi, p, z, m, g),
        interconnection=two_body_interconnection(n),
        dissipation=two_body_dissipation(D_e, D_e),
        input_map=cs.vertcat(cs.SX(2 * n, 2 * n), cs.SX.eye(2 * n)),
    )


class _Loop(NamedTuple):
    """𝓗₁ of (14) and the damping matrices around it."""

    hamiltonian: cs.SX
    D_e: cs.SX
    D_star: cs.SX


def _impedance_loop(
    law: ImpedanceLaw, state: cs.SX, desired: EndEffectorPose, m: RobotNumbers, g: ImpedanceGains
) -> _Loop:
    arm, rows = law.robot.arm, slice(0, law.task.size)
    q, phi, p, z = cs.vertsplit(state, law.robot.n)
    S, held = law.task.basis(desired), list(law.task.held)
    J = S.T @ arm.jacobian(phi, m)[rows, :]
    M = arm.mass_matrix(q, m)
    D_e = cs.diag(shaped_damping(m.joint_stiffness, m.joint_damping, g.shaped_stiffness))
    D_ns = null_space_damping(
        M, S.T @ arm.jacobian(q, m)[rows, :], g.null_space_damping, g.regularisation
    )  # (35)
    hamiltonian = (  # (14)
        shaped_hamiltonian(law.robot, q, phi, p, z, m, g)
        + law.task.potential(arm.pose(phi, m), desired, g.stiffness)
        + law.gravity.compensation(arm, phi, g.shaped_stiffness, m).storage
    )
    return _Loop(hamiltonian, D_e, D_e + J.T @ g.damping[held, held] @ J + D_ns)


def impedance_system(law: ImpedanceLaw) -> PortHamiltonianSystem:
    """Return (13) with (14): state (q, φ, p, z), inputs (τ_e, τ_u2), x_d constant.

    D* holds the null-space damping (35) too; k_ns = 0 is (13) to the letter.
    Parameters: the robot's, the law's gains, `DESIRED`.
    """
    n = law.robot.n
    state, inputs = cs.SX.sym("x", 4 * n), cs.SX.sym("u", 2 * n)
    model, m = law.robot.layout.symbols("m")
    gains, g = law.layout.symbols("g")
    target, d = DESIRED.symbols("d")
    loop = _impedance_loop(law, state, EndEffectorPose(d.desired_position, d.desired_rotation), m, g)
    return PortHamiltonianSystem(
        state=state,
        inputs=inputs,
        parameters=cs.vertcat(model, gains, target),
        hamiltonian=loop.hamiltonian,
        interconnection=two_body_interconnection(n),
        dissipation=two_body_dissipation(loop.D_e, loop.D_star),
        input_map=cs.vertcat(cs.SX(2 * n, 2 * n), cs.SX.eye(2 * n)),
    )


def augmented_system(law: ImpedanceLaw) -> PortHamiltonianSystem:
    """Return (24)–(28) with (34), corrected: state (q, φ, p, z, n, x_d), inputs (τ_e, τ_u2, ẋ_d).

    The fill α feeds its part of the dissipation to the tank through the interconnection, d₁ and d₂ of
    (25) and (34); the rest, (1 − α), stays in the dissipation, where reality has it. The reference is a
    state with the input ẋ_d, so that P_X is the power of a port like any other; d₃ of (27) draws |P_X|
    from the tank, a dissipation modulated by that input. Then
    Ḣ₂ = −(1 − α) P_D + P_X − |P_X| + τ_eᵀ q̇ + τ_u2ᵀ φ̇.

    Parameters: the robot's, the law's gains, α.
    """
    n = law.robot.n
    state, inputs = cs.SX.sym("x", 4 * n + 1 + DESIRED.size), cs.SX.sym("u", 2 * n + 6)
    model, m = law.robot.layout.symbols("m")
    gains, g = law.layout.symbols("g")
    filling, f = FILL.symbols("f")
    mechanical, level = state[: 4 * n], state[4 * n]
    d = DESIRED.view(state[4 * n + 1 :])
    desired = EndEffectorPose(d.desired_position, d.desired_rotation)
    loop = _impedance_loop(law, mechanical, desired, m, g)
    hamiltonian = loop.hamiltonian + level**2 / 2  # (28)

    gradient = cs.gradient(hamiltonian, state)
    dH_p, dH_z = gradient[2 * n : 3 * n], gradient[3 * n : 4 * n]
    d1 = f.tank_fill / level * (-loop.D_e @ dH_p + loop.D_e @ dH_z)  # (25)
    d2 = f.tank_fill / level * (loop.D_e @ dH_p - loop.D_star @ dH_z)  # (26), (34)
    rotation_rate = cs.vertcat(  # rows of Ṙ_d = [ω]× R_d, stored row by row
        *(
            cs.horzcat(*(cs.skew(_unit(k)) @ d.desired_rotation for k in range(3)))[i, j::3]
            for i in range(3)
            for j in range(3)
        )
    )
    reference_map = cs.diagcat(cs.SX.eye(3), rotation_rate)
    reference_power = cs.dot(gradient[4 * n + 1 :], reference_map @ inputs[2 * n :])  # (21)
    d3 = cs.fabs(reference_power) / level**2  # (27)

    to_tank = cs.vertcat(cs.SX(2 * n, 1), d1, d2)
    still = DESIRED.size
    interconnection = cs.diagcat(
        cs.blockcat([[two_body_interconnection(n), to_tank], [-to_tank.T, cs.SX(1, 1)]]), cs.SX(still, still)
    )
    lost = (1 - f.tank_fill) * two_body_dissipation(loop.D_e, loop.D_star)
    return PortHamiltonianSystem(
        state=state,
        inputs=inputs,
        parameters=cs.vertcat(model, gains, filling),
        hamiltonian=hamiltonian,
        interconnection=interconnection,
        dissipation=cs.diagcat(lost, d3, cs.SX(still, still)),
        input_map=cs.diagcat(
            cs.vertcat(cs.SX(2 * n, 2 * n), cs.SX.eye(2 * n), cs.SX(1, 2 * n)), reference_map
        ),
    )


def _unit(k: int) -> cs.SX:
    return cs.SX.eye(3)[:, k]
