"""What a robot's computer does once per period: what the sensors have in, the motors' torque out, memory in and out.

It knows nothing of the plant: a simulation, another engine and a robot tell it the same things.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.control.signals import Measurement
from passiflex.layout import Field, Layout, Signal
from passiflex.loops.claims import claimed_energies, outer_torque, shaped_motion
from passiflex.parts import Parts
from passiflex.robots.arm import EndEffectorPose
from passiflex.sampled.controller import SampledController
from passiflex.sampled.motors import limit_layout, limited
from passiflex.sampled.readings import EXACT
from passiflex.sampled.rest import Rest
from passiflex.sampled.sensors import AbstractSensorEffect, Noise, Sensors
from passiflex.sampled.signals import ControlParameters, PeriodResult, Setpoint


class Period(NamedTuple):
    """One period in symbols: the memory after it, the torque that the motors are told, and what is recorded."""

    after: cs.SX
    applied: cs.SX
    signals: tuple[Signal, ...]


@dataclass(frozen=True, eq=False)
class PeriodLaw:
    """Sensors, controller and motor limits, one after the other.

    What the sensors do to a measurement is in its numbers: with `Sensors` at none of it, as a robot's own sensors have
    done it already, what goes in is what the controller reads.

    Attributes
    ----------
    effects: On the readings, beside those of the sensors' own.
    senses: Whether its sensors make readings late and noisy; those of a robot have done so already.
    """

    controller: SampledController
    effects: tuple[AbstractSensorEffect, ...] = ()
    senses: bool = True

    @cached_property
    def sensors(self) -> Sensors:
        """Return the sensors."""
        readings = self.controller.readings if self.senses else EXACT
        return Sensors(self.controller.law.robot.n, self.effects, readings)

    @cached_property
    def parameters(self) -> Parts:
        """Return the layouts of its numbers."""
        limits = limit_layout(self.controller.law.robot.n)
        layouts = self.controller.parameters.layouts
        return Parts({**layouts, "sensors": self.sensors.layout, "limits": limits})

    @cached_property
    def memory(self) -> Layout:
        """Return its state: the sensors', the controller's, and the torque of the motors."""
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
    def measurement(self) -> Layout:
        """Return what it is told of the robot, as `Measurement`."""
        n, (angle, speed, torque) = (
            self.controller.law.robot.n,
            self.controller.law.robot.arm.chain.joint_units,
        )
        return Layout(
            (
                Field("q", (n,), angle, "link position"),
                Field("theta", (n,), angle, "motor position"),
                Field("dq", (n,), speed, "link velocity"),
                Field("dtheta", (n,), speed, "motor velocity"),
                Field("tau_a", (n,), torque, "torque through the joint, positive on the link"),
                Field("F_e", (6,), "N, N m", "wrench on the end effector, world axes"),
                Field("tau_e", (n,), torque, "external joint torque"),
            )
        )

    def step(self, truth: Measurement, memory: cs.SX, c: Any, told: Any, views: Any) -> Period:
        """Return one period.

        Parameters
        ----------
        truth: What there is to be measured.
        memory, c: Its state, flat and by name.
        told: Of the row of a period, by name, at least `PeriodRow.told`.
        views: The numbers of its `parameters`, by part and name.
        """
        robot = self.controller.law.robot
        limits = views["limits"]
        noise = Noise(told.torque_noise)
        if self.controller.readings.noisy:
            noise = Noise(told.torque_noise, told.link_noise, told.motor_noise)
        y, read = self.sensors.read(truth, noise, told.elapsed, c, views["sensors"])
        setpoint = Setpoint(
            EndEffectorPose(told.desired_position, told.desired_rotation),
            told.desired_velocity,
            told.desired_acceleration,
            told.desired_stiffness,
            told.desired_damping,
            told.feedforward,
        )
        numbers = ControlParameters(**{part: views[part] for part in ControlParameters._fields})
        start = self.sensors.state.size
        own = memory[start : start + self.controller.state.size]
        result = self.controller.step(y, setpoint, told.elapsed, c.applied_torque, own, numbers)
        applied = limited(
            result.command.tau_m,
            c.applied_torque,
            limits.torque_limit,
            limits.torque_rate_limit,
            told.elapsed,
        )
        carried = robot.arm.potential_energy(y.q, views["model"])
        return Period(cs.vertcat(read, result.state, applied), applied, self._said(y, result, carried))

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
            *self._compensated(result),
        )

    def _compensated(self, result: PeriodResult) -> tuple[Signal, ...]:
        """Return what is given against friction, if anything is."""
        if not self.controller.compensates:
            return ()
        power = cs.dot(result.compensation, result.believed.dtheta)
        return (Signal(Field("compensation_power", (), "W", "given against friction, as it is read"), power),)

    def function(self, told: Layout) -> cs.Function:
        """Return (y, c, told, p) → (c, command, signals), with y as `measurement` and p as `parameters`."""
        y, measured = self.measurement.symbols("y")
        memory, c = self.memory.symbols("c")
        row, w = told.symbols("told")
        p = cs.SX.sym("p", self.parameters.size)
        truth = Measurement(*(getattr(measured, name) for name in Measurement._fields))
        period = self.step(truth, memory, c, w, self.parameters.view(p))
        out = [period.after, period.applied, Layout.of(period.signals).stack_of(period.signals)]
        return cs.Function("law", [y, memory, row, p], [cs.densify(v) for v in out], {"cse": True})
