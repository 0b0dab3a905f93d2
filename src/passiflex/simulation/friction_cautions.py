"""What is said before a run about friction that the actions make up for, which no linear loop shows."""

from __future__ import annotations

import numpy as np

from passiflex.elements.friction import StickingFriction
from passiflex.problems.problem import Problem, SampledProblem

SPEEDS = np.geomspace(1e-4, 10, 400)
"""[rad/s] At which the two are compared."""
STEEPEST = 3 * np.sqrt(3) / 8
"""Largest slope of x |x| / (x² + 1)."""


def much_compensation(problem: Problem) -> tuple[str, ...]:
    """Return that more dry friction is made up for than there is, or that it is steeply where it sticks."""
    if not isinstance(problem, SampledProblem):
        return ()
    actions = problem.parts.unpack("actions", problem.numbers)
    given, width = actions["coulomb_compensation"], float(actions["compensation_width"])
    if not given.any():
        return ()
    plant, none = problem.parts.unpack("plant", problem.numbers), np.zeros(given.size)
    there = plant.get("coulomb_friction", none)
    sticks = any(isinstance(e, StickingFriction) for e in problem.elements)
    share = np.ones_like(SPEEDS) if sticks else np.tanh(SPEEDS / float(plant.get("friction_width", width)))
    made = SPEEDS**2 / (SPEEDS**2 + width**2)
    excess = (given[:, None] * made - there[:, None] * share).max(axis=1)
    joint = int(np.argmax(excess))
    if excess[joint] > 0:
        at = SPEEDS[np.argmax(given[joint] * made - there[joint] * share)]
        return (
            f"actions make up for more dry friction than joint {joint + 1} has, by {excess[joint]:.2g} N m at "
            f"{at:.2g} rad/s: what is too much keeps it moving",
        )
    slope = STEEPEST * given / width - plant.get("viscous_friction", none)
    joint = int(np.argmax(slope))
    if sticks and slope[joint] > 0:
        return (
            f"friction of joint {joint + 1} sticks, and making up for it takes away up to {slope[joint]:.2g} N m s/rad "
            "of the damping of a motor that gives way within it: if it trembles at rest, try a larger "
            "actions.compensation_width or a smaller coulomb_compensation",
        )
    return ()
