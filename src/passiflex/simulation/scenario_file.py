"""Scenario files: YAML to `Scenario`, with every mistake at its line and column, all at once."""

from __future__ import annotations

import re
import typing
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from passiflex.errors import ScenarioError, nearest
from passiflex.simulation.quantity import shown
from passiflex.simulation.scenario import Scenario
from passiflex.simulation.section import Mistakes
from passiflex.simulation.yaml_tree import Place, RefusedText, Tree

MAX_BYTES = 1_000_000


def load_scenario(path: str | Path) -> Scenario:
    """Return the scenario of a file.

    A robot named by a path (.yaml) is found relative to the scenario file.

    Raises
    ------
    ScenarioError
        With one line for each mistake, or one line if the file cannot be read.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
        text = data.decode("utf-8-sig") if len(data) <= MAX_BYTES else ""
    except UnicodeDecodeError:
        raise ScenarioError(str(path), ["cannot be read: not UTF-8 text"]) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ScenarioError(str(path), [f"cannot be read: {reason}"]) from None
    if len(data) > MAX_BYTES:
        raise ScenarioError(str(path), ["the file is larger than 1 MB"])
    return parse_scenario(text, str(path), path.resolve().parent)


def parse_scenario(text: str, source: str = "scenario", base_dir: str | Path | None = None) -> Scenario:
    """Return the scenario of a YAML text; `source` names it in errors, `base_dir` is where robot files are.

    Raises
    ------
    ScenarioError
        With one line for each mistake: line, column, name, what is wrong and what to do.
    """
    tree = Tree()
    try:
        data = tree.read(text)
    except RefusedText as error:
        raise ScenarioError(source, [str(error)]) from None
    robot = data.get("robot")
    if base_dir is not None and isinstance(robot, str) and _is_path(robot):
        data["robot"] = str(Path(base_dir) / robot)
    scenario = None
    try:
        scenario = Scenario.model_validate(data)
    except ValidationError as error:
        for place, message, at_key in _explained(error, data):
            tree.report(place, message, at_key=at_key)
    if tree.mistakes or scenario is None:
        raise ScenarioError(source, tree.lines())
    return scenario


def _is_path(robot: str) -> bool:
    """Return whether a robot is named by its file, as the catalogue decides it."""
    return Path(robot).suffix in (".yaml", ".yml") or len(Path(robot).parts) > 1


def _explained(error: ValidationError, data: dict[str, Any]) -> Iterator[tuple[Place, str, bool]]:
    """Yield place in the file, message, and whether it is about the key, for each error of the models."""
    errors = error.errors(include_url=False)
    unknown = [e["loc"] for e in errors if e["type"] == "extra_forbidden"]
    misspelt = {(*loc[:-1], *nearest(str(loc[-1]), _names(loc[:-1]))[:1]) for loc in unknown}
    for e in errors:
        if e["type"] == "missing" and e["loc"] in misspelt:
            continue  # its name is there, with a mistake that is reported
        kind, ctx = e["type"], e.get("ctx", {})
        place = _in_file(e["loc"], data)
        names = _names(e["loc"][:-1] if kind in ("extra_forbidden", "missing") else e["loc"])
        if kind == "default_factory_not_called":
            continue
        if kind == "value_error" and isinstance(ctx["error"], Mistakes):
            for below, message in ctx["error"].entries:
                yield (*place, *below), message, False
        elif kind == "value_error":
            yield place, str(ctx["error"]), False
        elif kind == "extra_forbidden":
            yield place, f"unknown name; {_suggested(str(place[-1]), names)}", True
        elif kind == "missing":
            yield place, f"missing: {names[str(e['loc'][-1])]}", True
        elif kind.startswith("union_tag") and e["input"].get(tag := ctx["discriminator"].strip("'")) is None:
            yield (*place, tag), f"missing: one of {', '.join(map(repr, _tags(e['loc'])))}", True
        elif kind == "union_tag_invalid":
            yield (*place, tag), _word(ctx["tag"], re.findall(r"'([^']*)'", ctx["expected_tags"])), False
        elif kind == "literal_error":
            yield place, _word(e["input"], re.findall(r"'([^']*)'", ctx["expected"])), False
        elif kind in ("model_type", "model_attributes_type", "dict_type"):
            yield place, f"expected a mapping with {', '.join(names)}; got {shown(e['input'])}", False
        elif kind == "tuple_type":
            yield place, f"expected a list; got {shown(e['input'])}", False
        elif kind.startswith("int") or kind == "greater_than_equal":
            yield place, f"expected a whole number, ≥ 0; got {shown(e['input'])}", False
        elif kind == "string_type":
            yield place, f"expected text; got {shown(e['input'])}; try quotes around it", False
        elif kind == "string_pattern_mismatch":
            yield place, f"expected letters, digits, and any of _ . -; got {shown(e['input'])}", False
        else:
            yield place, f"{e['msg'][0].lower()}{e['msg'][1:]}; got {shown(e['input'])}", False


def _in_file(loc: Place, data: Any) -> Place:
    """Return the place in the file of a place in the models, without the names of union branches."""
    skip = {"law": 1, "reference": 2}.get(str(loc[0])) if loc else None
    out: list[str | int] = []
    for i, part in enumerate(loc):
        inserted = part == "value" and not (isinstance(data, dict) and "value" in data)
        if i == skip or inserted:
            continue
        out.append(part)
        inside = part in data if isinstance(data, dict) else isinstance(data, list)
        data = data[part] if inside else None
    return tuple(out)


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield the models that an annotation mentions."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in typing.get_args(annotation):
        yield from _models(part)


def _reached(loc: Place) -> tuple[type[BaseModel], ...]:
    """Return the models at a place in the models: several where a union has not been decided."""
    found: tuple[type[BaseModel], ...] = (Scenario,)
    for part in loc:
        if isinstance(part, int):
            continue
        if len(found) > 1:
            found = tuple(m for m in found if part == _tag(m))
        else:
            field = {f.alias or name: f for m in found for name, f in m.model_fields.items()}.get(part)
            found = tuple(_models(field.annotation)) if field else ()
    return found


def _tag(model: type[BaseModel]) -> str:
    """Return the word that chooses a model among the branches of its union."""
    field = model.model_fields.get("type") or model.model_fields["kind"]
    return str(typing.get_args(field.annotation)[0])


def _tags(loc: Place) -> list[str]:
    return [_tag(m) for m in _reached(loc)]


def _names(loc: Place) -> dict[str, str]:
    """Return the names that a mapping may have, each with its description."""
    return {f.alias or name: f.description or "" for m in _reached(loc) for name, f in m.model_fields.items()}


def _suggested(got: str, known: Iterable[str]) -> str:
    """Return what to take in place of a wrong word: the nearest one, or any."""
    best = nearest(got, known)[:1]
    return f"try {best[0]!r}" if best else f"one of {', '.join(map(repr, known))}"


def _word(got: Any, known: list[str]) -> str:
    return f"unknown word {shown(got)}; {_suggested(str(got), known)}"
