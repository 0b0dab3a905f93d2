"""What a simulation needs, in numbers: structure, parameters, start, events."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.control.law import AbstractLaw
from passiflex.control.motion import Motion, Pose
from passiflex.loops.plant import Elements
from passiflex.loops.sampled_loop import SampledLoop
from passiflex.sampled.controller import SampledController

Array = NDArray[np.float64]


class Event(NamedTuple):
    """From `time` on, another motion of the reference (None: the same goes on) and this wrench F_e (6,)."""

    time: float
    motion: Motion | None
    F_e: Array


class Noise(NamedTuple):
    """White noise on the measured τ_a: variance [(N m)²], held for `hold` seconds each."""

    variance: float
    hold: float


class TankStart(NamedTuple):
    """The tank at the start [J], its floor and cap, and whether a jump is charged with its sign."""

    initial: float
    floor: float
    cap: float
    signed: bool


class GainChange(NamedTuple):
    """From `start` to `end` [s], K_x and D_x go over to these values (k, k) with minimum jerk."""

    start: float
    end: float
    stiffness: Array
    damping: Array


class Lasting(NamedTuple):
    """From `start` on, before `end` [s], these numbers hold in the rows of a sampled loop."""

    start: float
    end: float
    numbers: Array


@dataclass(frozen=True, eq=False)
class Sampling:
    """How the law runs on a robot.

    Attributes
    ----------
    controller: The law with tank, governor and estimators.
    elements: What touches the robot.
    period, delay, jitter: [s].
    missed: Share of periods in which the law does not run.
    allow_unstable: Whether to run a loop that is unstable by the limit map.
    numbers: Flat vector of `SampledLoop.parameters`.
    plant: Flat vector of `Plant.parameters`, the first part of it.
    held: Motor torque at the start (n,).
    gains: Changes of K_x and D_x, in the order of time.
    feedforward: Wrenches (6,) that the end effector is to exert.
    drags: Viscous and dry drag (2,).
    """

    controller: SampledController
    elements: Elements
    period: float
    delay: float
    jitter: float
    missed: float
    allow_unstable: bool
    numbers: Array
    plant: Array
    held: Array
    gains: tuple[GainChange, ...]
    feedforward: tuple[Lasting, ...]
    drags: tuple[Lasting, ...]

    @cached_property
    def loop(self) -> SampledLoop:
        """Return the loop that runs."""
        return SampledLoop(self.controller, self.elements)


@dataclass(frozen=True, eq=False)
class Problem:
    """A closed loop with all its numbers.

    Attributes
    ----------
    law: Structure of the law, with its robot.
    plant, model, gains, tank_gains: Flat parameter vectors, in the order of `ClosedLoop.parameters`.
    q, theta: Start, at rest, (n,) rad.
    home: Pose that the reference holds at the start.
    events: By time; the first at time 0.
    duration, output_interval: [s].
    configuration: The resolved scenario as text; it is stored beside the result.
    sampling: How the law runs if it runs once per period; None in continuous time.
    """

    name: str
    law: AbstractLaw
    plant: Array
    model: Array
    gains: Array
    tank_gains: Array
    q: Array
    theta: Array
    home: Pose
    tank: TankStart
    events: tuple[Event, ...]
    noise: Noise | None
    duration: float
    output_interval: float
    tolerance: float
    seed: int
    configuration: str
    sampling: Sampling | None = None

    @property
    def parameters(self) -> Array:
        """Return the flat parameter vector of the compiled closed loop."""
        return np.concatenate([self.plant, self.model, self.gains, self.tank_gains])
