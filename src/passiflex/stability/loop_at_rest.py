"""A sampled loop that has been at rest for long: where it stands, what its controller remembers and is told."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.control.motion import Pose
from passiflex.control.posture import Posture, posture
from passiflex.loops.sampled_loop import SampledLoop
from passiflex.problems.problem import SampledProblem
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.sampled.rest import Rest

Array = NDArray[np.float64]

BRIMFUL = 1e6
"""Level [J] of a tank that holds nothing back."""
AT_REST = ("shaped_stiffness", "stiffness", "damping")
"""Gains that decide where a loop rests and what it then remembers."""


class Standing(NamedTuple):
    """A robot at rest under its weight.

    Attributes
    ----------
    q, theta: (n,).
    held: The motor torque that holds it (n,) [N m].
    plant: Its numbers, flat, as `Plant.parameters`.
    arm: It at q, by these numbers.
    """

    q: Array
    theta: Array
    held: Array
    plant: Array
    arm: Posture


class AtRest(NamedTuple):
    """Memory and row of a period at rest, flat: `SampledLoop.memory` and `SampledLoop.row`; and φ (n,)."""

    memory: Array
    row: Array
    phi: Array


def standing(
    problem: SampledProblem, q: Array | None = None, plant: Mapping[str, Array] | None = None
) -> Standing:
    """Return the problem's robot at rest: at its start, or at another q; itself, or with other numbers (by name)."""
    robot, layout = problem.law.robot, problem.parts["plant"]
    true = layout.unpack(problem.plant) | dict(plant or {})
    where = problem.q if q is None else q
    here = posture(robot, where, true)
    if q is None and not plant:
        return Standing(where, problem.theta, problem.held, problem.plant, here)
    weight = here.gravity_torque
    return Standing(where, where + weight / true["joint_stiffness"], weight, layout.pack(true), here)


def loop_at_rest(
    problem: SampledProblem,
    loop: SampledLoop,
    gains: Mapping[str, ArrayLike],
    period: float,
    at: Standing | None = None,
) -> AtRest:
    """Return what a period finds and leaves unchanged, with the gains in place of the problem's and a full tank."""
    p, at = problem, at or standing(problem)
    model = p.law.robot.layout.unpack(p.model)
    shaped = p.law.posture_at_rest(at.q, at.theta, model["joint_stiffness"], gains)
    home = _seen(p.law.robot, shaped.tobytes(), p.model.tobytes()).pose
    rest = at_rest(p, at, home, gains["stiffness"], BRIMFUL, running=1.0)
    row: dict[str, Any] = {
        "desired_position": home.position,
        "desired_rotation": home.rotation,
        "desired_stiffness": gains["stiffness"],
        "desired_damping": gains["damping"],
        "elapsed": period,
    }
    return AtRest(loop.start(rest), loop.row.pack(loop.row.zeros() | row), shaped)


def at_rest(
    problem: SampledProblem, at: Standing, home: Pose, stiffness: ArrayLike, level: float, *, running: float
) -> Rest:
    """Return what the parts of a loop are told of where it rests: its reference at `home`, its tank at a level [J]."""
    robot = problem.law.robot
    model, plant = robot.layout.unpack(problem.model), robot.layout.unpack(at.plant)
    seen = _seen(robot, at.q.tobytes(), problem.model.tobytes())
    return Rest(
        running=running,
        q=at.q,
        theta=at.theta,
        tau_a=plant["joint_stiffness"] * (at.theta - at.q),
        weight=seen.gravity_torque,
        command=at.held,
        stiffness=model["joint_stiffness"],
        position=home.position,
        rotation=home.rotation,
        cartesian_stiffness=np.asarray(stiffness),
        level=level,
    )


@lru_cache(maxsize=256)
def _seen(robot: FlexibleJointRobot, q: bytes, model: bytes) -> Posture:
    """Return the arm at q as a law sees it: asked again and again for gains that change nothing there."""
    return posture(robot, np.frombuffer(q), robot.layout.unpack(np.frombuffer(model)))
