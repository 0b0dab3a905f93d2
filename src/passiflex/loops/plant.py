"""The robot of (2) and what touches it, under a motor torque: one plant for all loops."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any, NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.control.motion import Pose
from passiflex.control.signals import Measurement
from passiflex.elements import AbstractElement, Drag, Effect, MotorFriction, Touch, nothing
from passiflex.layout import Field, Layout, Signal
from passiflex.robots.arm import TipWrench
from passiflex.robots.flexible import FlexibleJointRobot, RobotState

Array = NDArray[np.float64]

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


class Flow(NamedTuple):
    """What happens in a state: its rate, by name, and the powers of `Plant.energies` by name [W]."""

    rate: dict[str, cs.SX]
    powers: dict[str, cs.SX]


class Truth(NamedTuple):
    """What is true at one instant; `energies` are what robot and elements store, `touched` what else is seen."""

    position: Signal
    rotation: Signal
    tau_a: Signal
    tau_e: Signal
    wrench: Signal
    energies: tuple[Signal, ...]
    touched: tuple[Signal, ...] = ()

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Return all of them, in the order of files."""
        *single, energies, touched = self
        return (*single, *energies, *touched)


class Pushed(NamedTuple):
    """What acts on the links from outside: on the end effector, in world axes (6,), and as joint torque τ_e (n,)."""

    wrench: cs.SX
    tau_e: cs.SX


@dataclass(frozen=True, eq=False)
class Plant:
    """ẋ = f(x, [τ_m, environment], p) for x = (q, θ, q̇, θ̇, states of elements), with what passes its ports.

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

    def numbers(self, robot: Mapping[str, ArrayLike]) -> dict[str, ArrayLike]:
        """Return the values of `parameters` for the numbers of a robot."""
        return {**robot, **{k: v for e in self.elements for k, v in e.numbers(self.robot.n).items()}}

    @cached_property
    def environment(self) -> Layout:
        """Return what a schedule may change."""
        wrench = Field("F_e", (6,), "N, N m", "wrench on the end effector, world axes", kept=False)
        return sum((e.inputs() for e in self.elements), Layout((wrench,)))

    @cached_property
    def booked(self) -> Elements:
        """Return the elements of which a run has books."""
        return tuple(e for e in self.elements if e.acts or e.always)

    @cached_property
    def energies(self) -> Layout:
        """Return what is summed up over time."""
        lost = tuple(Field(e.name, (), "J", e.meaning) for e in self.booked)
        given = tuple(Field(e.books.given, (), "J", "given to the robot") for e in self.booked if e.outside)
        supplied = tuple(
            Field(e.books.supplied, (), "J", "supplied to it from beyond") for e in self.booked if e.supplies
        )
        return Layout(PORTS + lost + given + supplied)

    @cached_property
    def state(self) -> Layout:
        """Return the state."""
        n, (angle, speed, _) = self.robot.n, self.robot.arm.chain.joint_units
        robot = (
            Field("q", (n,), angle, "link position"),
            Field("theta", (n,), angle, "motor position"),
            Field("dq", (n,), speed, "link velocity"),
            Field("dtheta", (n,), speed, "motor velocity"),
        )
        return sum((e.state(n) for e in self.elements), Layout(robot))

    def at_rest(self, q: Array, theta: Array, at: Pose) -> Array:
        """Return the flat state of a robot that stands still with its end effector at a pose, and of the elements."""
        own = (e.start(at, self.robot.n).items() for e in self.elements)
        touched = {name: np.asarray(value, dtype=float) for items in own for name, value in items}
        return self.state.pack(self.state.zeros() | {"q": q, "theta": theta} | touched)

    def view(self, x: cs.SX) -> RobotState:
        """Return the robot's own state."""
        return RobotState(*(x[self.state.slices[name]] for name in RobotState._fields))

    def flow(self, x: cs.SX, tau_m: cs.SX, s: Any, m: Any) -> Flow:
        """Return what happens in the state x under a motor torque."""
        arm, robot = self.robot.arm, self.view(x)
        at = self._touch(x, m)
        effects = self._effects(at, x, s, m)
        touched = _sum(effects, self.robot.n)
        given = TipWrench(*(arm.in_tip_axes(robot.q, half) for half in cs.vertsplit(s.F_e, 3)))
        pushed = TipWrench(given.force + touched.force, given.moment + touched.moment)
        a = self.robot.acceleration(robot, tau_m + touched.motor, pushed, m, touched.link)
        stretch = robot.dtheta - robot.dq
        powers = {
            "external": cs.dot(pushed.force, at.velocity)
            + cs.dot(pushed.moment, at.spin)
            + cs.dot(touched.link, robot.dq),
            "motor": cs.dot(tau_m, robot.dtheta),
            "joint": cs.dot(a.tau_a, robot.dq),
            "joint_loss": cs.dot(stretch, m.joint_damping * stretch),
        }
        rate = {"q": robot.dq, "theta": robot.dtheta, "dq": a.ddq, "dtheta": a.ddtheta}
        for element, effect in zip(self.elements, effects, strict=True):
            if element in self.booked:
                powers[element.name] = effect.lost
                powers[element.books.given] = given_by(effect, at)
                powers[element.books.supplied] = effect.supplied
            rate |= vars(element.state(self.robot.n).view(effect.rate))
        return Flow(rate, {f.name: powers[f.name] for f in self.energies})

    def _touch(self, x: cs.SX, m: Any) -> Touch:
        arm, robot = self.robot.arm, self.view(x)
        velocity, spin = arm.tip_velocity(robot.q, robot.dq, m)
        axes = cs.horzcat(*(arm.in_world_axes(robot.q, axis) for axis in cs.horzsplit(cs.SX.eye(3))))
        pose = arm.pose(robot.q, m)
        return Touch(robot, velocity, spin, pose.position, axes, pose.rotation, own=SimpleNamespace())

    def _own(self, element: AbstractElement, at: Touch, x: cs.SX) -> Touch:
        """Return the touch as an element takes it: with its own state."""
        layout = element.state(self.robot.n)
        return at._replace(
            own=SimpleNamespace(**{f.name: getattr(self.state.view(x), f.name) for f in layout})
        )

    def _effects(self, at: Touch, x: cs.SX, s: Any, m: Any) -> list[Effect]:
        effects = []
        for element in self.elements:
            acting = element.act(self._own(element, at, x), s, m) if element.acts else nothing(self.robot.n)
            effects.append(acting)
        return effects

    def pushed(self, x: cs.SX, s: Any, m: Any) -> Pushed:
        """Return all that acts on the links from outside."""
        touched = _sum(self._effects(self._touch(x, m), x, s, m), self.robot.n)
        return self._pushed(touched, x, s, m)

    def _pushed(self, touched: Effect, x: cs.SX, s: Any, m: Any) -> Pushed:
        wrench = self._world_wrench(touched, x, s)
        return Pushed(wrench, self.robot.arm.jacobian(self.view(x).q, m).T @ wrench + touched.link)

    def sense(self, x: cs.SX, s: Any, m: Any) -> Measurement:
        """Return what there is to be measured of the state x."""
        robot, pushed = self.view(x), self.pushed(x, s, m)
        return Measurement(*robot, self.robot.joint_torque(robot, m), *pushed)

    def touched(self, x: cs.SX, s: Any, m: Any) -> tuple[cs.SX, cs.SX]:
        """Return what the elements do to the links and to the motors (n,) [N m]; F_e comes beside it."""
        robot, effect = self.view(x), _sum(self._effects(self._touch(x, m), x, s, m), self.robot.n)
        parts = (self.robot.arm.in_world_axes(robot.q, part) for part in (effect.force, effect.moment))
        return self.robot.arm.jacobian(robot.q, m).T @ cs.vertcat(*parts) + effect.link, effect.motor

    def _world_wrench(self, touched: Effect, x: cs.SX, s: Any) -> cs.SX:
        parts = (
            self.robot.arm.in_world_axes(self.view(x).q, part) for part in (touched.force, touched.moment)
        )
        return s.F_e + cs.vertcat(*parts)

    def true(self, x: cs.SX, s: Any, m: Any) -> Truth:
        """Return what is true at one instant."""
        arm, robot, n = self.robot.arm, self.view(x), self.robot.n
        torque, across = arm.chain.joint_units[2], ("axis", "column")
        at = self._touch(x, m)
        effects = self._effects(at, x, s, m)
        wrench, tau_e = self._pushed(_sum(effects, n), x, s, m)
        pose, tau_a = arm.pose(robot.q, m), self.robot.joint_torque(robot, m)
        return Truth(
            position=Signal(Field("position", (3,), "m", "end effector", axes=("axis",)), pose.position),
            rotation=Signal(
                Field("rotation", (3, 3), "1", "axes of the end effector", axes=across), pose.rotation
            ),
            tau_a=Signal(
                Field("tau_a", (n,), torque, "torque through the joint, positive on the link"), tau_a
            ),
            tau_e=Signal(Field("tau_e", (n,), torque, "external joint torque"), tau_e),
            wrench=Signal(
                Field("wrench", (6,), "N, N m", "all on the end effector", axes=("component",)), wrench
            ),
            energies=self._energies(robot, effects, m),
            touched=tuple(
                signal for e in self.elements if e.acts for signal in e.seen(self._own(e, at, x), s, m)
            ),
        )

    def _energies(self, x: RobotState, effects: list[Effect], m: Any) -> tuple[Signal, ...]:
        """Return what robot and elements store."""
        arm, stretch = self.robot.arm, x.theta - x.q

        def stored(name: str, what: str, value: cs.SX) -> Signal:
            return Signal(Field(name, (), "J", what), value)

        touching = zip(self.elements, effects, strict=True)
        return (
            stored("link_kinetic_energy", "½ q̇ᵀ M q̇", cs.dot(x.dq, arm.mass_matrix(x.q, m) @ x.dq) / 2),
            stored("motor_kinetic_energy", "½ θ̇ᵀ B θ̇", cs.dot(x.dtheta, m.motor_inertia * x.dtheta) / 2),
            stored(
                "joint_spring_energy", "½ (θ−q)ᵀ K (θ−q)", cs.dot(stretch, m.joint_stiffness * stretch) / 2
            ),
            stored("potential_energy", "V(q)", arm.potential_energy(x.q, m)),
            *(
                stored(e.books.storage, "stored in it", f.stored)
                for e, f in touching
                if e.stores and e in self.booked
            ),
        )

    @cached_property
    def rhs(self) -> cs.Function:
        """Return (x, u, p) → (ẋ, powers)."""
        n = self.robot.n
        x, u = cs.SX.sym("x", self.state.size), cs.SX.sym("u", n + self.environment.size)
        p, m = self.parameters.symbols("p")
        flow = self.flow(x, u[:n], self.environment.view(u[n:]), m)
        slope, powers = self.state.stack(flow.rate), self.energies.stack(flow.powers)
        return cs.Function("plant", [x, u, p], [cs.densify(slope), cs.densify(powers)], {"cse": True})


def given_by(effect: Effect, at: Touch) -> cs.SX:
    """Return the power that an element gives to the robot [W]."""
    at_tip = cs.dot(effect.force, at.velocity) + cs.dot(effect.moment, at.spin)
    return cs.dot(effect.motor, at.x.dtheta) + cs.dot(effect.link, at.x.dq) + at_tip


def _sum(effects: list[Effect], n: int) -> Effect:
    """Return what all of them do to the robot."""
    none, acting = nothing(n), ("motor", "link", "force", "moment")
    parts = {part: sum((getattr(e, part) for e in effects), getattr(none, part)) for part in acting}
    return none._replace(**parts)
