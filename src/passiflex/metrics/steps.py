"""The response to the first step of a scenario, in numbers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.metrics.numbers import overshoot, rms, settling_time
from passiflex.scenarios.forces import Acting
from passiflex.scenarios.reference import AbstractReferenceEvent, Step
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.setpoints import Table

Array = NDArray[np.float64]

FEWEST = 10
"""Rows in which a response is to be seen."""


class StepWindow(NamedTuple):
    """A step: size [m], direction (3,) of length one, and the time in which it is looked at [s]."""

    size: float
    direction: Array
    begin: float
    end: float


def step_window(scenario: Scenario) -> StepWindow | None:
    """Return the first step of a scenario until the next event of any kind.

    None if it has none that moves, or none that is left alone for `FEWEST` rows.
    """
    step = next((e for e in scenario.reference if isinstance(e, Step) and any(e.by)), None)
    if step is None:
        return None
    times = [t for e in scenario.reference for t in _instants(e, scenario)]
    times += [t for c in scenario.gain_changes for t in (c.at, c.at + c.duration)]
    times += [t for f in scenario.forces for t in _changes(f.acting(scenario.duration))]
    times += [t for entry in scenario.feedforward for t in (entry.start, entry.end)]
    times += [t for entry in scenario.environment for t in entry.lasts]
    size = float(np.linalg.norm(step.by))
    end = min([t for t in times if t > step.at] + [scenario.duration])
    if end - step.at < FEWEST * scenario.output_interval:
        return None
    return StepWindow(size, np.array(step.by) / size, step.at, end)


def _changes(acting: Iterable[Acting]) -> list[float]:
    """Return when a wrench changes [s], of rows one after the other that may say the same."""
    found, none = list[float](), (0.0,) * 6
    before, until = tuple[float, ...](none), 0.0
    for start, end, wrench in acting:
        held = tuple(wrench)
        if start > until and any(before):
            found.append(until)
        if held != (before if start <= until else none):
            found.append(start)
        before, until = held, end
    return [*found, until] if any(before) else found


def _instants(event: AbstractReferenceEvent, scenario: Scenario) -> list[float]:
    """Return when an event begins, and when each change of gains in it begins and ends [s].

    Its motions end with the event that comes next; gains that have begun to go over to a row go on.
    """
    if not isinstance(event, Table):
        return [event.at]
    end = min([e.at for e in scenario.reference if e.at > event.at] + [scenario.duration])
    rows = (row for row in event.gains(scenario.seed) if row.start < end)
    return [event.at, *(t for row in rows for t in (row.start, row.end))]


def displacement(position: Array) -> Array:
    """Return the end effector's motion since the start, (N, 3) m."""
    return position - position[0]


def step_numbers(time: Array, motion: Array, ideal: Array, window: StepWindow) -> dict[str, float]:
    """Return overshoot, settling time, offset and distance to the ideal of one response.

    Parameters
    ----------
    time: (N,) s.
    motion: Displacement (N, 3) m; it may have ended early.
    ideal: Displacement of the ideal, (N, 3) m or longer.
    """
    start = max(int(np.searchsorted(time, window.begin)) - 1, 0)
    along, wanted = motion @ window.direction, ideal[: time.size] @ window.direction
    moved = along - along[start]  # from where the step finds the robot
    inside = (time >= window.begin) & (time < window.end)
    away = moved - (wanted - wanted[start])  # the ideal, too, may have been moved before
    return {
        "overshoot": overshoot(time, moved, window.size, window.begin, window.end),
        "settling_time": settling_time(time, moved, window.size, window.begin, window.end),
        "offset_before_step": along[start],
        "rms_to_msd": rms(away[inside]) / window.size,
    }
