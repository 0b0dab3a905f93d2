"""The robot of (2) and what touches it, under a motor torque: one plant for all loops."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import NamedTuple

import casadi as cs

from passiflex.layout import Field, Layout
from passiflex.loops.elements import AbstractElement, Drag, Effect, MotorFriction, Touch, nothing
from passiflex.robots.arm import TipWrench
from passiflex.robots.flexible import FlexibleJointRobot, RobotState

PORTS = (
    Field("external", (), "J", "∫ τ_eᵀ q̇: given to the robot by its environment"),
    Field("motor", (), "J", "∫ τ_mᵀ θ̇: given to the motors by the law"),
    Field("joint", (), "J", "∫ τ_aᵀ q̇: given to the links through the joints"),
    Field("joint_loss", (), "J", "∫ (θ̇ − q̇)ᵀ D (θ̇ − q̇): lost in the real joints"),
)
"""What passes the ports of a robot, and what it loses."""
Elements = tuple[AbstractElement, ...]
ELEMENTS: Elements = (MotorFriction(), Drag())
"""What may touch the robot of a sampled loop."""


def touching(*, friction: bool, drag: bool) -> Elements:
    """Return the elements of a sampled loop, of which these act."""
    return MotorFriction(acts=friction), Drag(acts=drag)


class Flow(NamedTuple):
    """What happens in a state: accelerations (n,), and the powers of `Plant.energies` by name [W]."""

    ddq: cs.SX
    ddtheta: cs.SX
    powers: dict[str, cs.SX]


@dataclass(frozen=True, eq=False)
class Plant:
    """ẋ = f(x, [τ_m, environment], p) for x = (q, θ, q̇, θ̇), with what passes its ports.

    Attributes
    ----------
    elements: What touches the robot; a wrench F_e on the end effector always may.
    """

    robot: FlexibleJointRobot
    elements: Elements = ELEMENTS

    @cached_property
    def parameters(self) -> Layout:
        """Return the robot's numbers and those of the elements."""
        return sum((e.parameters(self.robot.n) for e in self.elements), self.robot.layout)

    @cached_property
    def environment(self) -> Layout:
        """Return what a schedule may change."""
        wrench = Field("F_e", (6,), "N, N m", "wrench on the end effector, world axes", kept=False)
        return sum((e.inputs() for e in self.elements), Layout((wrench,)))

    @cached_property
    def energies(self) -> Layout:
        """Return what is summed up over time."""
        return Layout(PORTS + tuple(Field(e.booked, (), "J", e.meaning) for e in self.elements if e.booked))

    @cached_property
    def state(self) -> Layout:
        """Return the state."""
        n, (angle, speed, _) = self.robot.n, self.robot.arm.chain.joint_units
        return Layout(
            (
                Field("q", (n,), angle, "link position"),
                Field("theta", (n,), angle, "motor position"),
                Field("dq", (n,), speed, "link velocity"),
                Field("dtheta", (n,), speed, "motor velocity"),
            )
        )

    @cached_property
    def truth(self) -> Layout:
        """Return what is true at one instant."""
        n, (_, _, torque) = self.robot.n, self.robot.arm.chain.joint_units
        return Layout(
            (
                Field("position", (3,), "m", "end effector", axes=("axis",)),
                Field("rotation", (3, 3), "1", "axes of the end effector", axes=("axis", "column")),
                Field("tau_a", (n,), torque, "torque through the joint, positive on the link"),
                Field("tau_e", (n,), torque, "external joint torque"),
                Field("wrench", (6,), "N, N m", "on the end effector, drag included", axes=("component",)),
                Field("link_kinetic_energy", (), "J", "½ q̇ᵀ M q̇"),
                Field("motor_kinetic_energy", (), "J", "½ θ̇ᵀ B θ̇"),
                Field("joint_spring_energy", (), "J", "½ (θ−q)ᵀ K (θ−q)"),
                Field("potential_energy", (), "J", "V(q)"),
            )
        )

    def view(self, x: cs.SX) -> RobotState:
        """Return the named parts of the state."""
        return RobotState(*cs.vertsplit(x, self.robot.n))

    def flow(self, x: RobotState, tau_m: cs.SX, s: SimpleNamespace, m: SimpleNamespace) -> Flow:
        """Return what happens in the state x under a motor torque."""
        arm = self.robot.arm
        at = Touch(x, *arm.tip_velocity(x.q, x.dq, m))
        effects = self._effects(at, s, m)
        touched = _sum(effects, self.robot.n)
        given = TipWrench(*(arm.in_tip_axes(x.q, half) for half in cs.vertsplit(s.F_e, 3)))
        pushed = TipWrench(given.force + touched.force, given.moment + touched.moment)
        a = self.robot.acceleration(x, tau_m + touched.motor, pushed, m)
        stretch = x.dtheta - x.dq
        powers = {
            "external": cs.dot(pushed.force, at.velocity) + cs.dot(pushed.moment, at.spin),
            "motor": cs.dot(tau_m, x.dtheta),
            "joint": cs.dot(a.tau_a, x.dq),
            "joint_loss": cs.dot(stretch, m.joint_damping * stretch),
        }
        lost = {e.booked: f.lost for e, f in zip(self.elements, effects, strict=True) if e.booked}
        return Flow(a.ddq, a.ddtheta, powers | lost)

    def _effects(self, at: Touch, s: SimpleNamespace, m: SimpleNamespace) -> list[Effect]:
        return [e.act(at, s, m) if e.acts else nothing(self.robot.n) for e in self.elements]

    def wrench(self, x: RobotState, s: SimpleNamespace, m: SimpleNamespace) -> cs.SX:
        """Return all that acts on the end effector, in world axes (6,)."""
        arm = self.robot.arm
        at = Touch(x, *arm.tip_velocity(x.q, x.dq, m))
        touched = _sum(self._effects(at, s, m), self.robot.n)
        return s.F_e + cs.vertcat(*(arm.in_world_axes(x.q, part) for part in (touched.force, touched.moment)))

    def true(self, x: RobotState, s: SimpleNamespace, m: SimpleNamespace) -> dict[str, cs.SX]:
        """Return the signals of `truth` by name."""
        arm, stretch = self.robot.arm, x.theta - x.q
        wrench, pose = self.wrench(x, s, m), arm.pose(x.q, m)
        return {
            "position": pose.position,
            "rotation": pose.rotation,
            "tau_a": self.robot.joint_torque(x, m),
            "tau_e": arm.jacobian(x.q, m).T @ wrench,
            "wrench": wrench,
            "link_kinetic_energy": cs.dot(x.dq, arm.mass_matrix(x.q, m) @ x.dq) / 2,
            "motor_kinetic_energy": cs.dot(x.dtheta, m.motor_inertia * x.dtheta) / 2,
            "joint_spring_energy": cs.dot(stretch, m.joint_stiffness * stretch) / 2,
            "potential_energy": arm.potential_energy(x.q, m),
        }

    @cached_property
    def rhs(self) -> cs.Function:
        """Return (x, u, p) → (ẋ, powers)."""
        n = self.robot.n
        state = cs.SX.sym("x", 4 * n)
        u = cs.SX.sym("u", n + self.environment.size)
        p, m = self.parameters.symbols("p")
        x = self.view(state)
        flow = self.flow(x, u[:n], self.environment.view(u[n:]), m)
        slope = cs.vertcat(x.dq, x.dtheta, flow.ddq, flow.ddtheta)
        powers = self.energies.stack(flow.powers)
        return cs.Function("plant", [state, u, p], [cs.densify(slope), cs.densify(powers)], {"cse": True})


def _sum(effects: list[Effect], n: int) -> Effect:
    return Effect(*(sum(parts, start) for *parts, start in zip(*effects, nothing(n), strict=True)))
