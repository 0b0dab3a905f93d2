"""The timeline of a scenario: what the reference does and which wrench acts, from event to event."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.control.motion import Motion, Pose, hold, pose_at, rebased
from passiflex.problems.problem import Event
from passiflex.scenarios.environment import labelled
from passiflex.scenarios.reference import AbstractReferenceEvent
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.touching import Change

Array = NDArray[np.float64]


def timeline(scenario: Scenario, home: Pose) -> tuple[Event, ...]:
    """Return the events in the order of time: each change of the reference or of what acts on the robot is one."""
    motions = _motions(scenario, home)
    wrenches = _summed([(f.start, f.end, (*f.force, *f.moment)) for f in scenario.forces])
    felt = [entry.changes(label) for label, entry in labelled(scenario.environment).items()]
    changing = {change.time for changes in felt for change in changes} | wrenches.keys()
    acting, events = np.zeros(6), []
    for time in sorted({0.0, *motions, *(t for t in changing if t < scenario.duration)}):
        acting = wrenches.get(time, acting)
        events.append(Event(time, motions.get(time), acting.copy(), _felt(felt, time)))
    return tuple(events)


def _felt(entries: Sequence[Sequence[Change]], time: float) -> dict[str, Any]:
    """Return the inputs of what touches the robot: those of one name add up, to a sum that is rounded once."""
    found: dict[str, list[Any]] = {}
    for changes in entries:
        in_force = next((change for change in reversed(changes) if change.time <= time), None)
        for name, value in (in_force.inputs if in_force else {}).items():
            found.setdefault(name, []).append(value)
    return {
        name: values[0] if len(values) == 1 else math.fsum(values) for name, values in sorted(found.items())
    }


def _motions(scenario: Scenario, home: Pose) -> dict[float, Motion]:
    motions: dict[float, Motion] = {0.0: hold(home)}
    began = 0.0
    ends = [*(event.at for event in scenario.reference[1:]), scenario.duration]
    for event, end in zip(scenario.reference, ends, strict=False):
        now = pose_at(motions[began], event.at - began)
        for time, motion in event.motions(now, scenario.seed):
            if time >= end:
                break
            motions[time], began = motion, time
    return motions


def with_motions(events: tuple[Event, ...], own: Sequence[AbstractReferenceEvent]) -> tuple[Event, ...]:
    """Return the events with further motions, from where the reference is by then; later ones go along with them."""
    first = events[0].motion
    assert first is not None
    old, old_began, new, new_began = first, 0.0, first, 0.0
    found: list[Event] = []
    times = {e.time: e for e in events}
    added = {event.at: event for event in own}
    for time in sorted({*times, *added}):
        was, now = pose_at(old, time - old_began), pose_at(new, time - new_began)
        event = times.get(time) or found[-1]._replace(time=time, motion=None)
        if event.motion is not None and time > 0:
            old, old_began, new, new_began = event.motion, time, rebased(event.motion, was, now), time
            event = event._replace(motion=new)
        if time in added:
            new, new_began = added[time].build(now), time
            event = event._replace(motion=new)
        found.append(event)
    return tuple(found)


def _summed(lasting: Sequence[tuple[float, float, tuple[float, ...]]]) -> dict[float, Array]:
    """Return the sum of what acts from each instant on at which something begins or ends.

    Its numbers are rounded sums of all that act: kept as fractions, nothing is left behind by what has ended.
    """
    changes: dict[float, list[tuple[int, tuple[float, ...]]]] = {}
    for start, end, numbers in lasting:
        changes.setdefault(start, []).append((1, numbers))
        changes.setdefault(end, []).append((-1, numbers))
    acting, out = [Fraction(0)] * len(lasting[0][2]) if lasting else [], {}
    for time in sorted(changes):
        for sign, numbers in changes[time]:
            acting = [sum_ + sign * Fraction(part) for sum_, part in zip(acting, numbers, strict=True)]
        out[time] = np.array([float(part) for part in acting])
    return out
