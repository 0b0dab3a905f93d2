"""What an engineer should know of a problem before it runs, one line each: nothing here refuses anything."""

from __future__ import annotations

from collections.abc import Callable

from passiflex.problems.problem import Problem
from passiflex.simulation.book_cautions import book_cautions
from passiflex.simulation.friction_cautions import much_compensation
from passiflex.simulation.jump_cautions import far_jumps, racing
from passiflex.simulation.reach_cautions import out_of_reach
from passiflex.simulation.stability_cautions import stability_cautions
from passiflex.simulation.start_cautions import heavy_loads, singular_start, swallowed_joints
from passiflex.simulation.turn_cautions import far_turns, large_moments

CAUTIONS: tuple[Callable[[Problem], tuple[str, ...]], ...] = (
    stability_cautions,
    singular_start,
    swallowed_joints,
    heavy_loads,
    far_jumps,
    racing,
    out_of_reach,
    far_turns,
    large_moments,
    much_compensation,
    book_cautions,
)
"""Who is asked, in the order in which the lines are printed."""


def cautions(problem: Problem) -> tuple[str, ...]:
    """Return what is worth a word before the run, in words."""
    return tuple(line for ask in CAUTIONS for line in ask(problem))
