"""What a limit map is asked about, as a sampled problem: a scenario, its file, or a problem."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from passiflex.errors import ValueRangeError
from passiflex.simulation import Problem, Scenario, parse_scenario, resolve
from passiflex.simulation.altered import HIGHEST_RATE, altered, at_rate
from passiflex.simulation.scenario_file import as_scenario
from passiflex.texts.quantity import Quantity

Subject = Problem | Scenario | Mapping[str, Any] | str | Path
"""A problem, a scenario, a mapping with the entries of a scenario file, or the path of one."""

RATE = Quantity("Hz", above=0, most=HIGHEST_RATE)
DELAY = Quantity("s", least=0)


def sampled_problem(
    subject: Subject, rate: float | str | None = None, delay: float | str | None = None
) -> Problem:
    """Return the problem at a rate [Hz] and delay [s], its own unless given; text may name a unit, as "1 kHz".

    A scenario or problem in continuous time becomes a sampled one with the plain inner loop.

    Raises
    ------
    ValueRangeError
        If there is no rate, or what is given is no rate or delay.
    PassiflexError
        If the scenario has mistakes, or does not fit its robot.
    """
    hertz = None if rate is None else number("rate", rate, RATE)
    late = None if delay is None else number("delay", delay, DELAY)
    if isinstance(subject, Problem):
        if subject.sampling is not None:
            return altered(subject, rate=hertz, delay=late)
        return resolve(at_rate(parse_scenario(subject.configuration), hertz, late), subject.law.robot)
    return resolve(at_rate(as_scenario(subject), hertz, late))


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
        raise ValueRangeError(
            name, got=repr(written), needs=quantity.words, try_="text with a unit, as '1 kHz' or '1 ms'"
        ) from mistake
    assert isinstance(value, float)
    return value
