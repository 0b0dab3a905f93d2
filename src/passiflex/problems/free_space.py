"""The same problem with nothing to run into."""

from __future__ import annotations

import dataclasses

from passiflex.elements.end_stops import EndStops
from passiflex.elements.surface import Surface
from passiflex.problems.problem import SampledProblem


def in_free_space(problem: SampledProblem) -> SampledProblem:
    """Return the problem without surfaces and end stops, for a law that is judged where the robot does not start.

    Beside the start a robot may be within one, and pressed by it: that is no rest, and says nothing of the law.
    """
    kept = tuple(e for e in problem.elements if not isinstance(e, Surface | EndStops))
    if len(kept) == len(problem.elements):
        return problem
    free = dataclasses.replace(problem, elements=kept)
    values = {part: problem.parts.unpack(part, problem.numbers) for part in free.parts.layouts}
    values["plant"] = {f.name: values["plant"][f.name] for f in free.parts["plant"]}
    return dataclasses.replace(free, numbers=free.parts.pack(values))
