"""The scenario that a run carries as its text, parsed once however often it is asked for."""

from __future__ import annotations

from functools import lru_cache

from passiflex.errors import ScenarioError
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.scenario_file import parse_scenario


@lru_cache(maxsize=64)
def scenario_of_text(text: str) -> Scenario | None:
    """Return the scenario of a text; None if it is none.

    A file that it names is not opened: whoever made the run may have named any.
    """
    try:
        return parse_scenario(text, source="the run's scenario", opens=False)
    except ScenarioError:
        return None
