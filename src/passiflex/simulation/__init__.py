"""Scenarios, and the closed loop through time."""

from pathlib import Path

from passiflex.simulation.closed_loop import ClosedLoop as ClosedLoop
from passiflex.simulation.compiled import CompiledLoop as CompiledLoop
from passiflex.simulation.compiled import compiled_loop as compiled_loop
from passiflex.simulation.passed_limits import PassedLimit as PassedLimit
from passiflex.simulation.passed_limits import passed_limits as passed_limits
from passiflex.simulation.problem import Problem as Problem
from passiflex.simulation.resolve import resolve as resolve
from passiflex.simulation.run import Run as Run
from passiflex.simulation.salvage import salvage as salvage
from passiflex.simulation.scenario import Scenario as Scenario
from passiflex.simulation.scenario_file import load_scenario as load_scenario
from passiflex.simulation.scenario_file import parse_scenario as parse_scenario
from passiflex.simulation.simulate import simulate as simulate_problem


def simulate(scenario: Scenario | str | Path) -> Run:
    """Return the run of a scenario, or of the scenario file at a path.

    A run that leaves the finite numbers is a result too; it ends there, and `Run.failure` says why.

    Raises
    ------
    PassiflexError
        If the scenario has mistakes or does not fit its robot.
    """
    return simulate_problem(resolve(scenario if isinstance(scenario, Scenario) else load_scenario(scenario)))
