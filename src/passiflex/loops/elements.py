"""What touches a robot: elements with one port each, at the motors or at the end effector.

An element gives nothing of its own: the power that it gives through its port and what it loses add up to zero, and what
it loses is ≥ 0. That is the first test of a new one. None of them stores energy yet.
"""

from __future__ import annotations

import abc
from dataclasses import dataclass
from types import SimpleNamespace
from typing import ClassVar, NamedTuple, final

import casadi as cs

from passiflex.layout import Field, Layout
from passiflex.robots.flexible import RobotState
from passiflex.sampled.motors import friction, friction_layout

DRAG_WIDTH = 1e-3
"""Speed over which a drag's dry part changes its sign [m/s]."""


class Touch(NamedTuple):
    """How a robot moves where it may be touched.

    Attributes
    ----------
    x: Its state.
    velocity, spin: Of the end effector (3,), in the axes of the last joint, which are those of `Effect`.
    """

    x: RobotState
    velocity: cs.SX
    spin: cs.SX


class Effect(NamedTuple):
    """What an element does to the robot at one instant.

    Attributes
    ----------
    motor: Torque on the motors (n,) [N m].
    force, moment: On the end effector (3,) [N, N m].
    lost: [W], ≥ 0.
    """

    motor: cs.SX
    force: cs.SX
    moment: cs.SX
    lost: cs.SX


def nothing(n: int) -> Effect:
    """Return the effect of no element, of which an element's own differs by what it does."""
    return Effect(cs.SX.zeros(n), cs.SX.zeros(3), cs.SX.zeros(3), cs.SX(0))


class AbstractElement(abc.ABC):
    """Touches the robot through one port.

    Attributes
    ----------
    booked: Under which name a run has what it lost; empty if that is part of what the environment gave.
    meaning: What that is, in words.
    acts: False leaves its arithmetic out, where all its numbers are 0; they stay where they are.
    """

    acts = True
    booked: ClassVar[str] = ""
    meaning: ClassVar[str] = ""

    @abc.abstractmethod
    def parameters(self, n: int) -> Layout:
        """Return the numbers that stay what they are during a run."""

    @abc.abstractmethod
    def inputs(self) -> Layout:
        """Return the numbers that a schedule may change during a run."""

    @abc.abstractmethod
    def act(self, at: Touch, s: SimpleNamespace, m: SimpleNamespace) -> Effect:
        """Return the effect, with the inputs s and the parameters m."""


@final
@dataclass(frozen=True)
class MotorFriction(AbstractElement):
    """Coulomb and viscous friction of the motors, against θ̇."""

    acts: bool = True
    booked: ClassVar[str] = "friction"
    meaning: ClassVar[str] = "lost in the motors' friction"

    def parameters(self, n: int) -> Layout:
        """Return the friction of each motor."""
        return friction_layout(n)

    def inputs(self) -> Layout:
        """Return nothing."""
        return Layout(())

    def act(self, at: Touch, s: SimpleNamespace, m: SimpleNamespace) -> Effect:
        """Return the friction torque."""
        rubbing = friction(at.x.dtheta, m.coulomb_friction, m.viscous_friction, m.friction_width)
        return nothing(rubbing.numel())._replace(motor=-rubbing, lost=cs.dot(rubbing, at.x.dtheta))


@final
@dataclass(frozen=True)
class Drag(AbstractElement):
    """A drag against the linear motion of the end effector: viscous, and dry as μ v / |v|."""

    acts: bool = True

    def parameters(self, n: int) -> Layout:
        """Return nothing."""
        return Layout(())

    def inputs(self) -> Layout:
        """Return how much it drags."""
        return Layout(
            (
                Field("viscous_drag", (), "N s/m", "of the end effector's linear motion", kept=False),
                Field("dry_drag", (), "N", "of the end effector's linear motion", kept=False),
            )
        )

    def act(self, at: Touch, s: SimpleNamespace, m: SimpleNamespace) -> Effect:
        """Return the force, which has the same form in any axes."""
        v = at.velocity
        drag = (s.viscous_drag + s.dry_drag / cs.sqrt(cs.dot(v, v) + DRAG_WIDTH**2)) * v
        return nothing(at.x.q.numel())._replace(force=-drag, lost=cs.dot(drag, v))
