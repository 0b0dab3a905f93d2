"""What the surfaces of a run felt of the hand, in numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from passiflex.elements import Surface
from passiflex.passivity.ledger import Signals
from passiflex.problems.problem import Problem

Array = NDArray[np.float64]

TOUCHES = 0.1
"""Force [N] from which on the hand is on a surface."""
OF_SURFACE = ("force", "given_energy")
"""Signals of a surface that are needed, after its name."""


def surfaces_of(problem: Problem) -> tuple[str, ...]:
    """Return the names of the surfaces in a problem."""
    return tuple(e.label for e in problem.elements if isinstance(e, Surface))


def contact_signals(problem: Problem) -> tuple[str, ...]:
    """Return the signals of a problem that `contact_numbers` needs."""
    return tuple(f"{name}_{signal}" for name in surfaces_of(problem) for signal in OF_SURFACE)


def contact_numbers(names: Sequence[str], run: Signals) -> Mapping[str, float]:
    """Return what surfaces felt, by the names of the measures; nothing where there is none."""
    if not names:
        return {}
    forces = [np.linalg.norm(run[f"{name}_force"], axis=1) for name in names]
    given = sum(run[f"{name}_given_energy"] for name in names)
    return {
        "contact_force_peak": max(force.max() for force in forces),
        "contact_impulse": sum(float(np.trapezoid(force, run.time)) for force in forces),
        "contact_energy": -np.min(given, initial=0.0),
        "contact_bounces": sum(left(force) for force in forces),
    }


def left(force: Array) -> int:
    """Return how often a force over time ended."""
    on = force > TOUCHES
    return int((on[:-1] & ~on[1:]).sum())
