"""The timeline of a scenario: what the reference does and which wrench acts, from event to event."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from passiflex.simulation.motion import Motion, Pose, circle, hold, minimum_jerk, pose_at
from passiflex.simulation.problem import Event
from passiflex.simulation.scenario import Circle, Move, Scenario, Step

Array = NDArray[np.float64]


def timeline(scenario: Scenario, home: Pose) -> tuple[Event, ...]:
    """Return the events in the order of time: each change of the reference or of the wrench is one."""
    motions = _motions(scenario, home)
    times = {0.0, *motions}
    for force in scenario.forces:
        times |= {t for t in (force.start, force.end) if t < scenario.duration}
    return tuple(Event(t, motions.get(t), _wrench(scenario, t)) for t in sorted(times))


def _motions(scenario: Scenario, home: Pose) -> dict[float, Motion]:
    motions: dict[float, Motion] = {0.0: hold(home)}
    began = 0.0
    for event in scenario.reference:
        now = pose_at(motions[began], event.at - began)
        if isinstance(event, Step):
            turned = Rotation.from_rotvec(event.turn).as_matrix() @ now.rotation
            motion = hold(Pose(now.position + np.array(event.by), turned))
        elif isinstance(event, Move):
            motion = minimum_jerk(now, event.by, event.duration)
        elif isinstance(event, Circle):
            first, second = (np.eye(3)["xyz".index(a)] for a in event.plane)
            motion = circle(now, first, second, event.radius, event.period)
        else:
            motion = hold(now)
        motions[event.at] = motion
        began = event.at
    return motions


def _wrench(scenario: Scenario, time: float) -> Array:
    wrench = np.zeros(6)
    for force in scenario.forces:
        if force.start <= time < force.end:
            wrench += [*force.force, *force.moment]
    return wrench
