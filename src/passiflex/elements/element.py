"""What touches a robot: elements with one port each, at the motors, the links, or the end effector.

The power that an element gives through its port, what it loses, and the rate of what it stores add up to what it is
supplied with from beyond, as by a wall that is moved: nothing for most. What it loses is ≥ 0. That is the first test
of a new one.
"""

from __future__ import annotations

import abc
from collections.abc import Hashable, Mapping
from typing import Any, ClassVar, Literal, NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.control.motion import Pose
from passiflex.layout import Layout, Signal
from passiflex.robots.flexible import RobotState

Port = Literal["motors", "links", "end effector"]
"""Where an element may touch a robot."""


class Touch(NamedTuple):
    """How a robot moves where it may be touched.

    Attributes
    ----------
    x: Its state.
    velocity, spin: Of the end effector (3,), in the axes of the last joint, which are those of `Effect`.
    position: Of the end effector, in world axes (3,) [m].
    rotation: From those axes of velocity and force to world axes (3, 3).
    axes: Of the end effector, as columns in world axes (3, 3).
    own: The element's own state, by name.
    """

    x: RobotState
    velocity: cs.SX
    spin: cs.SX
    position: cs.SX
    rotation: cs.SX
    axes: cs.SX
    own: Any


class Effect(NamedTuple):
    """What an element does to the robot at one instant.

    Attributes
    ----------
    motor: Torque on the motors (n,) [N m].
    link: Torque on the links, beside what acts on the end effector (n,) [N m].
    force, moment: On the end effector (3,) [N, N m].
    lost: [W], ≥ 0.
    stored: [J].
    supplied: From beyond, through another port of the element [W].
    rate: Of the element's own state, flat.
    """

    motor: cs.SX
    link: cs.SX
    force: cs.SX
    moment: cs.SX
    lost: cs.SX
    stored: cs.SX = cs.SX(0)
    supplied: cs.SX = cs.SX(0)
    rate: cs.SX = cs.SX(0, 1)


def nothing(n: int) -> Effect:
    """Return the effect of no element, of which an element's own differs by what it does."""
    return Effect(cs.SX.zeros(n), cs.SX.zeros(n), cs.SX.zeros(3), cs.SX.zeros(3), cs.SX(0))


class Mobility(NamedTuple):
    """How easily a robot is moved where an element may touch it, at its start.

    Attributes
    ----------
    tip: J M⁻¹ Jᵀ of the end effector, in world axes (6, 6) [1/kg, 1/(kg m), 1/(kg m²)].
    axes: Of the end effector, as columns in world axes (3, 3).
    links, motors: Of each link and motor (n,) [1/(kg m²)].
    """

    tip: NDArray[np.float64]
    axes: NDArray[np.float64]
    links: NDArray[np.float64]
    motors: NDArray[np.float64]

    def at(self, point: ArrayLike) -> float:
        """Return that of a point of the hand (3,) m, in its axes, by the force that moves it most easily [1/kg]."""
        x, y, z = self.axes @ np.asarray(point, dtype=float)
        turned = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])  # velocity at the point by a spin: ω × r
        moved = np.hstack([np.eye(3), turned])
        return float(np.linalg.norm(moved @ self.tip @ moved.T, 2))


class Books(NamedTuple):
    """What a run has of an element: `NAME_energy` lost, `NAME_storage`, and if it is outside `NAME_given_energy`.

    What was lost goes by its `name`, as an energy and as a power; so do what was `given`, and what was `supplied`.
    """

    name: str
    outside: bool
    stores: bool
    supplies: bool = False

    @property
    def given(self) -> str:
        """Return the name of what it gave to the robot."""
        return f"{self.name}_given"

    @property
    def supplied(self) -> str:
        """Return the name of what it was supplied with."""
        return f"{self.name}_supplied"

    @property
    def storage(self) -> str:
        """Return the signal of what it stores."""
        return f"{self.name}_storage"

    @property
    def signals(self) -> tuple[str, ...]:
        """Return the signals of its balance."""
        flows = (self.name, *[self.given] * self.outside, *[self.supplied] * self.supplies)
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
    supplies: Whether it can be supplied with energy from beyond.
    acts: False leaves its arithmetic out, where all its numbers are 0; they stay where they are.
    always: Whether a run has books of it even where it does not act.
    unknown: What the books of a law miss because of it; empty outside the robot, where it is as a push.
    """

    meaning: ClassVar[str] = "lost in an element of one's own"
    port: ClassVar[Port] = "end effector"
    stores: ClassVar[bool] = False
    supplies: ClassVar[bool] = False
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
    def outside(self) -> bool:
        """Return whether it touches the links, from outside as the law sees it, and not the motors."""
        return self.port != "motors"

    @property
    def books(self) -> Books:
        """Return what a run has of it."""
        return Books(self.name, self.outside, self.stores, self.supplies)

    def rate(self, free: Mobility) -> float:
        """Return how fast robot and element swing on each other at most [1/s], so that steps resolve it."""
        return 0.0

    def require_apart(self, at: Pose) -> None:  # noqa: B027 - most have nothing to be within
        """Raise ValueRangeError if a robot that starts with its end effector at a pose is within it."""

    def seen(self, at: Touch, s: Any, m: Any) -> tuple[Signal, ...]:
        """Return what else a run has of it: nothing for most."""
        return ()

    @abc.abstractmethod
    def act(self, at: Touch, s: Any, m: Any) -> Effect:
        """Return the effect, with the inputs s and the parameters m."""
