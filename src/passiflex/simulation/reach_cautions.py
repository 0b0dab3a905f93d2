"""What is said before a run about a reference that no posture can follow: beyond the arm, or off its plane."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from passiflex.control.motion import pose_at
from passiflex.control.posture import SINGULAR, posture
from passiflex.problems.problem import Problem
from passiflex.robots.chain import SerialChain
from passiflex.robots.frames import world_frames

Array = NDArray[np.float64]

NOTED = 1e-3
"""By how much [m] a reference has to be beyond what the arm can reach."""
LOOKS = 12
"""Instants at which each motion of the reference is looked at."""
PLACES = 8
"""Random postures that tell a direction in which an arm moves nowhere from one that a posture has lost."""


def out_of_reach(problem: Problem) -> tuple[str, ...]:
    """Return a line for a reference that is further away than the arm is long, and one for one off its plane."""
    wished = list(_reference(problem))
    return (*_too_far(problem, wished), *_off_the_plane(problem, wished))


def longest(chain: SerialChain) -> tuple[Array, float]:
    """Return a point (3,) that no joint moves, and a distance from it [m] that no end effector exceeds; inf if endless.

    The distance is that of links in one line: a bound, not the border of the workspace.
    """
    first = 0
    for joint, after in zip(chain.joints, [*(j.xyz for j in chain.joints[1:]), chain.tip_xyz], strict=True):
        if joint.kind == "prismatic" or np.linalg.norm(np.cross(joint.axis, after)) > 1e-9:
            break  # it moves the frame after it
        first += 1
    still = world_frames(chain, np.zeros((1, chain.n))).position[0, first + 1]
    lengths = [np.linalg.norm(j.xyz) for j in chain.joints[first + 1 :]] + [np.linalg.norm(chain.tip_xyz)]
    slides = [max(abs(j.lower), abs(j.upper)) for j in chain.joints[first:] if j.kind == "prismatic"]
    return still, float(np.sum(lengths[: chain.n - first]) + np.sum(slides))


def _reference(problem: Problem) -> Iterator[tuple[float, Array]]:
    """Yield instants [s] and where the reference is by then (3,) m, in world axes."""
    moving = [event for event in problem.events if event.motion is not None]
    for event, end in zip(moving, [*(e.time for e in moving[1:]), problem.duration], strict=True):
        assert event.motion is not None
        lasts = max(min(end, problem.duration) - event.time, 0.0)
        for clock in np.linspace(0, lasts, LOOKS):
            yield event.time + clock, pose_at(event.motion, float(clock)).position


def _too_far(problem: Problem, wished: list[tuple[float, Array]]) -> tuple[str, ...]:
    still, length = longest(problem.law.robot.arm.chain)
    for time, place in wished:
        if (away := float(np.linalg.norm(place - still))) > length + NOTED:
            return (
                f"at {time:.3g} s the reference is {away:.3g} m from the arm's shoulder, and the arm is at most "
                f"{length:.3g} m long: it cannot come there, and its spring stays stretched",
            )
    return ()


def _off_the_plane(problem: Problem, wished: list[tuple[float, Array]]) -> tuple[str, ...]:
    robot = problem.law.robot
    numbers = robot.layout.unpack(problem.model)
    rng = np.random.default_rng(0)
    places = problem.q + rng.uniform(-1, 1, (PLACES, robot.n))
    moved = np.hstack([posture(robot, q, numbers).jacobian[:3] for q in places])
    directions, sizes, _ = np.linalg.svd(moved)
    nowhere = directions[:, sizes < SINGULAR * sizes[0]]
    K = problem.law.layout.unpack(problem.gains)["stiffness"][:3, :3]
    for time, place in wished:
        off = nowhere @ (nowhere.T @ (place - problem.home.position))
        if (size := float(np.linalg.norm(off))) > NOTED:
            way = " ".join(f"{value + 0.0:.2g}" for value in np.round(off / size, 2))
            return (
                f"at {time:.3g} s the reference is {size:.3g} m along [{way}], a way in which no posture of the arm "
                f"moves its end effector: {off @ K @ off / 2:.3g} J stay in the spring, which a tank has to pay for",
            )
    return ()
