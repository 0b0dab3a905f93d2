"""The part of a problem that fails, and whether it would hold with other gains, another clock, or less delay."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from passiflex.problems.problem import Problem
from passiflex.stability.judgement import Case, Judgement, fallback_cases, law_cases
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.missed import dies_out

Array = NDArray[np.float64]
Gains = Mapping[str, Array]
Change = Callable[[dict[str, Array]], Gains]
"""From all gains to those that are to be tried."""


class Trial:
    """The part of a problem that fails, and whether it would hold with other gains."""

    def __init__(self, problem: Problem, found: Judgement):
        self.problem, self.found = problem, found
        self.loop = LinearLoop(problem)
        cases = fallback_cases(self.loop) if found.part == "fallback" else law_cases(self.loop)
        self.cases: list[Case] = list(cases)
        self.shapes = problem.law.shapes
        model = problem.law.robot.layout.unpack(problem.model)
        self.own_inertia, self.own_stiffness = model["motor_inertia"], model["joint_stiffness"]

    @property
    def gains(self) -> dict[str, Array]:
        """Return the gains of the first case."""
        return self.gains_of(self.cases[0])

    def gains_of(self, case: Case) -> dict[str, Array]:
        """Return all gains of a case."""
        own = self.problem.law.layout.unpack(self.problem.gains)
        return own | {name: np.asarray(value) for name, value in case.gains.items()}

    def stable(
        self,
        change: Change = lambda g: g,
        *,
        stretched: float = 1.0,
        late: float | None = None,
        missed: float | None = None,
    ) -> bool:
        """Return whether all cases hold with changed gains, another clock, delay or share of missed periods."""
        share = self.loop.problem.missed if missed is None else missed
        T = self.loop.problem.period * stretched
        for case in self.cases:
            gains = change(self.gains_of(case))
            delay = (case.delay if late is None else late) * stretched
            if not case.loop.radius(T, delay, gains) < 1:
                return False
            if share and stretched == 1 and not dies_out(case.loop, share, delay, gains):
                return False
        return True
