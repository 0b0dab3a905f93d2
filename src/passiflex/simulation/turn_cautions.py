"""What is said before a run about turns and moments that the rotational spring of a pose task does not hold.

Its moment goes with the sine of the angle: it is largest at a right angle, and there is none at half a turn.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from passiflex.control.motion import Motion, Pose, between, hold, pose_at
from passiflex.control.turning import held_angle, largest_moment, turning_moment
from passiflex.problems.problem import Problem, SampledProblem

Array = NDArray[np.float64]

FAR = math.radians(150)
"""Beyond it a turn is worth a word: the spring has half its moment left, and less."""


MOST_INSTANTS = 2000
"""Of more, as a table of set-points may have, every second, third … is looked at."""


class _Instant(NamedTuple):
    """From here on: the reference, blocks of K_x and D_x for the rotation, and the moment on the hand in world axes."""

    time: float
    reference: Pose
    stiffness: tuple[Array, ...]
    damping: Array
    moment: Array


def far_turns(problem: Problem) -> tuple[str, ...]:
    """Return a line for each turn of the reference by more than `FAR` from where the hand is by then.

    The hand follows the reference at the pace of the slowest of its damped springs, D_x / K_x.
    """
    lines, hand, last = [], problem.home, 0.0
    target = problem.home
    for at in _instants(problem):
        K = at.stiffness[0]
        hand = between(hand, target, 1 - math.exp(-(at.time - last) / _pace(K, at)))
        last, moved = at.time, np.abs(at.reference.rotation - target.rotation).max() > 1e-9
        target = at.reference
        turn = target.rotation.T @ hand.rotation
        angle = held_angle(K, turn)
        if moved and angle > FAR:
            left = float(np.linalg.norm(turning_moment(K, turn)))
            lines.append(
                f"at {at.time:g} s the reference is turned by {math.degrees(angle):.1f}° from where the hand is: "
                f"the rotational spring, K sin(angle), begins with {round(left, 2):g} N m of its {_most(K):.3g} N m "
                "and may hold the hand there, or let it go in either direction; turn in steps of 90° or less"
            )
    return tuple(lines)


def large_moments(problem: Problem) -> tuple[str, ...]:
    """Return a line for each time from which a moment on the hand is more than its rotational spring can hold.

    Moments from outside and those of a feed-forward count together. K_x with coupled blocks is not judged.
    """
    lines, said = [], False
    for at in _instants(problem):
        size = float(np.linalg.norm(at.moment))
        limits = (
            [largest_moment(K, at.reference.rotation.T @ at.moment) for K in at.stiffness] if size else []
        )
        beyond = bool(limits) and size > min(limits) * (1 + 1e-9) and not _coupled(problem)
        if beyond and not said:
            lines.append(
                f"from {at.time:g} s on a moment of {size:.3g} N m acts on the hand: the rotational spring, "
                f"K sin(angle), holds {min(limits):.3g} N m at most in that direction, and the hand turns on and on; "
                "take a stiffer rotation, or a smaller moment"
            )
        said = beyond
    return tuple(lines)


def _instants(problem: Problem) -> Iterator[_Instant]:
    """Yield what is in force from each change on, in the order of time; nothing for a task without rotation."""
    if not problem.law.task.turns or not any(i >= 3 for i in problem.law.task.held):
        return
    gains = problem.law.layout.unpack(problem.gains)
    sampled = problem if isinstance(problem, SampledProblem) else None
    changes, pushes = (sampled.gain_changes, sampled.feedforward) if sampled else ((), ())
    times = {e.time for e in problem.events} | {t for p in pushes for t in (p.start, p.end)}
    times |= {t for c in changes for t in (c.start, c.end)}
    motion: Motion = hold(problem.home)
    began, wrench, begun, changed = 0.0, np.zeros(6), 0, 0
    instants = sorted(t for t in times if t < problem.duration)
    for time in instants[:: -(-len(instants) // MOST_INSTANTS)] if instants else []:
        while begun < len(problem.events) and problem.events[begun].time <= time:
            event, begun = problem.events[begun], begun + 1
            wrench = event.F_e
            if event.motion is not None:
                motion, began = event.motion, event.time
        own = wrench + sum((p.numbers for p in pushes if p.start <= time < p.end), np.zeros(6))
        while changed < len(changes) and changes[changed].start <= time:
            changed += 1
        before = changes[changed - 2].stiffness if changed > 1 else gains["stiffness"]
        stiffness, damping = [before], gains["damping"]
        if changed:
            last = changes[changed - 1]
            last = last.in_world(pose_at(motion, time - began).rotation, turned=problem.law.task.turned)
            stiffness, damping = [*([] if time >= last.end else stiffness), last.stiffness], last.damping
        blocks = tuple(K[3:, 3:] for K in stiffness)
        yield _Instant(time, pose_at(motion, time - began), blocks, damping[3:, 3:], own[3:])


def _pace(stiffness: Array, at: _Instant) -> float:
    """Return the time constant [s] of the slowest rotation that is held."""
    held = np.flatnonzero(np.any(stiffness != 0, axis=1))
    R = (
        np.eye(3) if held.size < 3 else at.reference.rotation
    )  # with a free axis, D_x is in those of the reference
    damping = R.T @ at.damping @ R
    axes = np.ix_(held, held)
    return max(float(scipy.linalg.eigh(damping[axes], stiffness[axes], eigvals_only=True).max()), 1e-9)


def _most(stiffness: Array) -> float:
    return float(np.linalg.eigvalsh(stiffness).max())


def _coupled(problem: Problem) -> bool:
    return bool(problem.law.layout.unpack(problem.gains)["stiffness"][:3, 3:].any())
