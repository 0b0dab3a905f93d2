"""The entries of a scenario file, read from the code that takes them: key, what may be written, default, meaning."""

from __future__ import annotations

import math
import typing
from collections.abc import Iterator
from typing import Any, NamedTuple

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from passiflex.errors import NameUnknownError
from passiflex.scenarios.scenario import Scenario
from passiflex.texts.quantity import Quantity


class Key(NamedTuple):
    """An entry of a section: its key, what may be written, its default, what it means."""

    key: str
    write: str
    default: str
    meaning: str


def keys_of(section: type[BaseModel]) -> tuple[Key, ...]:
    """Return the entries of a section."""
    return tuple(
        Key(_called(name, field), written(field), default(field), field.description or "")
        for name, field in section.model_fields.items()
    )


def sections_at(path: str = "") -> dict[str, type[BaseModel]]:
    """Return the sections at a place of a scenario file, by what each is written as.

    Parameters
    ----------
    path: As `control.fallback`, or `environment.plane` for one of the kinds of its entries; empty for the file itself.

    Raises
    ------
    NameUnknownError
        For a place that there is not, or that has no entries of its own, with those that there are.
    """
    found: dict[str, type[BaseModel]] = {"": Scenario}
    been: list[str] = []
    for word in [word.split("[")[0] for word in path.split(".") if word]:
        inner = {
            _called(name, field): inside
            for section in found.values()
            for name, field in section.model_fields.items()
            if (inside := _sections_in(field))
        }
        kinds = {kind: {kind: section} for kind, section in found.items() if kind and len(found) > 1}
        within = ".".join(been) or "a scenario"
        if word not in (known := kinds | inner):
            raise NameUnknownError(f"section of {within}", word, tuple(known))
        found = known[word]
        been.append(word)
    return found


def _called(name: str, field: FieldInfo) -> str:
    return field.alias or name


def _sections_in(field: FieldInfo) -> dict[str, type[BaseModel]]:
    """Return the sections that a field may have, by their kind where they have one, or else their class."""
    return {_kind(part): part for part in parts(field) if _is_section(part)}


def _kind(section: type[BaseModel]) -> str:
    named = [word for key in ("type", "kind") for word in words(section.model_fields.get(key))]
    return named[0] if named else section.__name__


def mentioned(annotation: Any) -> Iterator[Any]:
    """Yield everything that an annotation is made of."""
    yield annotation
    yield from getattr(annotation, "__metadata__", ())
    for part in typing.get_args(annotation):
        yield from mentioned(part)


def parts(field: FieldInfo) -> list[Any]:
    """Return the metadata and the types of a field."""
    return [*field.metadata, *mentioned(field.annotation)]


def sections(model: type[BaseModel] = Scenario) -> list[type[BaseModel]]:
    """Return every section that a scenario file can have, the scenario first."""
    found = [model]
    for section in found:
        for field in section.model_fields.values():
            found += [p for p in parts(field) if _is_section(p) and p not in found]
    return found


def words(field: FieldInfo | None) -> list[str]:
    """Return the words that a field chooses from; none for any other field."""
    literals = [p for p in parts(field) if typing.get_origin(p) is typing.Literal] if field else []
    return list(dict.fromkeys(word for p in literals for word in typing.get_args(p)))


def written(field: FieldInfo) -> str:
    """Return what may be written for a field."""
    known = parts(field)
    if quantity := next((p for p in known if isinstance(p, Quantity)), None):
        return quantity.words or "a number"
    if inside := [p for p in known if _is_section(p)]:
        kinds = [
            f"{key}: {w}" for p in inside for key in ("type", "kind") for w in words(p.model_fields.get(key))
        ]
        listed = "a list of sections" if any(typing.get_origin(p) is tuple for p in known) else "a section"
        return f"{listed}, {' | '.join(kinds)}" if kinds else listed
    if choice := words(field):
        return " | ".join(choice)
    plain: dict[Any, str] = {str: "text", int: "whole number, ≥ 0", bool: "true | false"}
    return plain[field.annotation]


def default(field: FieldInfo) -> str:
    """Return the default of a field as it would be written."""
    value = field.default
    if field.is_required():
        return "required"
    if field.default_factory:
        return "all defaults" if any(_is_section(p) for p in parts(field)) else "what fits"
    if isinstance(value, BaseModel) or value == ():
        return "none given"
    if isinstance(value, float):
        return "inf" if math.isinf(value) else f"{value:g}"
    if isinstance(value, tuple):
        return listed(value)
    return {"": "empty", None: "–", True: "true", False: "false"}.get(value, str(value))


def listed(values: tuple[Any, ...]) -> str:
    """Return a list, or a list of lists, as it would be written."""
    return f"[{', '.join(listed(v) if isinstance(v, tuple) else f'{v:g}' for v in values)}]"


def _is_section(part: Any) -> bool:
    return isinstance(part, type) and issubclass(part, BaseModel)
