"""Scenarios, and the closed loop through time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from passiflex.lazy import lazy_names as _lazy_names

if TYPE_CHECKING:
    from passiflex.simulation.closed_loop import ClosedLoop as ClosedLoop
    from passiflex.simulation.compiled import CompiledLoop as CompiledLoop
    from passiflex.simulation.compiled import compiled_loop as compiled_loop
    from passiflex.simulation.passed_limit import PassedLimit as PassedLimit
    from passiflex.simulation.passed_limit import passed_limits as passed_limits
    from passiflex.simulation.problem import Problem as Problem
    from passiflex.simulation.resolution import resolve as resolve
    from passiflex.simulation.run import Run as Run
    from passiflex.simulation.salvaged import salvage as salvage
    from passiflex.simulation.scenario import Scenario as Scenario
    from passiflex.simulation.scenario_file import load_scenario as load_scenario
    from passiflex.simulation.scenario_file import parse_scenario as parse_scenario
    from passiflex.simulation.through_time import simulate_problem as simulate_problem

_HOMES = {
    "ClosedLoop": "closed_loop",
    "CompiledLoop": "compiled",
    "PassedLimit": "passed_limit",
    "Problem": "problem",
    "Run": "run",
    "Scenario": "scenario",
    "compiled_loop": "compiled",
    "load_scenario": "scenario_file",
    "parse_scenario": "scenario_file",
    "passed_limits": "passed_limit",
    "resolve": "resolution",
    "salvage": "salvaged",
    "simulate_problem": "through_time",
}

__getattr__, __dir__ = _lazy_names("passiflex.simulation", _HOMES)


def simulate(scenario: Scenario | Mapping[str, Any] | str | Path) -> Run:
    """Return the run of a scenario, of a mapping with the entries of a scenario file, or of the file at a path.

    A run that leaves the finite numbers is a result too; it ends there, and `Run.failure` says why.

    Raises
    ------
    PassiflexError
        If the scenario has mistakes or does not fit its robot.
    """
    from passiflex.simulation.resolution import resolve
    from passiflex.simulation.scenario_file import as_scenario
    from passiflex.simulation.through_time import simulate_problem

    return simulate_problem(resolve(as_scenario(scenario)))
