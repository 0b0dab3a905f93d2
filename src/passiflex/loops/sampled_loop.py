"""One control period as a compiled function: sensors, controller, motor limits; and what is recorded of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.control.signals import Measurement
from passiflex.layout import Field, Layout, Signal
from passiflex.loops.claims import claimed_energies, outer_torque, shaped_motion
from passiflex.loops.period_row import PeriodRow
from passiflex.loops.plant import ELEMENTS, Elements, Plant
from passiflex.loops.witness import LARGEST, Instant, Witness
from passiflex.native import Watch
from passiflex.parts import Parts
from passiflex.robots.arm import EndEffectorPose
from passiflex.sampled.controller import SampledController
from passiflex.sampled.motors import limit_layout, limited
from passiflex.sampled.rest import Rest
from passiflex.sampled.sensors import AbstractSensorEffect, Sensors
from passiflex.sampled.signals import ControlParameters, PeriodResult, Setpoint

AT_ONCE = 1e-7
"""Two instants closer than this are one [s], after millions of periods; a law claims a level when it reads."""


class _Period(NamedTuple):
    """One period in symbols: (x, c, row, p), the memory after it, the torque applied, and what is recorded."""

    inputs: tuple[cs.SX, ...]
    after: cs.SX
    applied: cs.SX
    signals: tuple[Signal, ...]


class _Truth(NamedTuple):
    """One instant in symbols: (x, command, environment, p), and what is true then."""

    inputs: tuple[cs.SX, ...]
    signals: tuple[Signal, ...]


@dataclass(frozen=True, eq=False)
class SampledLoop:
    """Plant and controller as functions of flat vectors, ready for code generation.

    `plant.rhs` is the plant; `control` is (x, c, row, p) → (c, command, signals), one period; `outputs` is
    (x, command, environment, p) → what is true then; `period` makes the rows; `watch` is
    the witness at work.
    """

    controller: SampledController
    elements: Elements = ELEMENTS
    effects: tuple[AbstractSensorEffect, ...] = ()
    """On the readings, beside those of the sensors' own."""

    @cached_property
    def plant(self) -> Plant:
        """Return the plant."""
        return Plant(self.controller.law.robot, self.elements)

    @cached_property
    def sensors(self) -> Sensors:
        """Return the sensors."""
        return Sensors(self.controller.law.robot.n, self.effects)

    @cached_property
    def parameters(self) -> Parts:
        """Return the layouts of everything that `control` is told."""
        own = self.controller.parameters
        limits = limit_layout(self.controller.law.robot.n)
        return Parts(
            {"plant": self.plant.parameters, **own.layouts, "sensors": self.sensors.layout, "limits": limits}
        )

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
        return PeriodRow(law.robot.n, law.task.size, self.plant.environment, law.task.turned)

    @property
    def row(self) -> Layout:
        """Return what is told anew in every period; the environment come first."""
        return self.period.layout

    @property
    def signals(self) -> Layout:
        """Return what `control` says of one period."""
        return Layout.of(self._period.signals)

    @property
    def truth(self) -> Layout:
        """Return what `outputs` says of one instant."""
        return Layout.of(self._truth.signals)

    @cached_property
    def _period(self) -> _Period:
        robot = self.controller.law.robot
        state, p = cs.SX.sym("x", self.plant.state.size), cs.SX.sym("p", self.parameters.size)
        memory, c = self.memory.symbols("c")
        row, w = self.row.symbols("row")
        views, x = self.parameters.view(p), self.plant.view(state)
        plant, limits = views["plant"], views["limits"]
        wrench, tau_a = self.plant.wrench(state, w, plant), robot.joint_torque(x, plant)
        tau_e = robot.arm.jacobian(x.q, plant).T @ wrench
        y, read = self.sensors.read(
            Measurement(*x, tau_a, wrench, tau_e), w.torque_noise, w.elapsed, c, views["sensors"]
        )
        setpoint = Setpoint(
            EndEffectorPose(w.desired_position, w.desired_rotation),
            w.desired_velocity,
            w.desired_acceleration,
            w.desired_stiffness,
            w.desired_damping,
            w.feedforward,
        )
        numbers = ControlParameters(**{part: views[part] for part in ControlParameters._fields})
        start = self.sensors.state.size
        own = memory[start : start + self.controller.state.size]
        result = self.controller.step(y, setpoint, w.elapsed, c.applied_torque, own, numbers)
        applied = limited(
            result.command.tau_m, c.applied_torque, limits.torque_limit, limits.torque_rate_limit, w.elapsed
        )
        carried = robot.arm.potential_energy(y.q, views["model"])
        return _Period(
            (state, memory, row, p),
            cs.vertcat(read, result.state, applied),
            applied,
            self._said(y, result, carried),
        )

    def _said(self, y: Measurement, result: PeriodResult, carried: cs.SX) -> tuple[Signal, ...]:
        """Return what is recorded of a period."""
        robot, command, entry = self.controller.law.robot, result.command, result.entry
        n, (angle, speed, torque) = robot.n, robot.arm.chain.joint_units

        def read(name: str, unit: str, symbol: str, value: cs.SX) -> Signal:
            return Signal(Field(f"measured_{name}", (n,), unit, f"{symbol} as the sensors have it"), value)

        believed = result.believed.tau_e
        return (
            read("q", angle, "q", y.q),
            read("theta", angle, "θ", y.theta),
            read("dq", speed, "q̇", y.dq),
            read("dtheta", speed, "θ̇", y.dtheta),
            read("tau_a", torque, "τ_a", y.tau_a),
            Signal(Field("believed_tau_e", (n,), torque, "τ_e as the law believes it"), believed),
            Signal(Field("commanded_torque", (n,), torque, "τ_m before the motors' limits"), command.tau_m),
            outer_torque(robot, command),
            *shaped_motion(robot, command),
            *claimed_energies(command, carried, "x̂_d"),
            Signal(Field("reference_share", (), "1", "γ of the reference"), entry.reference_share),
            Signal(Field("stiffness_share", (), "1", "γ of the stiffness"), entry.stiffness_share),
            Signal(Field("valve", (), "1", "β"), entry.valve),
        )

    @cached_property
    def control(self) -> cs.Function:
        """Return (x, c, row, p) → (c, command, signals)."""
        period = self._period
        told = [period.after, period.applied, self.signals.stack_of(period.signals)]
        return cs.Function("control", list(period.inputs), [cs.densify(v) for v in told], {"cse": True})

    @cached_property
    def _truth(self) -> _Truth:
        robot = self.controller.law.robot
        state, command = cs.SX.sym("x", self.plant.state.size), cs.SX.sym("command", robot.n)
        environment, s = self.plant.environment.symbols("s")
        p = cs.SX.sym("p", self.parameters.size)
        views, x = self.parameters.view(p), self.plant.view(state)
        carried = Field("carried_energy", (), "J", "V̂(q) of the law's model, where the links really are")
        powers = self.plant.flow(state, command, s, views["plant"]).powers.items()
        rates = (Signal(Field(f"{f}_power", (), "W", f"rate of {f}_energy"), power) for f, power in powers)
        signals = (
            *self.plant.true(state, s, views["plant"]).signals,
            Signal(carried, robot.arm.potential_energy(x.q, views["model"])),
            *rates,
        )
        return _Truth((state, command, environment, p), signals)

    @cached_property
    def outputs(self) -> cs.Function:
        """Return (x, command, environment, p) → `truth`, with p as for `control`."""
        true = cs.densify(self.truth.stack_of(self._truth.signals))
        return cs.Function("truth", list(self._truth.inputs), [true], {"cse": True})

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
            cs.SX.sym("y", self.plant.state.size + self.plant.energies.size),
        )
        controller, c = self.memory.symbols("c")
        signals, z = self.signals.symbols("z")
        p = cs.SX.sym("p", size + witness.parameters.size)
        views = self.parameters.view(p[:size])
        end = self.plant.state.size
        x, passed = self.plant.view(y[:end]), self.plant.energies.view(y[end:])
        level = c.tank_energy if law.has_tank else -c.reference_energy  # which was lent
        claimed = ("shaped_kinetic", "cartesian_spring", "shaped_spring", "compensated")
        carried = arm.potential_energy(x.q, views["model"])
        now = Instant(
            time=time,
            q=x.q,
            dq=x.dq,
            tau_m=command,
            link_kinetic=arm.kinetic_energy(x.q, x.dq, views["plant"]),
            link_potential=arm.potential_energy(x.q, views["plant"]),
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
