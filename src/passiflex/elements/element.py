"""What touches a robot: elements with one port each, at the motors or at the end effector.

An element gives nothing of its own: the power that it gives through its port, what it loses, and the rate of what it
stores add up to zero, and what it loses is ≥ 0. That is the first test of a new one.
"""

from __future__ import annotations

import abc
from collections.abc import Hashable, Mapping
from typing import Any, ClassVar, Literal, NamedTuple

import casadi as cs
from numpy.typing import ArrayLike

from passiflex.control.motion import Pose
from passiflex.layout import Layout
from passiflex.robots.flexible import RobotState


class Touch(NamedTuple):
    """How a robot moves where it may be touched.

    Attributes
    ----------
    x: Its state.
    velocity, spin: Of the end effector (3,), in the axes of the last joint, which are those of `Effect`.
    position: Of the end effector, in world axes (3,) [m].
    rotation: From those axes of velocity and force to world axes (3, 3).
    own: The element's own state, by name.
    """

    x: RobotState
    velocity: cs.SX
    spin: cs.SX
    position: cs.SX
    rotation: cs.SX
    own: Any


class Effect(NamedTuple):
    """What an element does to the robot at one instant.

    Attributes
    ----------
    motor: Torque on the motors (n,) [N m].
    force, moment: On the end effector (3,) [N, N m].
    lost: [W], ≥ 0.
    stored: [J].
    rate: Of the element's own state, flat.
    """

    motor: cs.SX
    force: cs.SX
    moment: cs.SX
    lost: cs.SX
    stored: cs.SX = cs.SX(0)
    rate: cs.SX = cs.SX(0, 1)


def nothing(n: int) -> Effect:
    """Return the effect of no element, of which an element's own differs by what it does."""
    return Effect(cs.SX.zeros(n), cs.SX.zeros(3), cs.SX.zeros(3), cs.SX(0))


class Books(NamedTuple):
    """What a run has of an element: `NAME_energy` lost, `NAME_given_energy` at the end effector, `NAME_storage`.

    What was lost goes by its `name`, as an energy and as a power; so does what was `given`.
    """

    name: str
    at_tip: bool
    stores: bool

    @property
    def given(self) -> str:
        """Return the name of what it gave to the robot."""
        return f"{self.name}_given"

    @property
    def storage(self) -> str:
        """Return the signal of what it stores."""
        return f"{self.name}_storage"

    @property
    def signals(self) -> tuple[str, ...]:
        """Return the signals of its balance."""
        flows = (self.name, self.given) if self.at_tip else (self.name,)
        both = (f"{flow}_{kind}" for flow in flows for kind in ("energy", "power"))
        return (*both, self.storage) if self.stores else tuple(both)


class AbstractElement(abc.ABC):
    """Touches the robot through one port.

    Attributes
    ----------
    name: Under which a run has what it lost, `NAME_energy`, and what it stores, `NAME_storage`.
    meaning: What it lost, in words.
    port: Where it touches the robot.
    stores: Whether it can store energy.
    acts: False leaves its arithmetic out, where all its numbers are 0; they stay where they are.
    always: Whether a run has books of it even where it does not act.
    unknown: What the books of a law miss because of it; empty at the end effector, where it is as a push from outside.
    """

    meaning: ClassVar[str] = "lost in an element of one's own"
    port: ClassVar[Literal["motors", "end effector"]] = "end effector"
    stores: ClassVar[bool] = False
    always: ClassVar[bool] = False
    unknown: ClassVar[str] = ""
    acts: bool = True

    @property
    def name(self) -> str:
        """Return its name, from that of its class unless it has one of its own."""
        return type(self).__name__.lower()

    def parameters(self, n: int) -> Layout:
        """Return the numbers that stay what they are during a run; none for most."""
        return Layout(())

    def numbers(self, n: int) -> Mapping[str, ArrayLike]:
        """Return the values of `parameters`."""
        return {}

    def inputs(self) -> Layout:
        """Return the numbers that a schedule may change during a run; 0 where it says nothing."""
        return Layout(())

    def state(self, n: int) -> Layout:
        """Return what it remembers."""
        return Layout(())

    def start(self, at: Pose, n: int) -> Mapping[str, ArrayLike]:
        """Return what it remembers at rest, with the end effector at a pose: zeros for most."""
        return self.state(n).zeros()

    @property
    def structure(self) -> Hashable:
        """Return what its code depends on: elements that agree in it share compiled code."""
        return self

    @property
    def at_tip(self) -> bool:
        """Return whether it touches the end effector."""
        return self.port == "end effector"

    @property
    def books(self) -> Books:
        """Return what a run has of it."""
        return Books(self.name, self.at_tip, self.stores)

    @abc.abstractmethod
    def act(self, at: Touch, s: Any, m: Any) -> Effect:
        """Return the effect, with the inputs s and the parameters m."""
