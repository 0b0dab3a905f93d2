"""(3)–(4): the flexible-joint robot itself as a port-Hamiltonian system."""

from __future__ import annotations

import casadi as cs

from passiflex.phs.system import PortHamiltonianSystem
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.robots.linear_algebra import solve_spd


def kinetic_energy(mass_matrix: cs.SX, momentum: cs.SX) -> cs.SX:
    """Return ½ pᵀ M⁻¹ p [J]."""
    return cs.dot(momentum, solve_spd(mass_matrix, momentum)) / 2


def elastic_energy(stiffness: cs.SX, deflection: cs.SX) -> cs.SX:
    """Return ½ δᵀ K δ [J] of the diagonal stiffness K."""
    return cs.dot(deflection, stiffness * deflection) / 2


def two_body_interconnection(n: int) -> cs.SX:
    """Return the canonical J of positions and momenta on both sides of the joints, as in (3), (9), (13)."""
    eye, zero = cs.SX.eye(2 * n), cs.SX(2 * n, 2 * n)
    return cs.blockcat([[zero, eye], [-eye, zero]])


def two_body_dissipation(coupling: cs.SX, motor_side: cs.SX) -> cs.SX:
    """Return R of (3), (9), (13): [[D, −D], [−D, D*]] on the momenta, zero on the positions."""
    n = coupling.shape[0]
    zero = cs.SX(2 * n, 2 * n)
    return cs.blockcat([[zero, zero], [zero, cs.blockcat([[coupling, -coupling], [-coupling, motor_side]])]])


def flexible_robot_system(robot: FlexibleJointRobot) -> PortHamiltonianSystem:
    """Return (3) with the Hamiltonian (4): state (q, θ, p, s), inputs (τ_e, τ_m), outputs (q̇, θ̇)."""
    n = robot.n
    state = cs.SX.sym("x", 4 * n)
    inputs = cs.SX.sym("u", 2 * n)
    parameters, m = robot.layout.symbols("m")
    q, theta, p, s = cs.vertsplit(state, n)
    M = robot.arm.mass_matrix(q, m)
    hamiltonian = (  # (4)
        kinetic_energy(M, p)
        + cs.dot(s, s / m.motor_inertia) / 2
        + elastic_energy(m.joint_stiffness, theta - q)
        + robot.arm.potential_energy(q, m)
    )
    D = cs.diag(m.joint_damping)
    return PortHamiltonianSystem(
        state=state,
        inputs=inputs,
        parameters=parameters,
        hamiltonian=hamiltonian,
        interconnection=two_body_interconnection(n),
        dissipation=two_body_dissipation(D, D),
        input_map=cs.vertcat(cs.SX(2 * n, 2 * n), cs.SX.eye(2 * n)),
    )
