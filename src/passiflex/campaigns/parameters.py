"""The parameters of a campaign: each leads to an entry of the scenario, fits it, and gives possible scenarios."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from pydantic import ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from passiflex.campaigns.distributions import AbstractDistribution, Choice, Refused
from passiflex.campaigns.ends import impossible
from passiflex.campaigns.target import PathRefusedError, Target, locate
from passiflex.texts.model_mistakes import REFUSED_NAME, word
from passiflex.texts.quantity import Quantity, shown
from passiflex.texts.section import Mistakes
from passiflex.texts.yaml_tree import Place

Parameters = dict[str, AbstractDistribution]
Targets = dict[str, Target]

_NUMBERS = ("low", "high", "mean", "deviation")


def checked(written: Any, data: dict[str, Any], validate: Callable[[Any], Parameters]) -> Parameters:
    """Return the parameters of the scenario with this data, numbers in the units of its fields.

    Parameters
    ----------
    written: As in a campaign file: a distribution for each path.
    validate: Makes distributions of mappings whose numbers have no units.

    Raises
    ------
    ValidationError
        With all mistakes: those of paths and distributions, or else those of the scenarios that they give.
    """
    if not isinstance(written, dict):
        return validate(written)
    refused: list[InitErrorDetails] = []
    targets: Targets = {}
    for path in written:
        try:
            targets[path] = locate(data, str(path))
        except PathRefusedError as mistake:
            kind = PydanticCustomError(REFUSED_NAME, str(mistake))
            refused.append({"type": kind, "loc": (path,), "input": written[path]})
    parameters: Parameters = {}
    for path, target in targets.items():  # one by one: the mistakes of one do not hide those of another
        try:
            parameters |= validate({path: _converted(written[path], target)})
        except ValidationError as error:
            refused += [
                {"type": e["type"], "loc": e["loc"], "input": e["input"], "ctx": e.get("ctx", {})}
                for e in error.errors(include_url=False)
            ]
    found = list(_unfitting(parameters, targets)) + list(_overlapping(targets))
    if not refused and not found:
        found = list(impossible(parameters, targets, data))
    if found:
        refused.append(
            {"type": "value_error", "ctx": {"error": Mistakes(*found)}, "loc": (), "input": written}
        )
    if refused:
        raise ValidationError.from_exception_data("parameters", refused)
    return parameters


def _converted(written: Any, target: Target) -> Any:
    """Return a distribution as it is written, but its values as the entry takes them, or Refused."""
    if isinstance(written, AbstractDistribution):
        written = written.model_dump(exclude_none=True)
    if not isinstance(written, dict):
        return written
    converted = dict(written)
    if target.quantity is not None:
        quantity = replace(target.quantity, shapes=((),), above=None, least=None, most=None, finite=True)
        for name in _NUMBERS:
            if converted.get(name) is not None:
                converted[name] = _quantity(converted[name], quantity)
    if isinstance(converted.get("values"), list | tuple):
        converted["values"] = [_choice(value, target) for value in converted["values"]]
    return converted


def _quantity(written: Any, quantity: Quantity) -> Any:
    try:
        return quantity.convert(written)
    except ValueError as mistake:
        return Refused(str(mistake))


def _choice(written: Any, target: Target) -> Any:
    if target.quantity is not None:
        return _quantity(written, replace(target.quantity, shapes=((),), above=None, least=None, most=None))
    if target.words:
        return written if written in target.words else Refused(word(written, target.words))
    return written if isinstance(written, bool) else Refused(f"expected true or false; got {shown(written)}")


def _unfitting(parameters: Parameters, targets: Targets) -> Iterator[tuple[Place, str]]:
    for path, parameter in parameters.items():
        target = targets[path]
        if target.quantity is None and not isinstance(parameter, Choice):
            what = "a word" if target.words else "true or false"
            yield (path, "distribution"), f"{path} is {what}; take distribution: choice"
        if parameter.per and not target.per_joint:
            yield (path, "per"), f"{path} has one value, not one per joint; remove it"
        yield from _endless(path, parameter, target.quantity)
        yield from _beyond(path, parameter, target)
        if not parameter.per and not target.alone:
            yield (path,), f"is a list of numbers; add per: joint, or which one of them: {path}.1"


def _overlapping(targets: Targets) -> Iterator[tuple[Place, str]]:
    paths = list(targets)
    for i, path in enumerate(paths):
        for other in paths[:i]:
            if targets[path].overlaps(targets[other]):
                yield (path,), f"overlaps with {other}: both set the same entry of the scenario; remove one"


def _endless(
    path: str, parameter: AbstractDistribution, quantity: Quantity | None
) -> Iterator[tuple[Place, str]]:
    """Yield the ends that the field of a parameter has, and its distribution has not."""
    if quantity is None or isinstance(parameter, Choice):
        return
    low, high = parameter.support
    least = quantity.least if quantity.above is None else quantity.above
    for name, open_end, limit, sign in (
        ("low", low == -float("inf"), least, ">" if quantity.above is not None else "≥"),
        ("high", high == float("inf"), quantity.most, "≤"),
    ):
        if open_end and limit is not None:
            side = "below" if name == "low" else "above"
            yield (
                (path,),
                f"has no end {side}, and the scenario takes numbers {sign} {limit:g} only; give `{name}: …`",
            )


def _beyond(path: str, parameter: AbstractDistribution, target: Target) -> Iterator[tuple[Place, str]]:
    """Yield the ends that are out of the bounds of the entry."""
    if target.quantity is None or len(target.indices) > 1:  # entries of matrices have no bounds
        return
    one = replace(target.quantity, shapes=((),))
    for place, value in parameter.ends():
        mistake = _quantity(value, one)
        if place and isinstance(mistake, Refused):
            yield (path, *place), mistake.message
