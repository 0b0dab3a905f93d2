"""What is said before a run about a reference that jumps or races far away, as a table in other axes or units does."""

from __future__ import annotations

import numpy as np

from passiflex.control.motion import Motion, hold, pose_at
from passiflex.problems.problem import Problem

FAR = 0.3
"""A jump [m] beyond it is worth a word: no arm at rest comes after it at once."""
FASTEST = 10.0
"""Speed [m/s] that no hand has."""


def far_jumps(problem: Problem) -> tuple[str, ...]:
    """Return a line for the first jump of the reference by more than `FAR`, with what it stores in the spring."""
    motion: Motion = hold(problem.home)
    began = 0.0
    K = problem.law.layout.unpack(problem.gains)["stiffness"][:3, :3]
    for event in problem.events:
        if event.motion is None:
            continue
        way = pose_at(event.motion, 0.0).position - pose_at(motion, event.time - began).position
        if (size := float(np.linalg.norm(way))) > FAR:
            stored = way @ K @ way / 2
            return (
                f"at {event.time:g} s the reference jumps by {size:.3g} m at once, which stores {stored:.3g} J "
                "in the spring of a hand that stands still; move there, or begin a table where the hand is "
                "(relative: true takes its rows from there)",
            )
        motion, began = event.motion, event.time
    return ()


def racing(problem: Problem) -> tuple[str, ...]:
    """Return a line for the first motion of the reference that is far and faster than any hand."""
    moving = [event for event in problem.events if event.motion is not None]
    for event, end in zip(moving, [*(e.time for e in moving[1:]), problem.duration], strict=True):
        assert event.motion is not None
        lasts = min(end - event.time, float(event.motion["horizon"]))
        if not lasts > 0:
            continue
        way = pose_at(event.motion, lasts).position - pose_at(event.motion, 0.0).position
        if (size := float(np.linalg.norm(way))) > FAR and size / lasts > FASTEST:
            return (
                f"from {event.time:g} s on the reference moves by {size:.3g} m in {lasts:.3g} s, "
                f"{size / lasts:.3g} m/s, which no hand can follow; if it is a table, are its lengths in m and its "
                "times in s?",
            )
    return ()
