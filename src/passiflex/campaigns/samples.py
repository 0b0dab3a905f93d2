"""From a campaign to the scenarios of its samples, and to scenarios at any other values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from passiflex.campaigns.campaign import Campaign
from passiflex.campaigns.distributions import Value
from passiflex.campaigns.draws import columns, draws, scenario_seed
from passiflex.campaigns.target import PathRefusedError, Target, complete_data, locate
from passiflex.errors import ScenarioError, SizeError
from passiflex.scenarios.scenario import Scenario
from passiflex.texts.model_mistakes import told

Values = dict[str, Value | tuple[Value, ...]]
"""What each parameter is: a number, word or flag; or one per joint."""


def sample_scenario(campaign: Campaign, index: int) -> Scenario:
    """Return one sample as a scenario, complete: run alone, it gives the same result as in the campaign.

    It is named after the campaign and the index, and has its own seed.

    Raises
    ------
    ValueRangeError
        For an index that is none of the campaign's.
    ScenarioError
        If the values that were drawn do not go together in one scenario.
    """
    values = values_of_row(campaign, draws(campaign, [index])[0])
    name = f"{campaign.name}_{index}"
    return _scenario(campaign.data, campaign.targets, values, name, scenario_seed(campaign, index))


def values_of_row(campaign: Campaign, row: NDArray[np.float64]) -> Values:
    """Return what a row of the draws stands for: words for their indices, the numbers of all joints together.

    Raises
    ------
    SizeError
        If the row has not one number for each column.
    """
    numbers = np.asarray(row, dtype=float)
    if numbers.shape != (needed := (len(columns(campaign)),)):
        raise SizeError(f"row of campaign {campaign.name!r}", got=numbers.shape, needs=str(needed))
    drawn = iter(numbers.tolist())
    return {
        path: tuple(parameter.value(next(drawn)) for _ in range(campaign.joints))
        if parameter.per
        else parameter.value(next(drawn))
        for path, parameter in campaign.parameters.items()
    }


def with_values(subject: Campaign | Scenario, values: Mapping[str, Any]) -> Scenario:
    """Return the scenario with other values at some paths, which need not be parameters of the campaign.

    Parameters
    ----------
    subject: A scenario, or a campaign whose scenario is meant. Name and seed stay.
    values: As a scenario file would have them at each path: numbers, text with units, words, lists.

    Raises
    ------
    ScenarioError
        If a path leads nowhere, or there is no scenario with these values; with one line for each mistake.
    """
    data, known = (
        (complete_data(subject), {}) if isinstance(subject, Scenario) else (subject.data, subject.targets)
    )
    targets, mistakes = {}, []
    for path in values:
        try:
            targets[path] = known[path] if path in known else locate(data, path)
        except PathRefusedError as error:
            mistakes.append(f"{path}: {error}")
    if mistakes:
        raise ScenarioError("values", mistakes)
    return _scenario(data, targets, values, data["name"], data["seed"])


def _scenario(
    data: dict[str, Any], targets: Mapping[str, Target], values: Mapping[str, Any], name: str, seed: int
) -> Scenario:
    for path, value in values.items():
        data = targets[path].put(data, value)
    data = data | {"name": name, "seed": seed}
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        raise ScenarioError(f"scenario {name!r}", told(error, data, Scenario)) from None
