"""The reference of a scenario, period by period, for a robot that stands where it stands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from passiflex.loops.sampled_loop import SampledLoop
from passiflex.native import NativeFunction, compile_functions
from passiflex.onboard.controller import Controller
from passiflex.onboard.recorder import ASKED
from passiflex.onboard.setpoint import Setpoint
from passiflex.problems.problem import require_sampled
from passiflex.problems.resolution import resolve
from passiflex.scenarios.scenario import Scenario
from passiflex.simulation.schedule import PeriodRows

Array = NDArray[np.float64]

CHUNK = 64
"""Periods that are made ready at a time."""


class ScenarioReference:
    """What a scenario asks for, written into a controller that was started.

    Parameters
    ----------
    scenario: With reference, changes of gains and feed-forward wrenches; relative ones begin where the robot stands.
    """

    def __init__(self, scenario: Scenario, controller: Controller):
        asked = scenario.changed({"environment": None, "forces": None, "noise": None, "deviations": None})
        asked = asked.changed(
            {"posture": controller.problem.q.tolist(), "control.jitter": 0, "control.missed": 0}
        )
        problem = require_sampled(resolve(asked))
        loop = SampledLoop(problem.controller, problem.elements)
        (library,) = (compile_functions([loop.period.function]),)
        self._rows = PeriodRows(problem, loop.period, NativeFunction(loop.period.function, library))
        self._slices, self._controller = loop.row.slices, controller
        self._first, self._chunk = 0, np.empty((0, loop.row.size))
        self._keep = Setpoint()

    def at(self, period: int) -> Setpoint:
        """Write what is asked for in a period, one after the other, and return what `step` takes for it."""
        if period >= self._first + len(self._chunk):
            self._first = period
            self._chunk, _ = self._rows.take(period, CHUNK)
        row, asked = self._chunk[period - self._first], self._controller.asked
        if self._controller.last is not self._keep:
            self._controller.ask(self._keep)
        for name, of in ASKED.items():
            asked[of][...] = row[self._slices[name]].reshape(asked[of].shape)
        return self._keep
