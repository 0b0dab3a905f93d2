"""How the law's torque becomes a held command: as in continuous time, or matched to the end of the hold."""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol, final

import casadi as cs

from passiflex.control.law import AbstractLaw
from passiflex.control.signals import Command, Measurement, Reference
from passiflex.layout import Field, Layout
from passiflex.robots.flexible import RobotNumbers
from passiflex.sampled.rest import Remembered, Rest


class Seen(NamedTuple):
    """The measurement as the inner loop makes it better, and what it remembers."""

    measured: Measurement
    state: cs.SX


class InnerNumbers(Protocol):
    """The numbers of an inner loop in symbols, as `AbstractInnerLoop.layout` says."""

    period: cs.SX
    velocity_gain: cs.SX
    acceleration_gain: cs.SX
    task_periods: cs.SX


class AbstractInnerLoop(abc.ABC):
    """Turns measurement, reference and gains into the command of one period."""

    layout = Layout(
        (
            Field("period", (), "s", "nominal control period"),
            Field(
                "velocity_gain", (), "1", "g: share of the new difference in the link velocity, per period"
            ),
            Field("acceleration_gain", (), "1", "b: share of the new value in the acceleration, per period"),
            Field("task_periods", (), "1", "from one run of the outer loop to the next"),
        ),
        InnerNumbers,
    )

    @abc.abstractmethod
    def state(self, n: int) -> Layout:
        """Return what is remembered from one period to the next."""

    kind: ClassVar[str] = "plain"
    """Its name in a scenario."""
    predicts: ClassVar[bool] = False
    """Whether it is built for a delay."""

    def takes(self, law: AbstractLaw) -> bool:
        """Return whether it works with a law."""
        return True

    def expecting(self, late: int) -> AbstractInnerLoop:
        """Return the inner loop for commands that are so many periods late; the same where it does not predict."""
        return self

    def start(self, at: Rest) -> Remembered:
        """Return what is remembered at rest, of each field of the state."""
        return self.state(at.q.size).zeros()

    @abc.abstractmethod
    def see(
        self,
        y: Measurement,
        applied: cs.SX,
        elapsed: cs.SX,
        s: Any,
        m: RobotNumbers,
        i: InnerNumbers,
    ) -> Seen:
        """Return the measurement to work with; `applied` is the torque that the motors were told last."""

    @abc.abstractmethod
    def command(
        self,
        law: AbstractLaw,
        y: Measurement,
        reference: Reference,
        m: RobotNumbers,
        g: Any,
        added: cs.SX,
        seen: Any,
        i: InnerNumbers,
    ) -> Command:
        """Return the command, with `added` as further torque on the shaped motors."""


@final
@dataclass(frozen=True)
class PlainInnerLoop(AbstractInnerLoop):
    """The continuous law, evaluated at the sample and held."""

    def state(self, n: int) -> Layout:
        """Return nothing."""
        return Layout(())

    def see(
        self,
        y: Measurement,
        applied: cs.SX,
        elapsed: cs.SX,
        s: Any,
        m: RobotNumbers,
        i: InnerNumbers,
    ) -> Seen:
        """Return y as it is."""
        return Seen(y, cs.SX(0, 1))

    def command(
        self,
        law: AbstractLaw,
        y: Measurement,
        reference: Reference,
        m: RobotNumbers,
        g: Any,
        added: cs.SX,
        seen: Any,
        i: InnerNumbers,
    ) -> Command:
        """Return the law's own command."""
        return law.command(y, reference, m, g, added)
