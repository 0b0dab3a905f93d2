"""Where a dotted path leads in a scenario: the field, what it takes, and how a value is put there."""

from __future__ import annotations

import re
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

from pydantic.fields import FieldInfo

from passiflex.robots.catalogue import read_description
from passiflex.scenarios.scenario import Scenario
from passiflex.texts.model_mistakes import (
    Model,
    fields,
    former_names,
    models,
    suggested,
    tag_field,
    with_entries,
)
from passiflex.texts.quantity import Quantity

_INDEX = re.compile(r"[1-9][0-9]{0,5}")


class PathRefusedError(ValueError):
    """A path leads to nothing in a scenario that a campaign could vary."""


@dataclass(frozen=True)
class Target:
    """An entry of a scenario that takes a number, a word or a flag.

    Parameters
    ----------
    place: Names and indices from 0 that lead to the entry.
    indices: The last ones of them, into the numbers of one field.
    numbers: The numbers that the field has when the scenario does not write a list: its default, or one per joint.
    quantity: What the field takes if it is a quantity.
    words: What it takes if it is a word. A field that is neither takes true or false.
    alone, per_joint: Whether the entry takes one value, and one per joint.
    """

    place: tuple[str | int, ...]
    indices: tuple[int, ...] = ()
    numbers: tuple[float, ...] = ()
    quantity: Quantity | None = None
    words: tuple[str, ...] = ()
    alone: bool = True
    per_joint: bool = False

    def overlaps(self, other: Target) -> bool:
        """Return whether a value put here would also be a value put there."""
        shared = min(len(self.place), len(other.place))
        return self.place[:shared] == other.place[:shared]

    def put(self, data: dict[str, Any], value: Any) -> dict[str, Any]:
        """Return a copy of the scenario's data with the value; what is not on the way to it is shared."""
        depth = len(self.place) - len(self.indices)
        copy: Any = dict(data)
        inner: Any = copy
        for i, part in enumerate(self.place[:-1]):
            below = inner[part] if isinstance(part, int) else inner.get(part)
            if i + 1 == depth and not isinstance(below, list | tuple):
                below = self.numbers
            inner[part] = dict(below or {}) if not isinstance(below, list | tuple) else list(below)
            inner = inner[part]
        inner[self.place[-1]] = value
        return copy


def complete_data(scenario: Scenario) -> dict[str, Any]:
    """Return the data of a scenario, from which it can be validated again."""
    return scenario.model_dump(by_alias=True, exclude_none=True)


def locate(data: dict[str, Any], path: str) -> Target:
    """Return where a path leads in the data of a scenario, as `Scenario.model_dump(by_alias=True)` gives it.

    The parts of a path are names as in a scenario file, and positions in a list counted from 1. A section
    that the scenario leaves out is looked up all the same: `Target.put` creates it.

    Raises
    ------
    PathRefusedError
        For a name that is unknown, with the nearest one; a position beyond a list; an entry that is no number,
        word or flag.
    """
    here: tuple[Model, ...] = (Scenario,)
    value: Any = data
    parts = path.split(".")
    place: list[str | int] = []
    for i, part in enumerate(parts):
        before = ".".join(parts[:i])
        if isinstance(value, list | tuple):  # of sections
            place.append(_index(part, value, before))
            value = value[_index(part, value, before)]
            continue
        known = {k: f for m in _decided(here, value) for k, f in fields(m).items()}
        part = {k: n for m in _decided(here, value) for k, n in former_names(m).items()}.get(part, part)
        if part not in known:
            message = suggested(part, known)
            raise PathRefusedError(
                f"unknown name {part!r}" + (f" in {before}" if before else "") + f"; {message}"
            )
        place.append(part)
        field = known[part]
        value = value.get(part) if isinstance(value, dict) else None
        here = tuple(models(field.annotation))
        if not here or _is_numbers(value):
            return _entry(
                field, value, tuple(place), path, parts[i + 1 :], joints_of(data["posture"], data["robot"])
            )
        if value is None and typing.get_origin(field.annotation) is tuple:
            value = ()
    if isinstance(value, list | tuple):
        raise PathRefusedError(
            f"is a list; add which entry, from 1, and the name of a number in it: {path}.1.…"
        )
    names = [k for m in _decided(here, value) for k in fields(m)]
    raise PathRefusedError(f"is a mapping; add the name of a number in it: {', '.join(names)}")


def joints_of(posture: Any, robot: str) -> int:
    """Return the number of joints of a scenario, whose posture may be a pose."""
    return len(posture) if isinstance(posture, list | tuple) else read_description(robot).chain.n


def _is_numbers(value: Any) -> bool:
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(v, int | float) for v in value)


def _decided(found: tuple[Model, ...], value: Any) -> tuple[Model, ...]:
    """Return the branch of a union that the scenario takes; all of them where it leaves the section out."""
    if len(found) < 2 or not isinstance(value, dict):
        return found
    if not any(map(tag_field, found)):
        return with_entries(found, value)
    return tuple(m for m in found if value.get(name := tag_field(m) or "") in _words(fields(m)[name]))


def _entry(
    field: FieldInfo, value: Any, place: tuple[str | int, ...], path: str, rest: list[str], joints: int
) -> Target:
    quantity = next(_quantities(field), None)
    if quantity is None:
        if rest:
            raise PathRefusedError(f"there is nothing in {'.'.join(map(str, path.split('.')[: -len(rest)]))}")
        if place == ("seed",):
            raise PathRefusedError("every sample has its own seed, from that of the campaign; remove it")
        words = _words(field)
        if words or field.annotation is bool:
            return Target(place, words=words)
        raise PathRefusedError(f"is not a number: {field.description}")
    shapes, numbers = quantity.shapes, tuple[float, ...]()
    if value is None and not field.is_required():
        value = field.default
        numbers = value if isinstance(value, tuple) else ()
    if rest and (None,) in shapes and isinstance(value, int | float):
        value = numbers = (value,) * joints
    if rest and not isinstance(value, list | tuple):
        entry = ".".join(path.split(".")[: -len(rest)])
        if shapes == ((),):
            raise PathRefusedError(f"there is nothing in {entry}: it is one number")
        what = "one number" if value is not None else "left out"
        raise PathRefusedError(
            f"{entry} is {what} in the scenario; write a list there, or remove {rest[0]!r}"
        )
    indices: list[int] = []
    for i, part in enumerate(rest):
        before = ".".join(path.split(".")[: len(place) + i])
        if not isinstance(value, list | tuple):
            raise PathRefusedError(f"there is nothing in {before}")
        indices.append(_index(part, value, before))
        value = value[indices[-1]]
    alone = isinstance(value, int | float) if rest else () in shapes
    per_joint = not rest and (None,) in shapes
    if not alone and not per_joint:
        raise PathRefusedError(f"is a list of numbers; add which one, from 1: {path}.1")
    return Target((*place, *indices), tuple(indices), numbers, quantity, (), alone, per_joint)


def _index(part: str, entries: list[Any] | tuple[Any, ...], before: str) -> int:
    if _INDEX.fullmatch(part) and int(part) <= len(entries):
        return int(part) - 1
    has = f"has entries 1 to {len(entries)}" if entries else "is empty in the scenario"
    raise PathRefusedError(f"{before} {has}; got {part!r}")


def _quantities(field: FieldInfo) -> Iterator[Quantity]:
    """Yield the quantities that a field mentions, its own or, where it may be left out, that of its value."""
    yield from (m for m in field.metadata if isinstance(m, Quantity))
    for part in typing.get_args(field.annotation):
        yield from (m for m in getattr(part, "__metadata__", ()) if isinstance(m, Quantity))


def _words(field: FieldInfo) -> tuple[str, ...]:
    """Return the words that a field allows."""
    options = (field.annotation, *typing.get_args(field.annotation))
    found = (typing.get_args(o) for o in options if typing.get_origin(o) is Literal)
    return next(found, ())
