"""The timeline of a scenario: what the reference does and which wrench acts, from event to event."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from passiflex.control.motion import Motion, Pose, hold, pose_at
from passiflex.problems.problem import Event
from passiflex.scenarios.scenario import Force, Scenario

Array = NDArray[np.float64]


def timeline(scenario: Scenario, home: Pose) -> tuple[Event, ...]:
    """Return the events in the order of time: each change of the reference or of the wrench is one."""
    motions = _motions(scenario, home)
    wrenches = _wrenches(scenario)
    times = sorted({0.0, *motions, *(t for t in wrenches if t < scenario.duration)})
    acting, events = np.zeros(6), []
    for time in times:
        acting = wrenches.get(time, acting)
        events.append(Event(time, motions.get(time), acting.copy()))
    return tuple(events)


def _motions(scenario: Scenario, home: Pose) -> dict[float, Motion]:
    motions: dict[float, Motion] = {0.0: hold(home)}
    began = 0.0
    for event in scenario.reference:
        now = pose_at(motions[began], event.at - began)
        motions[event.at] = event.build(now)
        began = event.at
    return motions


def _wrenches(scenario: Scenario) -> dict[float, Array]:
    """Return the wrench that acts from each instant on at which a force begins or ends.

    Its numbers are rounded sums of all that act: kept as fractions, a force leaves nothing behind when it ends.
    """
    changes: dict[float, list[tuple[int, Force]]] = {}
    for force in scenario.forces:
        changes.setdefault(force.start, []).append((1, force))
        changes.setdefault(force.end, []).append((-1, force))
    acting, out = [Fraction(0)] * 6, {}
    for time in sorted(changes):
        for sign, force in changes[time]:
            parts = (*force.force, *force.moment)
            acting = [sum_ + sign * Fraction(part) for sum_, part in zip(acting, parts, strict=True)]
        out[time] = np.array([float(part) for part in acting])
    return out
