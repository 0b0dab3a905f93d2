"""What crosses the boundary of one control period."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import casadi as cs

from passiflex.control.law import Gains
from passiflex.control.signals import Command, Measurement
from passiflex.robots.arm import EndEffectorPose
from passiflex.robots.flexible import RobotNumbers
from passiflex.sampled.actions import ActionNumbers
from passiflex.sampled.declared_errors import ErrorNumbers
from passiflex.sampled.inner_loop import InnerNumbers
from passiflex.sampled.tank import TankEntry, TankNumbers


class Setpoint(NamedTuple):
    """What is asked of the controller in one period.

    Attributes
    ----------
    pose, velocity, acceleration: x_d with its derivatives, (6,) each, world axes.
    stiffness, damping: K_x and D_x of this period, (k, k).
    wrench: Feed-forward wrench that the end effector is to exert, (6,) N and N m.
    """

    pose: EndEffectorPose
    velocity: cs.SX
    acceleration: cs.SX
    stiffness: cs.SX
    damping: cs.SX
    wrench: cs.SX


class LedgerEntry(NamedTuple):
    """The energy of one period [J].

    T + S + Σw + Σspilled is constant for the port tank, and for any tank
    T = T₀ − Σgranted − Σdrawn + Σrefilled − Σspilled + Σrebased.

    Attributes
    ----------
    tank: What settled the period and what the reference was granted, as one entry.
    rebased: What S gave to T in the period in which the law fell back, so that T + S did not jump.
    port_energy: w of the period.
    storage: S after the reference has moved.
    reference_share, stiffness_share: γ of the governor, 1 if nothing was held back.
    valve: β in this period.
    latched: 1 if the law has fallen back.
    bound: E, most that Σw may be short of the energy given to the links so far.
    fault: 1 if the measurement was not finite: state and command are then those of the period before.
    """

    tank: TankEntry
    rebased: cs.SX
    port_energy: cs.SX
    storage: cs.SX
    reference_share: cs.SX
    stiffness_share: cs.SX
    valve: cs.SX
    latched: cs.SX
    bound: cs.SX
    fault: cs.SX


class PeriodResult(NamedTuple):
    """Command, next state (flat) and ledger entry of one period, and the measurement as the law believed it.

    Attributes
    ----------
    compensation: What of the command is there against friction (n,) N m.
    """

    command: Command
    state: cs.SX
    entry: LedgerEntry
    believed: Measurement
    compensation: cs.SX


class ObserverNumbers(Protocol):
    """The numbers of the external torque's estimator in symbols."""

    bandwidth: cs.SX


class ControlParameters(NamedTuple):
    """Everything that is a run-time number of the controller, in symbols.

    Attributes
    ----------
    model: The law's model, `robot.layout`.
    gains: The law's gains, `law.layout`; stiffness and damping of the period come with the setpoint.
    fallback: The same layout, in force once the law has fallen back.
    tank: `AbstractTank.layout`.
    actions: `action_layout`.
    observer: `bandwidth` of the external torque's estimator.
    inner: `AbstractInnerLoop.layout`.
    errors: `error_layout`, what the sensors may get wrong.
    """

    model: RobotNumbers
    gains: Gains
    fallback: Gains
    tank: TankNumbers
    actions: ActionNumbers
    observer: ObserverNumbers
    inner: InnerNumbers
    errors: ErrorNumbers
