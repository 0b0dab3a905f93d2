"""Scenarios, and the closed loop through time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from passiflex.lazy import lazy_names as _lazy_names

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from passiflex.control.law import AbstractLaw
    from passiflex.loops.closed_loop import ClosedLoop as ClosedLoop
    from passiflex.loops.compiled import CompiledLoop as CompiledLoop
    from passiflex.loops.compiled import compiled_loop as compiled_loop
    from passiflex.loops.elements import AbstractElement
    from passiflex.problems.problem import Problem as Problem
    from passiflex.problems.resolution import resolve as resolve
    from passiflex.runs.passed_limit import PassedLimit as PassedLimit
    from passiflex.runs.passed_limit import passed_limits as passed_limits
    from passiflex.runs.run import Run as Run
    from passiflex.runs.salvaged import salvage as salvage
    from passiflex.sampled.tank import AbstractTank
    from passiflex.scenarios.scenario import Scenario as Scenario
    from passiflex.scenarios.scenario_file import load_scenario as load_scenario
    from passiflex.scenarios.scenario_file import parse_scenario as parse_scenario
    from passiflex.simulation.through_time import simulate_problem as simulate_problem

_HOMES = {
    "ClosedLoop": ".loops.closed_loop",
    "CompiledLoop": ".loops.compiled",
    "PassedLimit": ".runs.passed_limit",
    "Problem": ".problems.problem",
    "Run": ".runs.run",
    "Scenario": ".scenarios.scenario",
    "compiled_loop": ".loops.compiled",
    "load_scenario": ".scenarios.scenario_file",
    "parse_scenario": ".scenarios.scenario_file",
    "passed_limits": ".runs.passed_limit",
    "resolve": ".problems.resolution",
    "salvage": ".runs.salvaged",
    "simulate_problem": "through_time",
}

__getattr__, __dir__ = _lazy_names("passiflex.simulation", _HOMES)


def simulate(
    scenario: Scenario | Mapping[str, Any] | str | Path,
    *,
    law: AbstractLaw | None = None,
    gains: Mapping[str, ArrayLike] | None = None,
    tank: AbstractTank | None = None,
    elements: Sequence[AbstractElement] = (),
) -> Run:
    """Return the run of a scenario, of a mapping with the entries of a scenario file, or of the file at a path.

    A run that leaves the finite numbers is a result too; it ends there, and `Run.failure` says why.

    Parameters
    ----------
    law, gains, tank, elements: Parts of your own, as `problems.own_parts.with_parts` takes them.

    Raises
    ------
    PassiflexError
        If the scenario has mistakes or does not fit its robot, or parts do not fit the scenario.
    """
    from passiflex.problems.own_parts import with_parts
    from passiflex.problems.resolution import resolve
    from passiflex.scenarios.scenario_file import as_scenario
    from passiflex.simulation.through_time import simulate_problem

    problem = resolve(as_scenario(scenario))
    return simulate_problem(with_parts(problem, law=law, gains=gains, tank=tank, elements=elements))
