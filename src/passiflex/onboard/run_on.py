"""A scenario on a robot: begin where it stands, follow the reference, stop softly, keep everything."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from passiflex.errors import SimulationError
from passiflex.onboard.controller import Controller
from passiflex.onboard.reference import ScenarioReference
from passiflex.onboard.sensed import Sensed
from passiflex.onboard.settings import ApproachSettings, WatchSettings
from passiflex.runs.run import Run
from passiflex.scenarios.scenario import Scenario

Array = NDArray[np.float64]

LATE = 0.5
"""Share of a period after which one counts as late."""
TOLD = 0.25
"""Time from one line of the progress to the next [s]."""


class Robot(Protocol):
    """What a robot needs to be able to do."""

    period: float

    def read(self) -> Sensed:
        """Return what it says now."""

    def write(self, torque: Array) -> None:
        """Tell it a torque."""


class Ran(NamedTuple):
    """What came of it.

    Attributes
    ----------
    run: All periods, as a run.
    periods, late: How many there were, and how many began late.
    stopped: Whether it ended before its time, by `stop`.
    """

    run: Run
    periods: int
    late: int
    stopped: bool


def run_on(
    robot: Robot,
    scenario: Scenario,
    *,
    watch: WatchSettings | None = None,
    approach: ApproachSettings | None = None,
    weight_in_readings: bool | None = None,
    paced: bool = True,
    stop: Callable[[], bool] = lambda: False,
    report: Callable[[str], None] = lambda text: None,
) -> Ran:
    """Run a scenario on a robot for its duration, or until `stop` says so, and let the arm go softly in the end.

    Parameters
    ----------
    watch, approach, weight_in_readings: As of `Controller`.
    paced: Whether to wait for each period; a robot that waits itself, as one that is simulated, needs none.
    report: Called with a line now and then.

    Raises
    ------
    UnstableLoopError
        If the loop is unstable where the robot stands, with what it says.
    SimulationError
        If the robot's period is not the scenario's.
    """
    controller = Controller(scenario, watch, approach, weight_in_readings=weight_in_readings)
    if abs(robot.period - controller.period) > 1e-9:
        raise SimulationError(
            "the robot runs at another rate",
            got=f"{1 / robot.period:g} Hz",
            needs=f"{1 / controller.period:g} Hz",
        )
    said = robot.read()
    controller.start(said)
    reference = ScenarioReference(scenario, controller)
    ends = controller.watch.soften + 2 * controller.period
    recorder = controller.record(scenario.duration + ends)
    periods, late, stopping = round(scenario.duration / controller.period), 0, False
    began = before = time.perf_counter()
    k = 0
    while True:
        if not stopping and (k >= periods or stop()):
            controller.stop()
            stopping = True
        if stopping and controller.stopped:
            break
        if paced:
            late += _waited(began + k * controller.period, LATE * controller.period)
        if k:
            said = robot.read()
        robot.write(controller.step(said, None if stopping else reference.at(k), controller.period))
        k += 1
        if (now := time.perf_counter()) - before > TOLD:
            report(_line(controller, k, late))
            before = now
    return Ran(recorder.run(), k, late, k < periods)


def _waited(due: float, slack: float) -> bool:
    """Wait for an instant; return whether it is past by more than the slack."""
    left = due - time.perf_counter()
    if left > 0:
        time.sleep(left)
    return left < -slack


def _line(controller: Controller, periods: int, late: int) -> str:
    found = controller.report
    why = f"; {found.why}" if found.why else ""
    return f"{periods * controller.period:.1f} s, tank {found.level:.3g} J, {late} of {periods} periods late{why}"
