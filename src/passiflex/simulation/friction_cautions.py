"""What is said before a run about friction that the actions make up for."""

from __future__ import annotations

import numpy as np

from passiflex.problems.problem import Problem, SampledProblem


def much_compensation(problem: Problem) -> tuple[str, ...]:
    """Return that more dry friction is made up for than the motors have, which no linear loop shows."""
    if not isinstance(problem, SampledProblem):
        return ()
    given = problem.parts.unpack("actions", problem.numbers)["coulomb_compensation"]
    plant = problem.parts.unpack("plant", problem.numbers)
    there = plant.get("coulomb_friction", np.zeros(given.size))
    if not (given > there).any():
        return ()
    joint = int(np.argmax(given - there))
    return (
        f"actions make up for {given[joint]:g} N m of dry friction at joint {joint + 1}, which has "
        f"{there[joint]:g} N m: what is too much keeps it moving",
    )
