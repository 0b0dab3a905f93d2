"""The run of a scenario, with parts of one's own if there are any."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from passiflex.control.law import AbstractLaw
from passiflex.elements import AbstractElement
from passiflex.engines.engine import NATIVE
from passiflex.problems.own_parts import with_parts
from passiflex.problems.resolution import resolve
from passiflex.runs.run import Run
from passiflex.sampled.sensors import AbstractSensorEffect
from passiflex.sampled.tank import AbstractTank
from passiflex.scenarios.path import ViaPath
from passiflex.scenarios.reference import AbstractReferenceEvent
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.scenario_file import as_scenario
from passiflex.scenarios.setpoints import Table
from passiflex.simulation.through_time import simulate_problem


def simulate(
    scenario: Scenario | Mapping[str, Any] | str | Path,
    *,
    law: AbstractLaw | None = None,
    gains: Mapping[str, ArrayLike] | None = None,
    tank: AbstractTank | None = None,
    elements: Sequence[AbstractElement] = (),
    sensors: Sequence[AbstractSensorEffect] = (),
    reference: Sequence[AbstractReferenceEvent] | AbstractReferenceEvent = (),
    engine: str = NATIVE.name,
) -> Run:
    """Return the run of a scenario, of a mapping with the entries of a scenario file, or of the file at a path.

    A run that leaves the finite numbers is a result too; it ends there, and `Run.failure` says why.

    Parameters
    ----------
    law, gains, tank, elements, sensors, reference: Parts of your own, as `problems.own_parts.with_parts` takes them.
        A table of set-points and a path become part of the scenario, which then gives the same run again.
    engine: Who moves the plant of a sampled run: "passiflex", or "mujoco" with the extra of this name.

    Raises
    ------
    PassiflexError
        If the scenario has mistakes or does not fit its robot, or parts do not fit the scenario.
    """
    given = as_scenario(scenario)
    reference = [reference] if isinstance(reference, AbstractReferenceEvent) else reference
    known: list[
        AbstractReferenceEvent
    ] = []  # what a scenario can write down, so that the run can be made again
    if isinstance(reference, Sequence):
        known = [event for event in reference if isinstance(event, ViaPath | Table)]
        reference = [event for event in reference if not isinstance(event, ViaPath | Table)]
    if known:
        given = given.changed(reference=sorted([*given.reference, *known], key=lambda event: event.at))
    problem = resolve(given)
    own = with_parts(
        problem, law=law, gains=gains, tank=tank, elements=elements, sensors=sensors, reference=reference
    )
    return simulate_problem(own, engine)
