"""A section with other entries: by path or nested mapping, merged into what is there, and validated anew."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeVar, cast, get_args

from pydantic import BaseModel, ValidationError

from passiflex.errors import ScenarioError
from passiflex.texts.model_mistakes import fields, former_names, models, tag_field, told, with_entries
from passiflex.texts.yaml_tree import dotted

if TYPE_CHECKING:  # a section is changed by this module
    from passiflex.texts.section import Section

S = TypeVar("S", bound="Section")
Model = type[BaseModel]

_NAME = r"[^\W\d]\w*(?:\[[0-9]+\])*"
_PATH = re.compile(rf"{_NAME}(?:\.{_NAME})*")
_PARTS = re.compile(r"\w+")


def changed(section: S, entries: Mapping[str, Any]) -> S:
    """Return the section with other entries; what they do not name stays as it was written, or left out.

    Raises
    ------
    ScenarioError
        With one line for each unknown name and each value that does not fit.
    """
    new: dict[Any, Any] = {}
    for path, value in entries.items():
        if not _PATH.fullmatch(str(path)):
            raise _refused(section, [f"{path!r}: no path; try one as 'law.gravity' or 'reference[0].at'"])
        for part in reversed(_PARTS.findall(str(path))):
            value = {int(part) if part.isdecimal() else part: value}
        new = _together(new, value)
    written = section.model_dump(by_alias=True, exclude_unset=True, exclude_none=True)
    mistakes: list[str] = []
    data = _merged((type(section),), written, new, (), mistakes)
    if mistakes:
        raise _refused(section, mistakes)
    return _validated(section, data)


def replaced(section: S, entries: Mapping[str, Any]) -> S:
    """Return the section with whole entries in place of its own.

    Raises
    ------
    ScenarioError
        As `changed`.
    """
    names = _names(type(section))
    data = {names[name]: getattr(section, name) for name in section.model_fields_set}
    for name, value in entries.items():
        if "." in name or "[" in name:
            what = f"{name}: model_copy takes whole entries"
            raise _refused(section, [f"{what}; try changed({{{name!r}: …}})"])
        data[names.get(name, name)] = _as_now(type(section), name, value)
    return _validated(section, data)


def _validated(section: S, data: dict[str, Any]) -> S:
    try:
        return type(section).model_validate(data)
    except ValidationError as error:
        raise _refused(section, told(error, data, type(section))) from None


def _refused(section: Section, mistakes: list[str]) -> ScenarioError:
    name = getattr(section, "name", None)
    kind = type(section).__name__
    return ScenarioError(f"{kind.lower()} {name!r}, changed" if name else f"{kind}, changed", mistakes)


def _together(old: Any, new: Any) -> Any:
    """Return two nested mappings as one; where both have an entry, the later one counts."""
    if not isinstance(old, Mapping) or not isinstance(new, Mapping):
        return new
    return {**old, **{k: _together(old.get(k), v) for k, v in new.items()}}


def _merged(here: tuple[Model, ...], old: Any, new: Any, place: tuple[str | int, ...], out: list[str]) -> Any:
    """Return what is written at a place after a change, and tell `out` what leads nowhere.

    Parameters
    ----------
    here: The models that may be there: several where the entries of a mapping choose one.
    """
    if not isinstance(new, Mapping):
        return new
    if any(isinstance(i, int) for i in new):
        entries = list(old) if isinstance(old, list | tuple) else []
        for i, value in new.items():
            if not isinstance(i, int) or i >= len(entries):
                has = f"has entries [0] to [{len(entries) - 1}]" if entries else "has no entries"
                out.append(f"{dotted((*place, i))}: {dotted(place)} {has}")
            else:
                entries[i] = _merged(here, entries[i], value, (*place, i), out)
        return entries
    model = _chosen(here, old)
    if model is None:
        return dict(new)
    tag = tag_field(model)
    if tag is not None and tag in new and new[tag] != old.get(tag):
        return dict(new)
    known = fields(model)
    names = _names(model)
    named = {names.get(str(name), str(name)): _as_now(model, str(name), value) for name, value in new.items()}
    kept = {name: value for name, value in old.items() if name not in _other_ways(model, named)}
    for name, value in named.items():
        below = tuple(models(known[name].annotation)) if name in known else ()
        kept[name] = _merged(below, kept.get(name), value, (*place, name), out)
    return kept


def _names(model: Model) -> dict[str, str]:
    """Return the name in a file of each field, and of each former name."""
    return {n: f.alias or n for n, f in model.model_fields.items()} | former_names(model)


def _as_now(model: Model, name: str, value: Any) -> Any:
    section = cast("type[Section]", model)
    return section.from_former(name, value) if hasattr(model, "from_former") else value


def _chosen(here: tuple[Model, ...], old: Any) -> Model | None:
    """Return the model of what is there, None if nothing is there or it is no section."""
    if not isinstance(old, dict):
        return None
    if len(here) < 2:
        return here[0] if here else None
    if not any(map(tag_field, here)):
        return next(iter(with_entries(here, old)), None)
    return next((m for m in here if (tag := tag_field(m)) and old.get(tag) == _word(m, tag)), None)


def _word(model: Model, tag: str) -> Any:
    """Return the only word that the entry takes which chooses a model."""
    return get_args(fields(model)[tag].annotation)[0]


def _other_ways(model: Model, new: Mapping[str, Any]) -> set[str]:
    """Return the entries that no longer stand where one of another way is given, as a matrix for its blocks."""
    ways: tuple[tuple[str, ...], ...] = getattr(model, "ways", ())
    taken = [way for way in ways if not new.keys().isdisjoint(way)]
    return {name for way in ways if way not in taken for name in way} if taken else set()
