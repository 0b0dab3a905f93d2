"""Scenarios, and the closed loop through time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from passiflex.lazy import lazy_names as _lazy_names

if TYPE_CHECKING:
    from passiflex.loops.closed_loop import ClosedLoop as ClosedLoop
    from passiflex.loops.compiled import CompiledLoop as CompiledLoop
    from passiflex.loops.compiled import compiled_loop as compiled_loop
    from passiflex.problems.problem import Problem as Problem
    from passiflex.problems.resolution import resolve as resolve
    from passiflex.runs.passed_limit import PassedLimit as PassedLimit
    from passiflex.runs.passed_limit import passed_limits as passed_limits
    from passiflex.runs.run import Run as Run
    from passiflex.runs.salvaged import salvage as salvage
    from passiflex.scenarios.scenario import Scenario as Scenario
    from passiflex.scenarios.scenario_file import load_scenario as load_scenario
    from passiflex.scenarios.scenario_file import parse_scenario as parse_scenario
    from passiflex.simulation.setpoint_arrays import setpoint_table as setpoint_table
    from passiflex.simulation.simulated import simulate as simulate
    from passiflex.simulation.through_time import simulate_problem as simulate_problem
    from passiflex.simulation.wrench_arrays import wrench_table as wrench_table

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
    "setpoint_table": "setpoint_arrays",
    "wrench_table": "wrench_arrays",
    "simulate": "simulated",
    "simulate_problem": "through_time",
}

__getattr__, __dir__ = _lazy_names("passiflex.simulation", _HOMES)
