"""The ideal mass-spring-damper that a run is held against, from the run's own scenario."""

from __future__ import annotations

import numpy as np

from passiflex.control.gain_design import target_inertia
from passiflex.control.motion import Pose
from passiflex.diagrams.panel import Array
from passiflex.errors import PassiflexError
from passiflex.metrics.closed_form import ideal_displacement
from passiflex.problems.timeline import timeline
from passiflex.runs.run import Run
from passiflex.runs.run_arm import problem_of
from passiflex.scenarios.scenario import Scenario

RATIO = 0.7
"""ζ of the ideal, as in the paper; K_x and D_x of the run then give it its inertia."""
ANYWHERE = Pose(np.zeros(3), np.eye(3))
"""Where the ideal starts: its displacement is the same from everywhere."""


def ideal_motion(run: Run) -> Array | None:
    """Return the displacement of M_x ẍ + D_x ẋ + K_x (x − x_d) = F_e at the rows of a run, (N, 3) m.

    None if the scenario cannot be read or its robot not be found, and where something acts that the
    ideal does not know: gains that change in flight or are in tool axes, what touches the robot, feed-forward wrenches,
    free directions, parts of one's own. None of a robot's own run, whose reference and forces came from outside.
    """
    scenario = run.scenario
    if run.own_parts or run.as_read:
        return None
    if scenario is None or scenario.gains_change or scenario.environment or scenario.feedforward:
        return None
    law = scenario.law
    if law.stiffness.free or law.stiffness.in_tool or law.damping.in_tool:
        return None
    gains = _gains(run, scenario)
    if gains is None:
        return None
    stiffness, damping = gains
    inertia = target_inertia(stiffness, damping, RATIO)
    interval = scenario.output_interval
    count = int(np.ceil(run.time[-1] / interval - 1e-9)) + 1
    moved = ideal_displacement(
        inertia, stiffness, damping, timeline(scenario, ANYWHERE), interval, max(count, 2)
    )
    grid = interval * np.arange(len(moved))
    return np.column_stack([np.interp(run.time, grid, moved[:, i]) for i in range(3)])


def _gains(run: Run, scenario: Scenario) -> tuple[Array, Array] | None:
    """Return K_x and D_x; a damping that is given by its ratio is that of the robot at its start."""
    law = scenario.law
    if law.damping.ratio is None:
        return law.stiffness.full(), law.damping.full()
    try:
        problem = problem_of(run, scenario)
    except PassiflexError:
        return None
    if problem is None:
        return None
    gains = problem.law.layout.unpack(problem.gains)
    return gains["stiffness"], gains["damping"]
