"""What a limit map is asked about, as a sampled problem: a scenario, its file, or a problem."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from passiflex.errors import ValueRangeError
from passiflex.problems.altered import HIGHEST_RATE, altered, at_rate
from passiflex.problems.problem import SampledProblem, require_sampled
from passiflex.scenarios.events import turning
from passiflex.scenarios.path import ViaPath
from passiflex.scenarios.scenario_file import as_scenario
from passiflex.scenarios.setpoints import Table
from passiflex.simulation import Problem, Scenario, parse_scenario, resolve
from passiflex.texts.quantity import Quantity, shown

Subject = Problem | Scenario | Mapping[str, Any] | str | Path
"""A problem, a scenario, a mapping with the entries of a scenario file, or the path of one."""

GAINS = ("stiffness", "damping", "target_inertia")
"""That have a part for translation and one for rotation."""
RATE = Quantity("Hz", above=0, most=HIGHEST_RATE)
DELAY = Quantity("s", least=0)


def sampled_problem(
    subject: Subject,
    rate: float | str | None = None,
    delay: float | str | None = None,
    *,
    task: str | None = None,
    inner_loop: str | None = None,
) -> SampledProblem:
    """Return the problem at a rate [Hz] and delay [s], its own unless given; text may name a unit, as "1 kHz".

    A scenario or problem in continuous time becomes a sampled one, with the plain inner loop unless another is given.

    Raises
    ------
    ValueRangeError
        If there is no rate, or what is given is no rate or delay.
    PassiflexError
        If the scenario has mistakes, or does not fit its robot, the task or the inner loop.
    """
    hertz = None if rate is None else number("rate", rate, RATE)
    late = None if delay is None else number("delay", delay, DELAY)
    robot = None
    if isinstance(subject, Problem):
        if isinstance(subject, SampledProblem) and task is None and inner_loop is None:
            return altered(subject, rate=hertz, delay=late)
        robot = subject.law.robot
        subject = parse_scenario(subject.text)
    scenario = as_scenario(subject)
    if task is not None:
        scenario = with_task(scenario, task)
    scenario = at_rate(scenario, hertz, late)
    if inner_loop is not None:
        scenario = scenario.changed({"control.inner_loop": inner_loop})
    return require_sampled(resolve(scenario, robot))


def with_task(scenario: Scenario, task: str) -> Scenario:
    """Return the scenario with another task of its law; of a pose, a position keeps what it has of translation."""
    changes: dict[str, Any] = {"law.task": task}
    if task == "position":
        places: list[tuple[str, Any]] = [("law", scenario.law)]
        if scenario.control is not None:
            places.append(("control.fallback", scenario.control.fallback))
        places += [(f"gain_changes[{i}]", change) for i, change in enumerate(scenario.gain_changes)]
        for place, section in places:
            for name in GAINS:
                gains = getattr(section, name, None)
                if gains is not None and gains.rotation is not None:
                    changes[f"{place}.{name}.rotation"] = None
                if gains is not None and gains.matrix is not None:
                    changes[f"{place}.{name}.matrix"] = [row[:3] for row in gains.matrix[:3]]
        several = [event for event in scenario.reference if isinstance(event, ViaPath | Table)]
        if any(turning(event) for event in several):  # on what the reference does no limit depends
            changes["reference"] = None
        else:
            for i, event in enumerate(scenario.reference):
                changes |= {f"reference[{i}].{place[0]}": None for place in turning(event)}
    return scenario.changed(changes)


EXAMPLES = {
    "1": "a share, as 0.2 or '20 %'",
    "Hz": "text with its unit, as '1 kHz'",
    "s": "text with its unit, as '1 ms'",
}
"""How numbers of a unit may be written."""


def number(name: str, written: float | str, quantity: Quantity) -> float:
    """Return what was written as a number in the quantity's unit.

    Raises
    ------
    ValueRangeError
        If it is none, or out of bounds.
    """
    try:
        value = quantity.convert(written)
    except ValueError as mistake:
        try_ = EXAMPLES.get(quantity.unit, f"a number in {quantity.unit}")
        raise ValueRangeError(name, got=shown(written), needs=quantity.words, try_=try_) from mistake
    assert isinstance(value, float)
    return value
