"""What the models of a file refused: each mistake at its place in the file, in words, with the nearest name."""

from __future__ import annotations

import re
import typing
from collections.abc import Iterable, Iterator
from typing import Any, Literal, NamedTuple

from pydantic import BaseModel, Discriminator, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from passiflex.errors import nearest
from passiflex.texts.mistakes import Mistakes
from passiflex.texts.quantity import shown
from passiflex.texts.yaml_tree import Place, dotted

REFUSED_NAME = "refused_name"
"""Type of a PydanticCustomError that is about the name of an entry, not about its value."""

MOST_HINTS = 100
"""Unknown names for which the nearest known one is looked for: of more, nobody reads the rest."""

Model = type[BaseModel]


def explained(error: ValidationError, data: Any, root: Model) -> Iterator[tuple[Place, str, bool]]:
    """Yield place in the file, message, and whether it is about the key, for each mistake in `data`.

    Parameters
    ----------
    error: What the validation of `data` by `root` raised.
    """
    errors = error.errors(include_url=False)
    unknown = [e["loc"] for e in errors if e["type"] == "extra_forbidden"]
    misspelt = {
        (*loc[:-1], *nearest(str(loc[-1]), _names(loc[:-1], root))[:1]) for loc in unknown[:MOST_HINTS]
    }
    hinted = set(unknown[:MOST_HINTS])
    for e in errors:
        if e["type"] == "missing" and e["loc"] in misspelt:
            continue  # its name is there, with a mistake that is reported
        kind, ctx = e["type"], e.get("ctx", {})
        place = _in_file(e["loc"], data, root)
        names = _names(e["loc"][:-1] if kind in ("extra_forbidden", "missing") else e["loc"], root)
        if kind == "default_factory_not_called":
            continue
        if kind == "value_error" and isinstance(ctx["error"], Mistakes):
            for below, message in ctx["error"].entries:
                yield (*place, *below), message, False
        elif kind == "value_error":
            yield place, str(ctx["error"]), False
        elif kind == REFUSED_NAME:
            yield place, e["msg"], True
        elif kind == "extra_forbidden":
            hint = f"; {suggested(str(place[-1]), names)}" if e["loc"] in hinted else ""
            now = {k: n for m in _reached(e["loc"][:-1], root) for k, n in former_names(m).items()}
            twice = f"is {now[place[-1]]!r}, which is there too; remove one" if place[-1] in now else ""
            yield place, twice or f"unknown name{hint}", True
        elif kind == "missing":
            yield place, f"missing: {names[str(e['loc'][-1])]}", True
        elif kind.startswith("union_tag") and not isinstance(e["input"], dict):
            yield place, f"expected a mapping; got {shown(e['input'])}", False
        elif kind.startswith("union_tag") and e["input"].get(tag := ctx["discriminator"].strip("'")) is None:
            tags = [_tag(m) for m in _reached(e["loc"], root)]
            yield (*place, tag), f"missing: one of {', '.join(map(repr, tags))}", True
        elif kind == "union_tag_invalid":
            yield (*place, tag), word(ctx["tag"], re.findall(r"'([^']*)'", ctx["expected_tags"])), False
        elif kind == "literal_error":
            yield place, word(e["input"], re.findall(r"'([^']*)'", ctx["expected"])), False
        else:
            yield place, _of_another_kind(e, names, root), False


def _of_another_kind(e: ErrorDetails, names: Iterable[str], root: Model) -> str:
    """Return the message for a value of a kind that its entry does not take."""
    kind, got = e["type"], shown(e["input"])
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        needs = f"a mapping with {', '.join(names)}" if names else "a mapping"
        return f"expected {needs}; got {got}"
    if kind == "tuple_type":
        return f"expected a list; got {got}"
    if kind.startswith("int") or kind == "greater_than_equal":
        return f"expected a whole number, ≥ {_least(e['loc'], root)}; got {got}"
    if kind == "string_type":
        return f"expected text; got {got}; try quotes around it"
    if kind == "string_too_short":
        return f"expected text; got {got}"
    if kind == "string_pattern_mismatch":
        return f"expected letters, digits, and any of _ . -; got {got}"
    return f"{e['msg'][0].lower()}{e['msg'][1:]}; got {got}"


def told(error: ValidationError, data: Any, root: Model) -> list[str]:
    """Return one line for each mistake of data that no file has, with its place in it."""
    found = explained(error, data, root)
    return [f"{dotted(place)}: {message}" if place else message for place, message, _ in found]


def suggested(got: str, known: Iterable[str]) -> str:
    """Return what to take in place of a wrong word: the nearest one, or any."""
    best = nearest(got, known)[:1]
    return f"try {best[0]!r}" if best else f"one of {', '.join(map(repr, known))}"


def word(got: Any, known: Iterable[str]) -> str:
    """Return what is wrong with a word that is none of those known."""
    return f"unknown word {shown(got)}; {suggested(str(got), known)}"


def fields(model: Model) -> dict[str, FieldInfo]:
    """Return the fields of a model by the names that they have in a file."""
    return {f.alias or name: f for name, f in model.model_fields.items()}


def readable(model: Model) -> dict[str, FieldInfo]:
    """Return the same, and those that had another name before by that one too."""
    named = fields(model)
    return named | {former: named[name] for former, name in former_names(model).items()}


def former_names(model: Model) -> dict[str, str]:
    """Return former name → name of the entries of a model that had another."""
    return model.former_names() if hasattr(model, "former_names") else {}  # as a `Section` has


def models(annotation: Any) -> Iterator[Model]:
    """Yield the models that an annotation mentions."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in typing.get_args(annotation):
        yield from models(part)


def tag_field(model: Model) -> str | None:
    """Return the name of the entry whose only word chooses a model among the branches of its union."""
    for name, field in fields(model).items():
        if typing.get_origin(field.annotation) is Literal and len(typing.get_args(field.annotation)) == 1:
            return name
    return None


def with_entries(found: Iterable[Model], written: dict[str, Any]) -> tuple[Model, ...]:
    """Return the models that have all the entries that were written: where no entry chooses one, they do."""
    return tuple(m for m in found if written.keys() <= fields(m).keys())


def _tag(model: Model) -> str:
    name = tag_field(model)
    return str(typing.get_args(fields(model)[name].annotation)[0]) if name else ""


class _Reached(NamedTuple):
    """The models at a place: several where a union has not been decided; or the entries of a list or mapping.

    `chosen` says that what follows is the name of a branch that a function chose; `branches`, that each entry has one.
    """

    models: tuple[Model, ...]
    entries: bool = False
    chosen: bool = False
    branches: bool = False


def _steps(loc: Place, root: Model) -> Iterator[tuple[bool, _Reached]]:
    """Yield for each part of a place in the models whether the file has it too, and what it leads to."""
    here = _Reached((root,))
    for part in loc:
        in_file = not here.chosen and (here.entries or len(here.models) < 2)
        if here.entries:
            here = _Reached(here.models, chosen=here.branches)
        elif here.chosen:
            named = tuple(m for m in here.models if m.__name__ == part)
            here = _Reached(named or here.models)
        elif not in_file:
            here = _Reached(tuple(m for m in here.models if part == _tag(m)))
        else:
            field = {k: f for m in here.models for k, f in readable(m).items()}.get(str(part))
            annotation = field.annotation if field else None
            chosen = field is not None and _has_branches(field.metadata)
            several = typing.get_origin(annotation) in (tuple, dict) and not chosen
            inner = typing.get_args(annotation)[:1] if several else ()
            each = any(_has_branches(getattr(part, "__metadata__", ())) for part in inner)
            here = _Reached(tuple(models(annotation)), several, chosen, each)
        yield in_file, here


def _has_branches(metadata: Iterable[Any]) -> bool:
    """Return whether a function chooses among the branches of a union."""
    return any(isinstance(m, Discriminator) for m in metadata)


def _in_file(loc: Place, data: Any, root: Model) -> Place:
    """Return the place in the file of a place in the models, without the names of union branches."""
    out: list[str | int] = []
    for part, (in_file, _) in zip(loc, _steps(loc, root), strict=True):
        inserted = part == "value" and not (isinstance(data, dict) and "value" in data)
        if not in_file or inserted:
            continue
        out.append(part)
        inside = part in data if isinstance(data, dict) else isinstance(data, list) and isinstance(part, int)
        data = data[part] if inside else None
    return tuple(out)


def _reached(loc: Place, root: Model) -> tuple[Model, ...]:
    """Return the models at a place in the models: none where a list or a mapping of entries is."""
    here = _Reached((root,))
    for _, here in _steps(loc, root):  # noqa: B007 - the last one counts
        pass
    return () if here.entries else here.models


def _least(loc: Place, root: Model) -> int:
    """Return the least whole number that a field takes."""
    found = [f for m in _reached(loc[:-1], root) for name, f in fields(m).items() if name == loc[-1]]
    return next((int(b.ge) for f in found for b in f.metadata if hasattr(b, "ge")), 0)


def _names(loc: Place, root: Model) -> dict[str, str]:
    """Return the names that a mapping may have, each with its description."""
    return {name: f.description or "" for m in _reached(loc, root) for name, f in fields(m).items()}
