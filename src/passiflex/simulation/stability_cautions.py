"""What is worth a word of a loop's stability before it runs: drift that nothing damps, a law that is insisted on."""

from __future__ import annotations

from passiflex.problems.problem import Problem, SampledProblem
from passiflex.stability.admissible import SEEN, drift_words
from passiflex.stability.linear_loop import LinearLoop


def stability_cautions(problem: Problem) -> tuple[str, ...]:
    """Return a line on a self-motion that drifts on, and one on a law that runs although it does not hold."""
    if not isinstance(problem, SampledProblem):
        return ()
    loop, lines = LinearLoop(problem), []
    mode = loop.spectrum(delay=problem.delay + problem.jitter)
    if mode.undamped or mode.drift > SEEN:
        lines.append(drift_words(mode) + "; null_space_damping or actions.posture_stiffness ends it")
    if problem.allow_unstable and not mode.stable:
        lines.append(
            f"the law is allowed though it does not hold: joint {mode.joint}, {mode.frequency:.0f} Hz, "
            f"{mode.radius:.4g} per period; whatever the tank says, it trembles until it falls back"
        )
    return tuple(lines)
