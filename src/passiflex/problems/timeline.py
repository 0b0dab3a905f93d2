"""The timeline of a scenario: what the reference does and which wrench acts, from event to event."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.control.motion import Motion, Pose, hold, pose_at, rebased
from passiflex.problems.problem import Event
from passiflex.scenarios.environment import labelled
from passiflex.scenarios.forces import Acting
from passiflex.scenarios.reference import AbstractReferenceEvent
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.touching import Change

Array = NDArray[np.float64]
ZEROS = (0.0,) * 6


def timeline(scenario: Scenario, home: Pose) -> tuple[Event, ...]:
    """Return the events in the order of time: each change of the reference or of what acts on the robot is one."""
    motions = _motions(scenario, home)
    wrenches = _summed([acting for f in scenario.forces for acting in f.acting(scenario.duration)])
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


def _summed(lasting: Sequence[Acting]) -> dict[float, Array]:
    """Return the sum of what acts from each instant on at which something begins or ends, rounded once.

    It is made anew each time of all that act then, so that nothing is left behind by what has ended.
    """
    begins: dict[float, list[int]] = {}
    for i, acting in enumerate(lasting):
        begins.setdefault(acting.start, []).append(i)
        begins.setdefault(acting.end, []).append(~i)
    now, out = dict[int, tuple[float, ...]](), {}
    for time in sorted(begins):
        for i in begins[time]:
            if i < 0:
                now.pop(~i, None)
            else:
                now[i] = lasting[i].wrench
        out[time] = np.array([math.fsum(parts) + 0.0 for parts in zip(*now.values(), strict=True)] or ZEROS)
    return out
