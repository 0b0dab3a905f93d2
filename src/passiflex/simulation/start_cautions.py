"""What is said before a run about its start: directions that are lost there, and joints within what is around."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from passiflex.control.posture import lost_directions, posture
from passiflex.elements.held import Held
from passiflex.elements.surface import Surface
from passiflex.problems.problem import Problem
from passiflex.robots.frames import world_frames

Array = NDArray[np.float64]

WITHIN = 1e-3
"""Depth [m] from which on a joint is within something; a base stands on its table."""


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


def swallowed_joints(problem: Problem) -> tuple[str, ...]:
    """Return a line for each surface that joints are within at the start: only the hand is touched by it."""
    joints = world_frames(problem.law.robot.arm.chain, problem.q[None]).position[0, 1:-1]
    told = []
    for element in problem.elements:
        if not isinstance(element, Surface):
            continue
        within = np.flatnonzero(element.depths(joints) > WITHIN) + 1
        if within.size:
            which = (
                f"joint {within[0]} is" if within.size == 1 else f"joints {', '.join(map(str, within))} are"
            )
            told.append(
                f"{which} within {element.label} at the start: the hand alone touches what is around it, and nothing "
                "keeps the arm out; try a place or a size that leaves the arm free"
            )
    return tuple(told)


def heavy_loads(problem: Problem) -> tuple[str, ...]:
    """Return a line for each load whose weight, with the arm's own, is more than a motor holds where the arm starts."""
    robot = problem.law.robot
    at = posture(robot, problem.q, robot.layout.unpack(problem.model))
    told = []
    for element in problem.elements:
        if not isinstance(element, Held) or element.anchored:
            continue
        mass = float(np.asarray(element.values["mass"]))
        force = mass * np.asarray(element.values["weight"])
        needed = np.abs(at.gravity_torque - at.jacobian[:3].T @ force)
        joint = int(np.argmax(needed / robot.torque_limit))
        if needed[joint] > robot.torque_limit[joint]:
            told.append(
                f"to hold {element.label}, {mass:.3g} kg, where the arm starts, motor {joint + 1} needs "
                f"{needed[joint]:.3g} N m and has {robot.torque_limit[joint]:.3g}: a real arm sinks"
            )
    return tuple(told)


def _words(way: Array) -> str:
    """Return a direction (k,) in world axes in words, by the larger of its parts."""
    push, turn = way[:3], way[3:]
    turns = turn.size > 0 and np.linalg.norm(turn) > np.linalg.norm(push)
    part = turn if turns else push
    axis = part / part[int(np.argmax(np.abs(part)))]
    shown = " ".join(f"{value + 0.0:.2g}" for value in np.round(axis, 2))
    return f"{'turn about' if turns else 'move along'} [{shown}]"
