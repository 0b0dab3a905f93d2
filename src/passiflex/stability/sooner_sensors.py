"""Whether a law would hold with a sensor that is less late."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from passiflex.problems.altered import later_sensors
from passiflex.problems.problem import SampledProblem
from passiflex.scenarios.sensor_settings import DELAYS
from passiflex.stability.judgement import holds

SHARES = (0.75, 0.5, 0.25, 0.1, 0.0)
"""Of a delay, or of the periods that are missed, that are tried."""


def deciding(problem: SampledProblem) -> Iterator[tuple[str, float]]:
    """Yield each entry of a sensor's delay, and the delay [s], without which the law holds."""
    for name, entry, late in zip(problem.lateness._fields, DELAYS, problem.lateness, strict=True):
        if late and _holds(problem, name, 0.0):
            yield entry, late


def sooner_sensors(problem: SampledProblem) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield, in words and as entries of the scenario, which sensor's delay would do: one at a time."""
    for entry, now in deciding(problem):
        for share in SHARES:
            late = float(f"{share * now:.3g}")
            if _holds(problem, entry.removesuffix("_delay"), late):
                least = f"of at most {1e3 * late:.3g} ms" if late else "of 0"
                yield f"a {entry} {least} (now {1e3 * now:.3g} ms)", {"sensors": {entry: late}}
                break


def _holds(problem: SampledProblem, name: str, late: float) -> bool:
    return holds(later_sensors(problem, problem.lateness._replace(**{name: late})), native=False)
