"""One control period: step(measurement, setpoint, elapsed, state, parameters) → (command, state, ledger entry)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from types import SimpleNamespace
from typing import NamedTuple, final

import casadi as cs

from passiflex.control.law import AbstractLaw, Stored
from passiflex.control.signals import Measurement, Reference
from passiflex.layout import Field, Layout
from passiflex.parts import Parts
from passiflex.robots.arm import EndEffectorPose
from passiflex.sampled.actions import action_layout, posture_spring, tracking_wrench
from passiflex.sampled.external import AbstractExternalTorque, Known, TrueTorque
from passiflex.sampled.governor import govern_pose, govern_stiffness
from passiflex.sampled.inner_loop import AbstractInnerLoop, PlainInnerLoop
from passiflex.sampled.measurement_bound import booked_bound, bound_state, error_layout, sure, sure_state
from passiflex.sampled.period_state import period_start, period_state
from passiflex.sampled.rest import Remembered, Rest
from passiflex.sampled.signals import ControlParameters, LedgerEntry, PeriodResult, Setpoint
from passiflex.sampled.tank import AbstractTank, PeriodFlows, TankEntry, added, finite, unchanged

LARGEST_READING = 1e30
"""A reading beyond it is no measurement: its energy could not be told from infinity."""


class _Granted(NamedTuple):
    """The reference and stiffness in force, with what they cost."""

    pose: EndEffectorPose
    stiffness: cs.SX
    pose_share: cs.SX
    stiffness_share: cs.SX
    cost: cs.SX
    entry: TankEntry


@final
@dataclass(frozen=True, eq=False)
class SampledController:
    """A law with its tank, governor, gated actions and fallback, once per period.

    In this order, within one period: the tank settles what the period before took or gave; if it is
    overdrawn by then, the law falls back for good; the governor grants what the tank can pay of the new
    reference; the valve opens as far as the level allows; the law commands. Without a tank nothing is
    governed or gated, and the port's energy is only counted.
    """

    law: AbstractLaw
    tank: AbstractTank | None = None
    external: AbstractExternalTorque = field(default_factory=TrueTorque)
    inner: AbstractInnerLoop = field(default_factory=PlainInnerLoop)
    actions: bool = True
    """Whether anything acts that the valve gates: without, a third of the arithmetic is left out."""

    @cached_property
    def parameters(self) -> Parts:
        """Return the layouts of `ControlParameters`, by the names of its parts."""
        robot, gains = self.law.robot, self.law.layout
        observer = Layout((Field("bandwidth", (), "rad/s", "of the external torque's estimator"),))
        actions = action_layout(robot.n)
        layouts = ControlParameters(
            model=robot.layout,
            gains=gains,
            fallback=gains,
            tank=AbstractTank.layout,
            actions=actions,
            observer=observer,
            inner=AbstractInnerLoop.layout,
            errors=error_layout(robot.n),
        )
        return Parts(layouts._asdict())

    @cached_property
    def state(self) -> Layout:
        """Return what is remembered from one period to the next; energies are sums since the start."""
        n, k = self.law.robot.n, self.law.task.size
        books = period_state(n, k) + bound_state(n) + sure_state(n)
        return books + self.external.state(n) + self.inner.state(n)

    def start(self, at: Rest) -> Remembered:
        """Return what is remembered at rest, of each field of the state."""
        n, k = self.law.robot.n, self.law.task.size
        bounds = (bound_state(n) + sure_state(n)).zeros()
        return period_start(n, k, at) | bounds | self.external.start(at) | self.inner.start(at)

    def step(
        self,
        y: Measurement,
        setpoint: Setpoint,
        elapsed: cs.SX,
        applied: cs.SX,
        state: cs.SX,
        p: ControlParameters[SimpleNamespace],
    ) -> PeriodResult:
        """Return command, next state and ledger entry, `elapsed` seconds after the last period that ran.

        `applied` (n,) is the torque that the motors were told then, after their limits.
        """
        arm, s = self.law.robot.arm, self.state.view(state)
        ok = finite(elapsed, applied, *y, *setpoint.pose, *setpoint[1:], below=LARGEST_READING)
        elapsed = s.lost_time + cs.if_else(finite(elapsed, below=LARGEST_READING), elapsed, 0)
        y, observed = self.external.estimate(y, elapsed, Known(arm, p.model, p.observer.bandwidth), s)
        y, seen = self.inner.see(y, applied, elapsed, s, p.model, p.inner)
        first = s.running < 1

        held = EndEffectorPose(s.governed_position, s.governed_rotation)
        before = self.law.stored(y, p.model, _chosen(s.latched, p.fallback, p.gains))
        storage = before.energy + self._potential(before, held, s.held_stiffness)
        variable = self._potential(before, held, s.held_stiffness - p.gains.stiffness)
        work = cs.if_else(first, 0, cs.dot(s.last_tau_a + y.tau_a, y.q - s.last_q) / 2)
        flows = PeriodFlows(
            elapsed=elapsed,
            port_energy=work,
            storage_change=cs.if_else(first, 0, storage - s.law_storage),
            claimed_loss=s.claimed_power * elapsed,
            claimed_cartesian_loss=s.claimed_cartesian_power * elapsed,
            variable_spring_work=cs.if_else(first, 0, variable - s.variable_potential),
        )
        settled = self.tank.settle(s.tank_energy, flows, p.tank) if self.tank else unchanged(s.tank_energy)

        bound = booked_bound(y, elapsed, first, s, p.errors)
        doubt = bound.total if self.tank is not None and self.tank.measures else cs.SX(0)

        is_sure = cs.logic_or(first, settled.level - bound.total >= p.tank.tank_floor)

        # Fall back in the period in which it shows beyond what the sensors explain, and keep T + S.
        falls = self.tank is not None and self.tank.falls_back
        short = settled.level + bound.lowered < p.tank.tank_trip + s.sure_measurement_bound
        overdrawn = cs.logic_and(short, s.latched < 1) if falls else cs.SX(0)
        latched = cs.fmax(s.latched, overdrawn)
        g = _chosen(latched, p.fallback, p.gains)
        now = self.law.stored(y, p.model, g)
        held = _pose(overdrawn, now.pose, held)
        held_stiffness = cs.if_else(overdrawn, p.fallback.stiffness, s.held_stiffness)
        restored = cs.if_else(overdrawn, now.energy, storage)  # the spring is slack at the pose just read
        rebased, lowest = cs.if_else(overdrawn, storage - restored, 0), settled.level
        settled = settled._replace(level=settled.level + rebased)

        granted = self._grant(now, held, held_stiffness, setpoint, latched, settled.level, doubt, elapsed, p)
        valve = (
            (1 - latched) * self.tank.valve(granted.entry.level - doubt, p.tank) if self.tank else cs.SX(1)
        )
        g.stiffness, g.damping = granted.stiffness, cs.if_else(latched, p.fallback.damping, setpoint.damping)
        torque = cs.SX.zeros(self.law.robot.n)
        if self.actions:
            torque += valve * self._actions(y, now, setpoint, granted, g, p)
        if self.tank:
            brake = self.tank.braking(granted.entry.level, cs.dot(now.dphi, now.dphi), elapsed, p.tank)
            torque -= brake * now.dphi
        reference, memory = Reference(granted.pose, setpoint.velocity), self.inner.state(self.law.robot.n)
        command = self.inner.command(self.law, y, reference, p.model, g, torque, memory.view(seen), p.inner)

        tank = added(settled, granted.entry)
        held_back = cs.logic_or(granted.pose_share < 1, granted.stiffness_share < 1)
        values = {
            "governed_position": granted.pose.position,
            "governed_rotation": granted.pose.rotation,
            "held_stiffness": granted.stiffness,
            "tank_energy": tank.level,
            "law_storage": restored + granted.cost,
            "variable_potential": self._potential(now, granted.pose, granted.stiffness - p.gains.stiffness),
            "claimed_power": command.energy.dissipated_power,
            "claimed_cartesian_power": command.energy.cartesian_damping,
            "last_q": y.q,
            "last_tau_a": y.tau_a,
            "last_command": command.tau_m,
            "running": 1,
            "latched": latched,
            "measured_port_energy": s.measured_port_energy + work,
            "reference_energy": s.reference_energy + granted.cost,
            "granted_energy": s.granted_energy + tank.granted,
            "drawn_energy": s.drawn_energy + tank.drawn,
            "refilled_energy": s.refilled_energy + tank.refilled,
            "spilled_energy": s.spilled_energy + tank.spilled,
            "rebased_energy": s.rebased_energy + rebased,
            "lowest_level": cs.fmin(s.lowest_level, cs.fmin(lowest, tank.level)),
            "governed_time": s.governed_time + cs.if_else(held_back, elapsed, 0),
            "faults": s.faults + cs.fmin(tank.fault, 1),
            "lost_time": 0,
            **bound.state,
            **sure(is_sure, y.q, s, bound.state),
        }
        own = Layout(self.state.fields[: len(values)])
        after = cs.vertcat(own.stack(values), observed, seen)
        faulty = self.state.stack(vars(s) | {"faults": s.faults + 1, "lost_time": elapsed})
        entry = LedgerEntry(
            tank=tank,
            rebased=rebased,
            port_energy=work,
            storage=restored + granted.cost,
            reference_share=granted.pose_share,
            stiffness_share=granted.stiffness_share,
            valve=valve,
            latched=latched,
            bound=bound.total,
            fault=1 - ok,
        )
        safe = command._replace(tau_m=cs.if_else(ok, command.tau_m, s.last_command))
        return PeriodResult(safe, cs.if_else(ok, after, faulty), entry, y)

    def _potential(self, at: Stored, reference: EndEffectorPose, stiffness: cs.SX) -> cs.SX:
        return self.law.task.potential(at.pose, reference, stiffness)

    def _grant(
        self,
        now: Stored,
        held: EndEffectorPose,
        held_stiffness: cs.SX,
        setpoint: Setpoint,
        latched: cs.SX,
        level: cs.SX,
        doubt: cs.SX,
        elapsed: cs.SX,
        p: ControlParameters[SimpleNamespace],
    ) -> _Granted:
        """Return the reference as far as the tank surely pays for it; a law that has fallen back holds its own."""
        one = cs.SX(1)
        if self.tank is None:
            stored = self._potential(now, setpoint.pose, setpoint.stiffness)
            cost = stored - self._potential(now, held, held_stiffness)
            return _Granted(setpoint.pose, setpoint.stiffness, one, one, cost, unchanged(level))
        task, tank = self.law.task, self.tank
        share = tank.stiffness_share(level - doubt, p.tank)
        wanted = cs.if_else(
            share < 1,
            p.gains.stiffness + share * (setpoint.stiffness - p.gains.stiffness),
            setpoint.stiffness,
        )
        wanted = cs.if_else(latched, held_stiffness, wanted)
        signed = p.tank.tank_signed
        budget = tank.budget(level - doubt, elapsed, p.tank)
        stiffness = govern_stiffness(task, now.pose, held, held_stiffness, wanted, budget, signed)
        first = tank.pay(level, stiffness.cost, p.tank)
        budget = cs.fmax(budget - first.granted, 0)
        goal = _pose(latched, held, setpoint.pose)
        pose = govern_pose(task, now.pose, held, goal, stiffness.value, budget, signed)
        second = tank.pay(first.level, pose.cost, p.tank)
        return _Granted(
            pose=pose.value,
            stiffness=stiffness.value,
            pose_share=pose.share,
            stiffness_share=stiffness.share,
            cost=stiffness.cost + pose.cost,
            entry=added(first, second),
        )

    def _actions(
        self,
        y: Measurement,
        now: Stored,
        setpoint: Setpoint,
        granted: _Granted,
        g: SimpleNamespace,
        p: ControlParameters[SimpleNamespace],
    ) -> cs.SX:
        """Return the torque of everything that only the tank's valve lets through (n,) N m."""
        arm, rows = self.law.robot.arm, slice(0, self.law.task.size)
        S, held, a = self.law.task.basis(granted.pose), list(self.law.task.held), p.actions
        M, J = arm.mass_matrix(y.q, p.model), S.T @ arm.jacobian(y.q, p.model)[rows, :]
        velocity, acceleration = S.T @ setpoint.velocity[rows], S.T @ setpoint.acceleration[rows]
        follow = granted.pose_share * tracking_wrench(
            M, J, g.damping[held, held], velocity, acceleration, g.regularisation, a
        )
        at_end = arm.jacobian(now.phi, p.model)
        J_held = S.T @ at_end[rows, :]
        moving = M + cs.diag(self.law.motors(p.model, g))
        error = S.T @ self.law.task.error(now.pose, granted.pose)
        posture = posture_spring(moving, J_held, error, now.phi, now.dphi, g.regularisation, a)
        return at_end.T @ setpoint.wrench + J_held.T @ follow + posture


def _chosen(flag: cs.SX, then: SimpleNamespace, other: SimpleNamespace) -> SimpleNamespace:
    return SimpleNamespace(**{k: cs.if_else(flag, v, getattr(other, k)) for k, v in vars(then).items()})


def _pose(flag: cs.SX, then: EndEffectorPose, other: EndEffectorPose) -> EndEffectorPose:
    return EndEffectorPose(
        cs.if_else(flag, then.position, other.position), cs.if_else(flag, then.rotation, other.rotation)
    )
