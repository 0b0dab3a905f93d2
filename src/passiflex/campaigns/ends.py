"""The scenarios at the ends of every parameter, and what is impossible about them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from pydantic import ValidationError

from passiflex.campaigns.distributions import AbstractDistribution, Value
from passiflex.campaigns.target import Target
from passiflex.scenarios.scenario import Scenario
from passiflex.texts.model_mistakes import explained
from passiflex.texts.yaml_tree import Place, dotted

Parameters = Mapping[str, AbstractDistribution]
Targets = Mapping[str, Target]


def whole(parameter: AbstractDistribution, value: Value, joints: int) -> Value | tuple[Value, ...]:
    """Return what a parameter writes into the scenario when all it draws is one value."""
    return (value,) * joints if parameter.per else value


def median(parameter: AbstractDistribution) -> Value:
    """Return the value at the middle of a distribution."""
    return parameter.value(float(parameter.quantile(0.5)))


class Trial(NamedTuple):
    """A scenario in which one parameter is at an end, and the others at their medians."""

    path: str
    place: Place
    data: dict[str, Any]


def trials(
    parameters: Mapping[str, AbstractDistribution], targets: Targets, data: dict[str, Any]
) -> Iterator[Trial]:
    """Yield the scenarios at the ends of every parameter; the place is that of the end in its distribution."""
    joints = len(data["posture"])
    for path, parameter in parameters.items():
        others = data
        for name, other in parameters.items():
            if name != path:
                others = targets[name].put(others, whole(other, median(other), joints))
        for place, value in parameter.ends():
            yield Trial(path, place, targets[path].put(others, whole(parameter, value, joints)))


def at_medians(
    parameters: Mapping[str, AbstractDistribution], targets: Targets, data: dict[str, Any]
) -> dict[str, Any]:
    """Return the data with every parameter at its median."""
    for path, parameter in parameters.items():
        data = targets[path].put(data, whole(parameter, median(parameter), len(data["posture"])))
    return data


def scenario_mistakes(data: dict[str, Any]) -> list[tuple[Place, str]]:
    """Return what the scenario with this data has wrong, each mistake with its place."""
    try:
        Scenario.model_validate(data)
    except ValidationError as error:
        return [(place, message) for place, message, _ in explained(error, data, Scenario)]
    return []


def impossible(parameters: Parameters, targets: Targets, data: dict[str, Any]) -> Iterator[tuple[Place, str]]:
    """Yield what is wrong with the scenario at the medians, or else with those at the ends of each parameter."""
    together = scenario_mistakes(at_medians(parameters, targets, data))
    for place, message in together:
        blamed = [path for path in parameters if (place, message) in _alone(path, parameters, targets, data)]
        blamed = blamed[:1] or _nearest(place, targets)
        what = "with every parameter at its median"
        yield tuple(blamed), f"{what}: {dotted(place)}: {message}"
    for path, end, tried in () if together else trials(parameters, targets, data):
        for place, message in scenario_mistakes(tried):
            yield (path, *end), f"no scenario with this value: {dotted(place)}: {message}"


def _alone(
    path: str, parameters: Parameters, targets: Targets, data: dict[str, Any]
) -> list[tuple[Place, str]]:
    """Return what is wrong with the scenario when only this parameter is at its median."""
    return scenario_mistakes(at_medians({path: parameters[path]}, targets, data))


def _nearest(place: Place, targets: Targets) -> list[str]:
    """Return the parameter that leads nearest to a place of the scenario, if any leads near it."""

    def shared(path: str) -> int:
        pairs = list(zip(targets[path].place, place, strict=False))
        return next((i for i, (a, b) in enumerate(pairs) if a != b), len(pairs))

    best = max(targets, key=shared, default=None)
    return [best] if best is not None and shared(best) else []
