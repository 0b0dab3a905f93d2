"""The robot under held motor torques: (2), with friction of the motors and a drag at the end effector."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import NamedTuple

import casadi as cs

from passiflex.layout import Field, Layout
from passiflex.robots.flexible import FlexibleJointRobot, RobotState
from passiflex.sampled.motors import friction, friction_layout

DRAG_WIDTH = 1e-3
"""Speed over which a drag's dry part changes its sign [m/s]."""

PLANT_ENERGIES = Layout(
    (
        Field("external", (), "J", "∫ τ_eᵀ q̇: given to the robot by its surroundings"),
        Field("motor", (), "J", "∫ τ_mᵀ θ̇: given to the motors by the law"),
        Field("joint", (), "J", "∫ τ_aᵀ q̇: given to the links through the joints"),
        Field("joint_loss", (), "J", "∫ (θ̇ − q̇)ᵀ D (θ̇ − q̇): lost in the real joints"),
        Field("friction", (), "J", "lost in the motors' friction"),
    )
)

SURROUNDINGS = Layout(
    (
        Field("F_e", (6,), "N, N m", "wrench on the end effector, world axes", kept=False),
        Field("viscous_drag", (), "N s/m", "of the end effector's linear motion", kept=False),
        Field("dry_drag", (), "N", "of the end effector's linear motion", kept=False),
    )
)


class Torques(NamedTuple):
    """What acts at the joints and at the end effector: τ_a, τ_e (n,) and the whole wrench (6,)."""

    tau_a: cs.SX
    tau_e: cs.SX
    wrench: cs.SX


@dataclass(frozen=True, eq=False)
class Plant:
    """ẋ = f(x, [τ_m, surroundings], p) for x = (q, θ, q̇, θ̇), with the integrands of `PLANT_ENERGIES`."""

    robot: FlexibleJointRobot

    @cached_property
    def parameters(self) -> Layout:
        """Return the robot's numbers and its friction."""
        return self.robot.layout + friction_layout(self.robot.n)

    def view(self, x: cs.SX) -> RobotState:
        """Return the named parts of the state."""
        return RobotState(*cs.vertsplit(x, self.robot.n))

    def torques(self, x: RobotState, s: SimpleNamespace, m: SimpleNamespace) -> Torques:
        """Return what acts in the state x: a drag opposes the end effector's motion, v + μ v/|v|."""
        J = self.robot.arm.jacobian(x.q, m)
        v = (J @ x.dq)[:3]
        drag = (s.viscous_drag + s.dry_drag / cs.sqrt(cs.dot(v, v) + DRAG_WIDTH**2)) * v
        wrench = s.F_e - cs.vertcat(drag, cs.SX.zeros(3))
        return Torques(self.robot.joint_torque(x, m), J.T @ wrench, wrench)

    @cached_property
    def rhs(self) -> cs.Function:
        """Return (x, u, p) → (ẋ, powers)."""
        n = self.robot.n
        state = cs.SX.sym("x", 4 * n)
        u = cs.SX.sym("u", n + SURROUNDINGS.size)
        p, m = self.parameters.symbols("p")
        x, s, tau_m = self.view(state), SURROUNDINGS.view(u[n:]), u[:n]
        torques = self.torques(x, s, m)
        rubbing = friction(x.dtheta, m.coulomb_friction, m.viscous_friction, m.friction_width)
        ddq, ddtheta, tau_a = self.robot.acceleration(x, tau_m - rubbing, torques.tau_e, m)
        stretch = x.dtheta - x.dq
        powers = PLANT_ENERGIES.stack(
            {
                "external": cs.dot(torques.tau_e, x.dq),
                "motor": cs.dot(tau_m, x.dtheta),
                "joint": cs.dot(tau_a, x.dq),
                "joint_loss": cs.dot(stretch, m.joint_damping * stretch),
                "friction": cs.dot(rubbing, x.dtheta),
            }
        )
        slope = cs.vertcat(x.dq, x.dtheta, ddq, ddtheta)
        return cs.Function("plant", [state, u, p], [cs.densify(slope), cs.densify(powers)], {"cse": True})
