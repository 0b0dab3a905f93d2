"""One control period: step(measurement, setpoint, elapsed, state, parameters) → (command, state, ledger entry)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, final

import casadi as cs

from passiflex.control.law import AbstractLaw, Stored
from passiflex.control.signals import Command, Measurement, Reference
from passiflex.layout import Field, Layout
from passiflex.parts import Parts
from passiflex.robots.arm import EndEffectorPose
from passiflex.sampled.actions import action_layout, friction_compensation, gated_torque
from passiflex.sampled.declared_errors import error_layout
from passiflex.sampled.external import AbstractExternalTorque, Known, TrueTorque
from passiflex.sampled.governor import govern_pose, govern_stiffness
from passiflex.sampled.held_task import HeldTask
from passiflex.sampled.inner_loop import AbstractInnerLoop, PlainInnerLoop
from passiflex.sampled.measurement_bound import (
    booked_bound,
    bound_state,
    jitter,
    sure_state,
)
from passiflex.sampled.period import Commanded, Force, Granted, Read, Settled, chosen, chosen_pose
from passiflex.sampled.period_state import period_after, period_start, period_state
from passiflex.sampled.readings import EXACT, Readings
from passiflex.sampled.rest import Remembered, Rest
from passiflex.sampled.signals import ControlParameters, LedgerEntry, ObserverNumbers, PeriodResult, Setpoint
from passiflex.sampled.tank import AbstractTank, PeriodFlows, added, finite, unchanged

LARGEST_READING = 1e30
"""A reading beyond it is no measurement: its energy could not be told from infinity."""


@final
@dataclass(frozen=True, eq=False)
class SampledController:
    """A law with its tank, governor, gated actions and fallback, once per period.

    In this order, within one period, each a method: estimators believe what was read; the tank settles what the
    period before took or gave; if it is overdrawn by then, the law falls back for good; the governor grants what the
    tank can pay of the new reference; the valve opens as far as the level allows; the law commands. Without a tank
    nothing is governed or gated, and the port's energy is only counted.
    """

    law: AbstractLaw
    tank: AbstractTank | None = None
    external: AbstractExternalTorque = field(default_factory=TrueTorque)
    inner: AbstractInnerLoop = field(default_factory=PlainInnerLoop)
    actions: bool = True
    """Whether anything acts that the valve gates: without, a third of the arithmetic is left out."""
    compensates: bool = False
    """Whether friction of the motors is made up for, if anything acts."""
    held_task: HeldTask | None = None
    """Set where the outer loop has a clock of its own, slower than that of the joints."""
    readings: Readings = EXACT
    """Which of them are late or noisy: the books pair them."""

    @cached_property
    def parameters(self) -> Parts:
        """Return the layouts of `ControlParameters`, by the names of its parts."""
        robot, gains = self.law.robot, self.law.layout
        layouts = {
            "model": robot.layout,
            "gains": gains,
            "fallback": gains,
            "tank": AbstractTank.layout,
            "actions": action_layout(robot.n),
            "observer": Layout(
                (Field("bandwidth", (), "rad/s", "of the external torque's estimator"),), ObserverNumbers
            ),
            "inner": AbstractInnerLoop.layout,
            "errors": error_layout(robot.n),
        }
        return Parts({part: layouts[part] for part in ControlParameters._fields})

    @cached_property
    def state(self) -> Layout:
        """Return what is remembered from one period to the next; energies are sums since the start."""
        n, k = self.law.robot.n, self.law.task.size
        books = period_state(n, k) + bound_state(n, self.readings) + sure_state(n, self.readings)
        return books + self.external.state(n) + self.inner.state(n) + self._of_the_command

    @property
    def _of_the_command(self) -> Layout:
        """Return what is remembered of a command."""
        n = self.law.robot.n
        given = Field("compensation", (n,), "N m", "against friction", kept=False, acts=True)
        held = self.held_task.state(n) if self.held_task else Layout(())
        return Layout((given,)) + held if self.compensates else held

    def start(self, at: Rest) -> Remembered:
        """Return what is remembered at rest, of each field of the state."""
        n, k = self.law.robot.n, self.law.task.size
        bounds = (bound_state(n, self.readings) + sure_state(n, self.readings)).zeros()
        held = self.held_task.start(at) if self.held_task else {}
        command = self._of_the_command.zeros() | held
        return period_start(n, k, at) | bounds | self.external.start(at) | self.inner.start(at) | command

    def step(
        self,
        y: Measurement,
        setpoint: Setpoint,
        elapsed: cs.SX,
        applied: cs.SX,
        state: cs.SX,
        p: ControlParameters,
    ) -> PeriodResult:
        """Return command, next state and ledger entry, `elapsed` seconds after the last period that ran.

        `applied` (n,) is the torque that the motors were told then, after their limits.
        """
        s = self.state.view(state)
        ok = finite(elapsed, applied, *y, *setpoint.pose, *setpoint[1:], below=LARGEST_READING)
        read = self._read(y, applied, elapsed, s, p)
        force = self._in_force(read, self._settle(read, s, p), s, p)
        granted = self._grant(read, force, setpoint, p)
        command, valve, compensation, kept = self._command(read, force, granted, setpoint, s, p)
        variable = self._potential(force.now, granted.pose, granted.stiffness - p.gains.stiffness)
        asked, floor = setpoint.pose.position, p.tank.tank_floor
        values = period_after(read, force, granted, asked, command, variable, floor, s)
        own = period_state(self.law.robot.n, self.law.task.size) + bound_state(
            self.law.robot.n, self.readings
        )
        own += sure_state(self.law.robot.n, self.readings)
        after = cs.vertcat(own.stack(values), read.observed, read.seen, kept)
        faulty = self.state.stack(vars(s) | {"faults": s.faults + 1, "lost_time": read.elapsed})
        safe = command._replace(tau_m=cs.if_else(ok, command.tau_m, s.last_command))
        entry = LedgerEntry(
            tank=added(force.tank, granted.entry),
            rebased=force.rebased,
            port_energy=force.work,
            storage=force.storage + granted.cost,
            reference_share=granted.pose_share,
            stiffness_share=granted.stiffness_share,
            valve=valve,
            latched=force.latched,
            bound=read.bound.total,
            fault=1 - ok,
        )
        return PeriodResult(safe, cs.if_else(ok, after, faulty), entry, read.y, compensation)

    def _read(
        self,
        y: Measurement,
        applied: cs.SX,
        elapsed: cs.SX,
        s: Any,
        p: ControlParameters,
    ) -> Read:
        """Return the measurement as estimators and inner loop believe it."""
        elapsed = s.lost_time + cs.if_else(finite(elapsed, below=LARGEST_READING), elapsed, 0)
        known = Known(self.law.robot.arm, p.model, p.observer.bandwidth)
        y, observed = self.external.estimate(y, elapsed, known, s)
        moving = applied - s.compensation if self.compensates else applied  # the rest is what friction takes
        y, seen = self.inner.see(y, moving, elapsed, s, p.model, p.inner)
        first = s.running < 1
        paired = self.readings.pair(y, elapsed, first, s, p.errors)
        bound = booked_bound(paired, elapsed, first, s, p.errors, self.readings)
        return Read(y, elapsed, first, observed, seen, paired, bound)

    def _settle(self, r: Read, s: Any, p: ControlParameters) -> Settled:
        """Return the books after what the period before took or gave."""
        held = EndEffectorPose(s.governed_position, s.governed_rotation)
        before = self.law.stored(r.y, p.model, chosen(s.latched, p.fallback, p.gains))
        spring = self._potential(before, held, s.held_stiffness)
        storage = before.energy + spring
        variable = self._potential(before, held, s.held_stiffness - p.gains.stiffness)
        work = cs.if_else(r.first, 0, cs.dot(s.last_tau_a + r.paired.tau_a, r.paired.q - s.last_q) / 2)
        flows = PeriodFlows(
            elapsed=r.elapsed,
            port_energy=work,
            storage_change=cs.if_else(r.first, 0, storage - s.law_storage),
            claimed_loss=s.claimed_power * r.elapsed,
            claimed_cartesian_loss=s.claimed_cartesian_power * r.elapsed,
            variable_spring_work=cs.if_else(r.first, 0, variable - s.variable_potential),
        )
        settled = self.tank.settle(s.tank_energy, flows, p.tank) if self.tank else unchanged(s.tank_energy)
        shakes = cs.SX(0)
        if self.readings.noisy:
            quadratic = before.motor_kinetic + before.joint_spring + spring
            carries = (
                not before.gravity_storage.is_zero()
            )  # whose slope at rest is that of the joints' springs
            shakes = (1 + carries) * jitter(quadratic, p.errors)
        return Settled(settled, work, storage, held, shakes)

    def _in_force(self, r: Read, settled: Settled, s: Any, p: ControlParameters) -> Force:
        """Return what is in force: the fallback from the period on in which the tank is overdrawn, T + S kept.

        It is overdrawn if its level shows it beyond what the sensors explain.
        """
        tank, bound = settled.tank, r.bound
        falls = self.tank is not None and self.tank.falls_back
        lowered = bound.lowered
        if self.readings.noisy:
            lowered += p.errors.jitter_mean + settled.jitter + s.sure_storage_jitter
        short = tank.level + lowered < p.tank.tank_trip + s.sure_measurement_bound
        overdrawn = cs.logic_and(short, s.latched < 1) if falls else cs.SX(0)
        latched = cs.fmax(s.latched, overdrawn)
        gains = chosen(latched, p.fallback, p.gains)
        now = self.law.stored(r.y, p.model, gains)
        restored = cs.if_else(overdrawn, now.energy, settled.storage)  # slack at the pose just read
        rebased = cs.if_else(overdrawn, settled.storage - restored, 0)
        return Force(
            now=now,
            gains=gains,
            latched=latched,
            held=chosen_pose(overdrawn, now.pose, settled.held),
            held_stiffness=cs.if_else(overdrawn, p.fallback.stiffness, s.held_stiffness),
            storage=restored,
            rebased=rebased,
            tank=tank._replace(level=tank.level + rebased),
            lowest=tank.level,
            work=settled.work,
            doubt=bound.total + settled.jitter if self.tank is not None and self.tank.measures else cs.SX(0),
            jitter=settled.jitter,
        )

    def _command(
        self,
        r: Read,
        f: Force,
        granted: Granted,
        setpoint: Setpoint,
        s: Any,
        p: ControlParameters,
    ) -> Commanded:
        """Return the law's command with what the valve lets through."""
        level = granted.entry.level
        valve = (1 - f.latched) * self.tank.valve(level - f.doubt, p.tank) if self.tank else cs.SX(1)
        g = f.gains
        g.stiffness = granted.stiffness
        g.damping = cs.if_else(f.latched, p.fallback.damping, setpoint.damping)
        torque = against = cs.SX.zeros(self.law.robot.n)
        if self.actions:
            torque += valve * gated_torque(self.law, r.y, f.now, setpoint, granted, g, p)
        if self.compensates:
            against = valve * friction_compensation(r.y.dtheta, p.actions)
        braked = torque
        if self.tank:
            damping = self.tank.braking(level, cs.dot(f.now.dphi, f.now.dphi), r.elapsed, p.tank)
            braked = torque - damping * f.now.dphi
        reference, memory = Reference(granted.pose, setpoint.velocity), self.inner.state(self.law.robot.n)

        def commanded(added: cs.SX) -> Command:
            return self.inner.command(
                self.law, r.y, reference, p.model, g, added, memory.view(r.seen), p.inner
            )

        kept = {"compensation": against}
        if self.held_task is None:
            command = commanded(braked)
        else:
            command = commanded(torque)  # a tank brakes in every period
            due = self.held_task.due(r.first, r.elapsed, s, p.inner)
            runs = cs.logic_or(due.now, f.latched > s.latched)
            held = cs.if_else(runs, command.tau_u, s.task_torque)
            kept |= {"task_torque": held, "task_age": due.age}
            command = commanded(braked + held - command.tau_u)
        command = command._replace(tau_m=command.tau_m + against)
        layout = self._of_the_command
        memory = layout.stack({field.name: kept[field.name] for field in layout})
        return Commanded(command, valve, against, memory)

    def _potential(self, at: Stored, reference: EndEffectorPose, stiffness: cs.SX) -> cs.SX:
        return self.law.potential(at, reference, stiffness)

    def _grant(self, r: Read, f: Force, setpoint: Setpoint, p: ControlParameters) -> Granted:
        """Return the reference as far as the tank surely pays for it; a law that has fallen back holds its own."""
        one, level = cs.SX(1), f.tank.level
        if self.tank is None:
            stored = self._potential(f.now, setpoint.pose, setpoint.stiffness)
            cost = stored - self._potential(f.now, f.held, f.held_stiffness)
            return Granted(setpoint.pose, setpoint.stiffness, one, one, cost, unchanged(level))
        task, tank = self.law.task, self.tank
        share, base = tank.stiffness_share(level - f.doubt, p.tank), p.gains.stiffness
        wanted = cs.if_else(share < 1, base + share * (setpoint.stiffness - base), setpoint.stiffness)
        wanted = cs.if_else(f.latched, f.held_stiffness, wanted)
        signed = p.tank.tank_signed
        budget = tank.budget(level - f.doubt, r.elapsed, p.tank)
        stiffness = govern_stiffness(task, f.now.pose, f.held, f.held_stiffness, wanted, budget, signed)
        first = tank.pay(level, stiffness.cost, p.tank)
        budget = cs.fmax(budget - first.granted, 0)
        goal = chosen_pose(f.latched, f.held, setpoint.pose)
        pose = govern_pose(task, f.now.pose, f.held, goal, stiffness.value, budget, signed)
        second = tank.pay(first.level, pose.cost, p.tank)
        return Granted(
            pose=pose.value,
            stiffness=stiffness.value,
            pose_share=pose.share,
            stiffness_share=stiffness.share,
            cost=stiffness.cost + pose.cost,
            entry=added(first, second),
        )
