"""What a simulation needs, in numbers: structure, parameters, start, events."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.control.law import AbstractLaw
from passiflex.control.motion import Motion, Pose
from passiflex.control.tool_axes import damping_in_world, stiffness_in_world
from passiflex.errors import ValueRangeError
from passiflex.loops.closed_loop import ClosedLoop
from passiflex.loops.plant import Elements
from passiflex.loops.sampled_loop import SampledLoop
from passiflex.parts import Parts
from passiflex.sampled.controller import SampledController
from passiflex.sampled.readings import ON_TIME, Lateness
from passiflex.sampled.sensors import AbstractSensorEffect

Array = NDArray[np.float64]
NOTHING: Mapping[str, ArrayLike] = MappingProxyType({})
FROM_THE_START = -1.0
"""Instant [s] of the change to gains that the law has in tool axes: they are in force from the first period on."""


class Event(NamedTuple):
    """From `time` on, another motion of the reference (None: the same goes on), this wrench F_e (6,), and these inputs.

    `inputs` are those of what touches the robot, by name; what is not named is 0.
    """

    time: float
    motion: Motion | None
    F_e: Array
    inputs: Mapping[str, ArrayLike] = NOTHING

    @property
    def environment(self) -> dict[str, Any]:
        """Return the numbers of `Plant.environment` that are not 0, by name."""
        return {"F_e": self.F_e, **self.inputs}


class Noise(NamedTuple):
    """White noise on the measured τ_a: variance [(N m)²], held for `hold` seconds each; and on q and θ, per reading."""

    variance: float
    hold: float
    link_deviation: float = 0.0
    motor_deviation: float = 0.0

    @property
    def moves(self) -> bool:
        """Return whether there is noise on positions."""
        return self.link_deviation > 0 or self.motor_deviation > 0


class TankStart(NamedTuple):
    """The tank at the start [J], its floor and cap, and whether a jump is charged with its sign."""

    initial: float
    floor: float
    cap: float
    signed: bool


class GainChange(NamedTuple):
    """From `start` to `end` [s], K_x and D_x go over to these values (k, k): with minimum jerk, or linearly.

    Where the two instants are one, they are there at once.
    """

    start: float
    end: float
    stiffness: Array
    damping: Array
    linear: bool = False
    in_tool: tuple[bool, bool] = (False, False)
    """Whether stiffness and damping are in the axes of the reference throughout, and turn with it."""

    def in_world(self, rotation: Array, *, turned: bool) -> GainChange:
        """Return the same in world axes for a reference of this orientation; `turned` as `AbstractTask.turned`."""
        K, D = self.stiffness, self.damping
        return self._replace(
            stiffness=stiffness_in_world(K, rotation) if self.in_tool[0] else K,
            damping=damping_in_world(D, rotation, turned=turned) if self.in_tool[1] else D,
            in_tool=(False, False),
        )


class Lasting(NamedTuple):
    """From `start` on, before `end` [s], these numbers hold in the rows of a sampled loop."""

    start: float
    end: float
    numbers: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """A closed loop in continuous time with all its numbers.

    Attributes
    ----------
    law: Structure of the law, with its robot.
    elements: What touches the robot.
    numbers: Flat parameters of the loop, in the order of `parts`.
    q, theta: Start, at rest, (n,) rad.
    home: Pose that the reference holds at the start.
    events: By time; the first at time 0.
    duration, output_interval: [s].
    text: The resolved scenario; it is stored beside the result.
    """

    name: str
    law: AbstractLaw
    elements: Elements
    numbers: Array
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
    text: str

    @cached_property
    def parts(self) -> Parts:
        """Return whose the numbers are."""
        return ClosedLoop(self.law, self.elements).parameters

    @property
    def plant(self) -> Array:
        """Return the numbers of the robot and of what touches it, flat."""
        return self.numbers[self.parts.slices["plant"]]

    @property
    def model(self) -> Array:
        """Return the numbers of the law's model, flat."""
        return self.numbers[self.parts.slices["model"]]

    @property
    def gains(self) -> Array:
        """Return the numbers of the law, flat."""
        return self.numbers[self.parts.slices["gains"]]

    def with_numbers(self, values: Mapping[str, ArrayLike], only: str | None = None) -> Self:
        """Return the problem with the named numbers, in every part that has them or in the `only` one."""
        return dataclasses.replace(self, numbers=self.parts.replaced(self.numbers, values, only))


@dataclass(frozen=True, eq=False)
class SampledProblem(Problem):
    """A closed loop in which the law runs once per period.

    Attributes
    ----------
    controller: The law with tank, governor and estimators.
    period, delay, jitter: [s].
    missed: Share of periods in which the law does not run.
    lost: Bursts in which it does not either: when the first period is due [s], and how many there are.
    allow_unstable: Whether to run a loop that is unstable by the limit map.
    held: Motor torque at the start (n,).
    gain_changes: Of K_x and D_x, in the order of time.
    feedforward: Wrenches (6,) that the end effector is to exert.
    effects: On the readings, beside those of the sensors' own.
    lateness: Of the sensors.
    """

    controller: SampledController
    period: float
    delay: float
    jitter: float
    missed: float
    allow_unstable: bool
    held: Array
    gain_changes: tuple[GainChange, ...]
    feedforward: tuple[Lasting, ...]
    effects: tuple[AbstractSensorEffect, ...] = ()
    lost: tuple[tuple[float, int], ...] = ()
    lateness: Lateness = ON_TIME

    @cached_property
    def loop(self) -> SampledLoop:
        """Return the loop that runs."""
        return SampledLoop(self.controller, self.elements, self.effects)

    @cached_property
    def task_periods(self) -> int:
        """Return how many periods there are from one run of the outer loop to the next."""
        return round(float(self.parts.unpack("inner", self.numbers)["task_periods"]))

    @cached_property
    def told_gains(self) -> tuple[GainChange, ...]:
        """Return the gains that the law goes over to, each once, as they would be at the start, in world axes."""
        turned = self.law.task.turned
        told = (c.in_world(self.home.rotation, turned=turned) for c in self.gain_changes)
        different = {(c.stiffness.tobytes(), c.damping.tobytes()): c for c in told}
        return tuple(different.values())

    @cached_property
    def parts(self) -> Parts:
        """Return whose the numbers are."""
        return self.loop.parameters


def require_sampled(problem: Problem) -> SampledProblem:
    """Return a problem that has a control rate.

    Raises
    ------
    ValueRangeError
        If it has none.
    """
    if not isinstance(problem, SampledProblem):
        raise ValueRangeError(
            "the scenario has no control rate", got=problem.name, needs="`control: {rate: …}`"
        )
    return problem
