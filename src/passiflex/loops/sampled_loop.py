"""One control period as a compiled function: sensors, controller, motor limits; and what is recorded of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.control.signals import Measurement
from passiflex.layout import Field, Layout
from passiflex.loops.parts import Parts
from passiflex.loops.period_row import PeriodRow
from passiflex.loops.plant import ELEMENTS, Elements, Plant
from passiflex.loops.witness import LARGEST, Instant, Witness
from passiflex.native import Watch
from passiflex.robots.arm import EndEffectorPose
from passiflex.sampled.controller import SampledController
from passiflex.sampled.motors import limit_layout, limited
from passiflex.sampled.rest import Rest
from passiflex.sampled.sensors import Sensors
from passiflex.sampled.signals import ControlParameters, Setpoint

AT_ONCE = 1e-7
"""Two instants closer than this are one [s], after millions of periods; a law claims a level when it reads."""


@dataclass(frozen=True, eq=False)
class SampledLoop:
    """Plant and controller as functions of flat vectors, ready for code generation.

    `plant.rhs` is the plant; `control` is (x, c, row, p) → (c, command, signals), one period; `outputs` is
    (x, command, environment, p) → what is true then; `period` makes the rows; `watch` is
    the witness at work.
    """

    controller: SampledController
    elements: Elements = ELEMENTS

    @cached_property
    def plant(self) -> Plant:
        """Return the plant."""
        return Plant(self.controller.law.robot, self.elements)

    @cached_property
    def sensors(self) -> Sensors:
        """Return the sensors."""
        return Sensors(self.controller.law.robot.n)

    @cached_property
    def parameters(self) -> Parts:
        """Return the layouts of everything that `control` is told."""
        n = self.controller.law.robot.n
        model, gains, fallback, tank, actions, observer, inner, errors = self.controller.parameters
        plant, sensors, limits = self.plant.parameters, self.sensors.layout, limit_layout(n)
        own = model, gains, fallback, tank, actions, observer, inner, errors
        return Parts(plant, *own, sensors, limits)

    @cached_property
    def memory(self) -> Layout:
        """Return the state of `control`: the sensors', the controller's, and the torque of the motors."""
        n = self.controller.law.robot.n
        told = "that the motors were last told to give"
        torque = Field("applied_torque", (n,), "N m", told, kept=False, acts=True)
        return self.sensors.state + self.controller.state + Layout((torque,))

    def start(self, at: Rest) -> NDArray[np.float64]:
        """Return the memory at rest, flat."""
        return self.memory.pack(
            self.sensors.start(at) | self.controller.start(at) | {"applied_torque": at.command}
        )

    @cached_property
    def period(self) -> PeriodRow:
        """Return how the row of a period comes about."""
        law = self.controller.law
        return PeriodRow(law.robot.n, law.task.size, self.plant.environment)

    @property
    def row(self) -> Layout:
        """Return what is told anew in every period; the environment come first."""
        return self.period.layout

    @cached_property
    def signals(self) -> Layout:
        """Return what `control` says of one period."""
        robot = self.controller.law.robot
        n, (angle, speed, torque) = robot.n, robot.arm.chain.joint_units
        claimed = "claimed by the law"
        return Layout(
            (
                Field("measured_q", (n,), angle, "q as the sensors have it"),
                Field("measured_theta", (n,), angle, "θ as the sensors have it"),
                Field("measured_dq", (n,), speed, "q̇ as the sensors have it"),
                Field("measured_dtheta", (n,), speed, "θ̇ as the sensors have it"),
                Field("measured_tau_a", (n,), torque, "τ_a as the sensors have it"),
                Field("believed_tau_e", (n,), torque, "τ_e as the law believes it"),
                Field("commanded_torque", (n,), torque, "τ_m before the motors' limits"),
                Field("tau_u", (n,), torque, "outer-loop torque"),
                Field("phi", (n,), angle, "shaped motor coordinate of (11)"),
                Field("dphi", (n,), speed, "its velocity"),
                Field("compensated_energy", (), "J", f"V̂(q) of the law's model, {claimed}"),
                Field("shaped_kinetic_energy", (), "J", f"½ φ̇ᵀ B_e φ̇, {claimed}"),
                Field("shaped_spring_energy", (), "J", f"½ (φ−q)ᵀ K_e (φ−q), {claimed}"),
                Field("cartesian_spring_energy", (), "J", f"U(φ; x̂_d), {claimed}"),
                Field("gravity_storage", (), "J", f"of the gravity compensation, {claimed}"),
                Field("reference_share", (), "1", "γ of the reference"),
                Field("stiffness_share", (), "1", "γ of the stiffness"),
                Field("valve", (), "1", "β"),
            )
        )

    @cached_property
    def truth(self) -> Layout:
        """Return what `outputs` says of one instant."""
        carried = Field("carried_energy", (), "J", "V̂(q) of the law's model, where the links really are")
        powers = (Field(f"{f.name}_power", (), "W", f"rate of {f.name}_energy") for f in self.plant.energies)
        return self.plant.truth + Layout((carried, *powers))

    @cached_property
    def control(self) -> cs.Function:
        """Return (x, c, row, p) → (c, command, signals)."""
        robot = self.controller.law.robot
        state = cs.SX.sym("x", 4 * robot.n)
        memory, c = self.memory.symbols("c")
        row, w = self.row.symbols("row")
        p = cs.SX.sym("p", self.parameters.size)
        views = self.parameters.view(p)
        x = self.plant.view(state)
        wrench, tau_a = self.plant.wrench(x, w, views.plant), robot.joint_torque(x, views.plant)
        tau_e = robot.arm.jacobian(x.q, views.plant).T @ wrench
        true = Measurement(x.q, x.theta, x.dq, x.dtheta, tau_a, wrench, tau_e)
        y, read = self.sensors.read(true, w.torque_noise, w.elapsed, c, views.sensors)
        setpoint = Setpoint(
            EndEffectorPose(w.desired_position, w.desired_rotation),
            w.desired_velocity,
            w.desired_acceleration,
            w.desired_stiffness,
            w.desired_damping,
            w.feedforward,
        )
        told = ControlParameters(*(getattr(views, part) for part in ControlParameters._fields))
        start = self.sensors.state.size
        own = memory[start : start + self.controller.state.size]
        command, after, entry, believed = self.controller.step(
            y, setpoint, w.elapsed, c.applied_torque, own, told
        )
        limits = views.limits
        given = limited(
            command.tau_m, c.applied_torque, limits.torque_limit, limits.torque_rate_limit, w.elapsed
        )
        claim = command.energy
        signals = self.signals.stack(
            {
                "measured_q": y.q,
                "measured_theta": y.theta,
                "measured_dq": y.dq,
                "measured_dtheta": y.dtheta,
                "measured_tau_a": y.tau_a,
                "believed_tau_e": believed.tau_e,
                "commanded_torque": command.tau_m,
                "tau_u": command.tau_u,
                "phi": command.phi,
                "dphi": command.dphi,
                "compensated_energy": robot.arm.potential_energy(y.q, views.model),
                "shaped_kinetic_energy": claim.motor_kinetic,
                "shaped_spring_energy": claim.joint_spring,
                "cartesian_spring_energy": claim.cartesian_spring,
                "gravity_storage": claim.gravity_storage,
                "reference_share": entry.reference_share,
                "stiffness_share": entry.stiffness_share,
                "valve": entry.valve,
            }
        )
        next_memory = cs.vertcat(read, after, given)
        return cs.Function(
            "control",
            [state, memory, row, p],
            [cs.densify(next_memory), cs.densify(given), cs.densify(signals)],
            {"cse": True},
        )

    @cached_property
    def outputs(self) -> cs.Function:
        """Return (x, command, environment, p) → `truth`, with p as for `control`."""
        robot = self.controller.law.robot
        state, command = cs.SX.sym("x", 4 * robot.n), cs.SX.sym("command", robot.n)
        environment, s = self.plant.environment.symbols("s")
        p = cs.SX.sym("p", self.parameters.size)
        views, x = self.parameters.view(p), self.plant.view(state)
        powers = self.plant.flow(x, command, s, views.plant).powers
        true = self.plant.true(x, s, views.plant) | {
            "carried_energy": robot.arm.potential_energy(x.q, views.model),
            **{f"{name}_power": power for name, power in powers.items()},
        }
        told = [state, command, environment, p]
        return cs.Function("truth", told, [cs.densify(self.truth.stack(true))], {"cse": True})

    @cached_property
    def witness(self) -> Witness:
        """Return what notes the extremes."""
        return Witness.of(self.controller.law.robot, has_tank=self.controller.law.has_tank, sampled=True)

    @cached_property
    def watch(self) -> Watch:
        """Return what the witness does at a sample and at a step; its p is that of `control`, then its own."""
        law, witness, n = self.controller.law, self.witness, self.controller.law.robot.n
        arm, size = law.robot.arm, self.parameters.size
        memory, w = witness.memory.symbols("w")
        time, command, y = (
            cs.SX.sym("time"),
            cs.SX.sym("command", n),
            cs.SX.sym("y", 4 * n + self.plant.energies.size),
        )
        controller, c = self.memory.symbols("c")
        signals, z = self.signals.symbols("z")
        p = cs.SX.sym("p", size + witness.parameters.size)
        views = self.parameters.view(p[:size])
        x, passed = self.plant.view(y[: 4 * n]), self.plant.energies.view(y[4 * n :])
        level = c.tank_energy if law.has_tank else -c.reference_energy  # which was lent
        claimed = ("shaped_kinetic", "cartesian_spring", "shaped_spring", "compensated")
        carried = arm.potential_energy(x.q, views.model)
        now = Instant(
            time=time,
            q=x.q,
            dq=x.dq,
            tau_m=command,
            link_kinetic=arm.kinetic_energy(x.q, x.dq, views.plant),
            link_potential=arm.potential_energy(x.q, views.plant),
            carried=carried,
            external=passed.external,
            joint=passed.joint,
            reference=c.reference_energy,
            storage=sum((getattr(z, f"{part}_energy") for part in claimed), z.gravity_storage),
            books=level + c.law_storage + c.measured_port_energy + c.spilled_energy,
            beyond=cs.if_else(time - c.read_time < AT_ONCE, level + c.law_storage + passed.joint, -LARGEST),
            latched=c.latched,
        )
        looked = witness.look(w, now, witness.parameters.view(p[size:]))
        glanced = witness.glance(w, time, passed.joint, carried)
        seen = [memory, time, y, command, controller, signals, p]
        return Watch(
            cs.Function("look", seen, [cs.densify(looked)], {"cse": True}),
            cs.Function("glance", [memory, time, y, p], [cs.densify(glanced)], {"cse": True}),
        )
