"""What the books of a law do not know in a problem, in words: who is blamed for what they miss."""

from __future__ import annotations

import numpy as np

from passiflex.problems.problem import Problem, SampledProblem
from passiflex.sampled.said import SaysLess

UNKNOWN = "model error and noise"
"""Of a run that does not say what was in it."""
NOTHING = "the law's own books"
"""Where everything is as the law believes."""


def unbooked(problem: Problem) -> str:
    """Return what the law's books miss: only what is there.

    The rigid law shapes the inertia of the end effector, which no storage of its own accounts for; without
    the force on it that is not even a passive wish. It measures no joint torque, so that noise is none of it.
    """
    s, own = problem if isinstance(problem, SampledProblem) else None, problem.law.unbooked
    causes = []
    if own:
        blind = s is not None and s.controller.external.blind
        causes.append(own + " without force sensing" * blind)
    elif s is not None:
        causes.append("sampling")
    if not np.array_equal(problem.plant[: problem.model.size], problem.model):
        causes.append("model error")
    noise = problem.noise
    if noise is not None and (noise.moves or (noise.variance > 0 and not own)):
        causes.append("noise")
    if s is not None and any(isinstance(e, SaysLess) and e.guesses for e in s.effects):
        causes.append("joint torques that nobody measures")
    causes += [e.unknown for e in problem.elements if e.acts and e.unknown]
    return listed(causes) or NOTHING


def listed(words: list[str], last: str = "and") -> str:
    """Return words as people list them: a, b and c."""
    return f" {last} ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else "".join(words)
