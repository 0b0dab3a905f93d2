"""A robot that is a scenario: its plant, what touches it, its sensors, its noise and delay, told torques by anybody."""

from __future__ import annotations

import math
from collections import deque

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.loops.compiled import compiled_sampled_loop
from passiflex.native import NativeFunction, compile_functions
from passiflex.native.fixed_step import step_function
from passiflex.onboard.sensed import Sensed
from passiflex.problems.problem import SampledProblem, require_sampled
from passiflex.problems.resolution import resolve
from passiflex.sampled.said import SaysLess
from passiflex.sampled.sayable import SAYABLE
from passiflex.sampled.sensors import Noise, Sensors
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.sensor_settings import SensorSettings
from passiflex.simulation.schedule import PeriodRows
from passiflex.simulation.simulate_sampled import longest_step, start

Array = NDArray[np.float64]

CHUNK = 64
"""Periods of its world that are made ready at a time."""
TOGETHER = 1e-9
"""Two instants closer than this are one [s]."""


class Twin:
    """Moves the plant of a scenario by a period for each torque, and says what its sensors say.

    It is the plant of a simulation, told from outside; a lost or late period is that of whoever tells it.

    Parameters
    ----------
    scenario: What it is, what is around it, what its sensors do (`sensors.says` and the rest).
    """

    def __init__(self, scenario: Scenario):
        self.problem: SampledProblem = require_sampled(resolve(scenario))
        compiled = compiled_sampled_loop(self.problem.loop)
        self.period = self.problem.period
        self._says = (scenario.sensors or SensorSettings()).says
        sensors = Sensors(
            self.problem.law.robot.n,
            tuple(e for e in self.problem.effects if not isinstance(e, SaysLess)),
            self.problem.controller.readings,
        )
        functions = [step_function(self.problem.loop.plant.rhs), _read(self.problem, sensors)]
        library = compile_functions(functions)
        self._step, self._read = (NativeFunction(f, library) for f in functions)
        begun = start(self.problem, compiled)
        self._y, self._sensors = np.concatenate([begun.x, begun.quads]), np.zeros(sensors.state.size)
        self._longest = longest_step(self.problem, compiled.plant)
        self._rows = PeriodRows(self.problem, self.problem.loop.period, compiled.row)
        self._count, self._ahead = 0, self._rows.take(0, CHUNK)[0]
        self._held, self._queue = self.problem.held.copy(), deque[tuple[float, Array]]()

    @property
    def _row(self) -> Array:
        return self._ahead[self._count % CHUNK]

    @property
    def time(self) -> float:
        """Return how far it is [s]."""
        return self._count * self.period

    @property
    def truth(self) -> dict[str, Array]:
        """Return the state of its plant, by name."""
        return self.problem.loop.plant.state.unpack(self._y[: self.problem.loop.plant.state.size])

    @property
    def energies(self) -> dict[str, Array]:
        """Return what passed its ports since the start [J], by name."""
        plant = self.problem.loop.plant
        return plant.energies.unpack(self._y[plant.state.size :])

    def read(self) -> Sensed:
        """Return what its sensors say now; once per period, as their filters go along."""
        x = self._y[: self.problem.loop.plant.state.size]
        said, self._sensors = self._read(x, self._row, self._sensors, self.problem.numbers)
        parts = dict(zip(SAYABLE, np.split(said, len(SAYABLE)), strict=True))
        return Sensed(**{name: parts[name] for name in self._says})

    def write(self, torque: Array) -> None:
        """Tell it a torque, which arrives after the delay of its scenario, and go on by a period."""
        self._queue.append((self.time + self.problem.delay, np.array(torque)))
        felt = self.problem.loop.plant.environment.size
        t, end = self.time, self.time + self.period
        while t < end - TOGETHER:
            while self._queue and self._queue[0][0] <= t + TOGETHER:
                self._held = self._queue.popleft()[1]
            until = min(end, self._queue[0][0]) if self._queue else end
            count = max(1, math.ceil((until - t) / self._longest))
            inputs = np.concatenate([self._held, self._row[:felt]])
            for _ in range(count):
                self._y = np.asarray(self._step(self._y, inputs, self.problem.plant, (until - t) / count))
            t = until
        self._count += 1
        if self._count % CHUNK == 0:
            self._ahead = self._rows.take(self._count, CHUNK)[0]


def _read(problem: SampledProblem, sensors: Sensors) -> cs.Function:
    """Return (x, row, state of the sensors, p) → (what they say of the joints, their state)."""
    loop = problem.loop
    x, (row, w) = cs.SX.sym("x", loop.plant.state.size), loop.row.symbols("row")
    (state, s), p = sensors.state.symbols("s"), cs.SX.sym("p", loop.parameters.size)
    views = loop.parameters.view(p)
    truth = loop.plant.sense(x, w, views["plant"])
    noise = Noise(w.torque_noise)
    if problem.controller.readings.noisy:
        noise = Noise(w.torque_noise, w.link_noise, w.motor_noise)
    y, after = sensors.read(truth, noise, cs.SX(problem.period), s, views["sensors"])
    said = cs.vertcat(*(getattr(y, name) for name in SAYABLE))
    return cs.Function("twin_read", [x, row, state, p], [cs.densify(said), cs.densify(after)], {"cse": True})
