"""A plant and what runs once per period, as compiled functions; and what is recorded of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.layout import Field, Layout, Signal
from passiflex.loops.period_law import PeriodLaw
from passiflex.loops.period_row import PeriodRow
from passiflex.loops.plant import ELEMENTS, Elements, Plant
from passiflex.loops.witness import LARGEST, Instant, Witness
from passiflex.native import Watch
from passiflex.parts import Parts
from passiflex.sampled.controller import SampledController
from passiflex.sampled.rest import Rest
from passiflex.sampled.sensors import AbstractSensorEffect, Sensors

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

    `plant.rhs` is the plant; `control` is (x, c, row, p) → (c, command, signals), one period: `plant.sense`, then the
    `law`; `outputs` is (x, command, environment, p) → what is true then; `period` makes the rows; `watch` is the
    witness at work.
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
    def law(self) -> PeriodLaw:
        """Return what runs once per period."""
        return PeriodLaw(self.controller, self.effects)

    @property
    def sensors(self) -> Sensors:
        """Return the sensors."""
        return self.law.sensors

    @cached_property
    def parameters(self) -> Parts:
        """Return the layouts of everything that `control` is told: the plant's come first."""
        return Parts({"plant": self.plant.parameters, **self.law.parameters.layouts})

    @property
    def memory(self) -> Layout:
        """Return the state of `control`."""
        return self.law.memory

    def start(self, at: Rest) -> NDArray[np.float64]:
        """Return the memory at rest, flat."""
        return self.law.start(at)

    @cached_property
    def period(self) -> PeriodRow:
        """Return how the row of a period comes about."""
        law = self.controller.law
        noisy = self.controller.readings.noisy
        return PeriodRow(law.robot.n, law.task.size, self.plant.environment, law.task.turned, noisy)

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
        state, p = cs.SX.sym("x", self.plant.state.size), cs.SX.sym("p", self.parameters.size)
        memory, c = self.memory.symbols("c")
        row, w = self.row.symbols("row")
        views = self.parameters.view(p)
        truth = self.plant.sense(state, w, views["plant"])
        return _Period((state, memory, row, p), *self.law.step(truth, memory, c, w, views))

    @cached_property
    def control(self) -> cs.Function:
        """Return (x, c, row, p) → (c, command, signals)."""
        period = self._period
        told = [period.after, period.applied, self.signals.stack_of(period.signals)]
        return cs.Function("control", list(period.inputs), [cs.densify(v) for v in told], {"cse": True})

    @cached_property
    def sense(self) -> cs.Function:
        """Return (x, environment, p) → what there is to be measured, with p as for the plant."""
        x, (s, environment) = cs.SX.sym("x", self.plant.state.size), self.plant.environment.symbols("s")
        p, m = self.plant.parameters.symbols("p")
        measured = cs.vertcat(*self.plant.sense(x, environment, m))
        return cs.Function("sense", [x, s, p], [cs.densify(measured)], {"cse": True})

    @cached_property
    def law_alone(self) -> cs.Function:
        """Return (measured, c, row without environment, p without the plant's) → (c, command, signals).

        It is one period of `control` for those who have a plant of their own.
        """
        return self.law.function(self.period.told)

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
