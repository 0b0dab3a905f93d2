"""A change that would make a law hold, and whether it does: by the judge that refused."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from passiflex.errors import PassiflexError
from passiflex.problems.altered import altered, rewritten
from passiflex.problems.problem import Problem, require_sampled
from passiflex.problems.resolution import resolve
from passiflex.scenarios.scenario_file import parse_scenario
from passiflex.stability.judgement import holds, judged_fallback

INSIDE = 1.2
"""How far beyond a border a gain is offered."""


class Remedy(NamedTuple):
    """A change after which the law holds.

    Attributes
    ----------
    words: What to change, and from what.
    entry: What to write into the scenario; empty for what is no entry of it, as a tool.
    """

    words: str
    entry: Mapping[str, Any]


def tried(problem: Problem, remedy: Remedy) -> bool:
    """Return whether the judge lets the whole changed scenario pass, on the robot of the problem."""
    try:
        text = rewritten(problem.text, remedy.entry)
        changed = resolve(parse_scenario(text, "remedy"), problem.law.robot)
        if not np.array_equal(changed.plant, problem.plant):
            changed = altered(changed, plant=problem.law.robot.layout.unpack(problem.plant))
        if require_sampled(changed).allow_unstable:  # then it is the fallback that has to hold
            alone = judged_fallback(changed)
            return alone is None or alone.stable
        return holds(changed, native=False)
    except PassiflexError:
        return False
