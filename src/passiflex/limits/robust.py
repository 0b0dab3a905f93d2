"""A margin, as a family of robots: everything that could be off, off by that much; does the law hold on all?"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.errors import ValueRangeError
from passiflex.simulation import Problem
from passiflex.simulation.altered import altered
from passiflex.simulation.linear_loop import LinearLoop

Array = NDArray[np.float64]

FIELDS = {
    "B": ("motor_inertia",),
    "K": ("joint_stiffness",),
    "D": ("joint_damping",),
    "link inertia": ("link_mass", "link_inertia"),
}
"""What can be off, and the numbers of the robot that go with it."""
DRAWS, SEED = 4, 20
"""Random draws of everything at once, and the seed of them."""


class Perturbation(NamedTuple):
    """A robot that is not what its model says.

    Attributes
    ----------
    name: As "B −20 %".
    factors: By the names of `FIELDS`, the truth as a multiple of the model, (n,).
    late: By how many periods a command is later than the law knows.
    """

    name: str
    factors: Mapping[str, Array]
    late: float


class Worst(NamedTuple):
    """Where the spectral radius is largest: over postures and perturbations."""

    radius: float
    posture: int
    perturbation: str

    @property
    def stable(self) -> bool:
        """Return whether all are stable."""
        return self.radius < 1


def perturbations(n: int, margin: float) -> tuple[Perturbation, ...]:
    """Return the perturbations that a margin (0.2 for 20 %) stands for, the nominal robot first.

    B, K, D and the links' inertia each up and down, all joints alike; the delay up and down by so many
    periods; then `DRAWS` draws of all of them at once, each joint by itself, uniformly within the margin.

    Raises
    ------
    ValueRangeError
        For a margin that leaves nothing of the robot.
    """
    if not 0 <= margin < 1:
        raise ValueRangeError("margin", got=f"{margin:g}", needs="0 to below 1, as 0.2 for 20 %")
    found = [Perturbation("nothing off", {}, 0.0)]
    if margin == 0:
        return tuple(found)
    for sign, word in ((1, "+"), (-1, "−")):
        for name in FIELDS:
            factors = {name: np.full(n, 1 + sign * margin)}
            found.append(Perturbation(f"{name} {word}{margin:.0%}".replace("%", " %"), factors, 0.0))
        found.append(Perturbation(f"delay {word}{margin:g} periods", {}, sign * margin))
    rng = np.random.default_rng(SEED)
    for i in range(DRAWS):
        factors = {name: 1 + rng.uniform(-margin, margin, n) for name in FIELDS}
        found.append(
            Perturbation(f"draw {i + 1} of all at once", factors, float(rng.uniform(-margin, margin)))
        )
    return tuple(found)


def perturbed(problem: Problem, perturbation: Perturbation) -> Problem:
    """Return the problem with the perturbed robot in place of its own; the law knows nothing of it."""
    true = problem.law.robot.layout.unpack(problem.plant)
    changed = {
        field: (true[field].T * factor).T
        for name, factor in perturbation.factors.items()
        for field in FIELDS[name]
    }
    return altered(problem, plant=changed) if changed else problem


@dataclass(frozen=True, eq=False)
class Family:
    """The linear loops of all postures and perturbations, made once and asked for many gains.

    Attributes
    ----------
    problems: One for each posture, sampled, with the nominal robot.
    members: Number of the posture, name of the perturbation, loop, and its delay [s].
    """

    problems: tuple[Problem, ...]
    members: tuple[tuple[int, str, LinearLoop, float], ...]

    @classmethod
    def of(cls, problems: Sequence[Problem], cases: Iterable[Perturbation]) -> Family:
        """Return the family of these postures and perturbations."""
        cases = tuple(cases)
        members = []
        for i, problem in enumerate(problems):
            for case in cases:
                loop = LinearLoop(perturbed(problem, case))
                members.append((i, case.name, loop, max(loop.s.delay + case.late * loop.s.period, 0.0)))
        return cls(tuple(problems), tuple(members))

    def worst(self, gains: Mapping[str, Array]) -> Worst:
        """Return the largest radius with these gains."""
        return max(Worst(loop.radius(None, late, gains), i, name) for i, name, loop, late in self.members)

    def stable(self, gains: Mapping[str, Array]) -> bool:
        """Return whether all members are stable, without looking further than the first that is not."""
        return all(loop.radius(None, late, gains) < 1 for _, _, loop, late in self.members)
