"""What is said before a run about a start in which the end effector cannot move in all directions that are held."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from passiflex.control.posture import lost_directions, posture
from passiflex.problems.problem import Problem

Array = NDArray[np.float64]


def singular_start(problem: Problem) -> tuple[str, ...]:
    """Return a line for a start in a singular posture: no joint torque acts in a direction that is lost."""
    law = problem.law
    at = posture(law.robot, problem.q, law.robot.layout.unpack(problem.model))
    lost = lost_directions(law.task, at)
    if not lost.size:
        return ()
    ways = " and ".join(_words(way) for way in lost.T)
    return (
        f"the arm starts where its end effector cannot {ways}: the law neither holds nor moves it that way until "
        "something else has bent the arm",
    )


def _words(way: Array) -> str:
    """Return a direction (k,) in world axes in words, by the larger of its parts."""
    push, turn = way[:3], way[3:]
    turns = turn.size > 0 and np.linalg.norm(turn) > np.linalg.norm(push)
    part = turn if turns else push
    axis = part / part[int(np.argmax(np.abs(part)))]
    shown = " ".join(f"{value + 0.0:.2g}" for value in np.round(axis, 2))
    return f"{'turn about' if turns else 'move along'} [{shown}]"
