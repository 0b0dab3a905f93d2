"""Scenario files: YAML to `Scenario`, with every mistake at its line and column, all at once."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from passiflex.errors import ScenarioError
from passiflex.scenarios.scenario import Scenario
from passiflex.texts.kinds import another_file, of_another_kind
from passiflex.texts.model_mistakes import explained, told
from passiflex.texts.quantity import shown
from passiflex.texts.text_file import IN_YAML, UnreadableError, decoded, is_path, read_bytes
from passiflex.texts.yaml_tree import Place, RefusedText, Tree

WITH_TABLES = ("reference", "forces")
"""Entries of a scenario that may name the files of tables."""
A_SCENARIO = "a scenario needs at least name, robot, posture, law and duration"


def load_scenario(path: str | Path) -> Scenario:
    """Return the scenario of a file.

    A robot named by a path (.yaml) is found relative to the scenario file.

    Raises
    ------
    ScenarioError
        With one line for each mistake, or one line if the file cannot be read.
    """
    if not isinstance(path, str | Path) or not str(path).strip():
        raise ScenarioError(
            shown(path), ["no scenario; try the path of its file, or parse_scenario for a text"]
        )
    path = Path(path)
    if len(path.parts) < 2 and not path.suffix and not os.path.exists(path):
        _refuse_robot(str(path))
    return parse_scenario(read_text(path), str(path), path.resolve().parent)


def _refuse_robot(name: str) -> None:
    from passiflex.robots.catalogue import catalogue  # half a second to import: only where a word is no file

    if name in catalogue():
        try_ = f"passiflex recommend {name} --rate '1 kHz', or {name} as the robot of a scenario"
        raise ScenarioError(name, [f"this is a robot, not a scenario; try {try_}"])


def as_scenario(given: Scenario | Mapping[str, Any] | str | Path) -> Scenario:
    """Return a scenario as it is, that of a mapping with the entries of a file, or that of the file at a path.

    Raises
    ------
    ScenarioError
        With one line for each mistake.
    """
    if isinstance(given, Scenario):
        return given
    if not isinstance(given, Mapping):
        return load_scenario(given)
    data = dict(given)
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        raise ScenarioError("scenario", told(error, data, Scenario)) from None


def is_scenario(path: str | Path) -> bool:
    """Return whether a file has a law, as every scenario has and no robot file; False if it cannot be read."""
    try:
        return "law" in Tree().read(read_text(Path(path)), A_SCENARIO)
    except (RefusedText, ScenarioError):
        return False


def read_text(path: Path) -> str:
    """Return the text of a scenario or campaign file.

    Raises
    ------
    ScenarioError
        If it cannot be read, is no text or larger than 1 MB.
    """
    try:
        return decoded(read_bytes(path), IN_YAML)
    except UnreadableError as error:
        other = another_file(path, "scenario")
        raise ScenarioError(str(path), [other or f"cannot be read: {error}"]) from None


def parse_scenario(
    text: str, source: str = "scenario", base_dir: str | Path | None = None, *, opens: bool = True
) -> Scenario:
    """Return the scenario of a YAML text; `source` names it in errors, `base_dir` is where its files are.

    Without `opens` a file that it names is not opened, and a scenario that needs one for a table has a mistake.

    Raises
    ------
    ScenarioError
        With one line for each mistake: line, column, name, what is wrong and what to do.
    """
    data, tree = read_tree(text, "scenario", A_SCENARIO, source)
    for entry in WITH_TABLES if not opens else ():
        if named := _named(data.get(entry)):
            raise ScenarioError(
                source, [f"{entry}: the table {shown(named)} is not opened; its rows are not here"]
            )
    scenario = read_scenario(data, tree, (), base_dir)
    if tree.mistakes or scenario is None:
        raise ScenarioError(source, tree.lines())
    return scenario


def read_tree(text: str, kind: str, needs: str, source: str) -> tuple[dict[str, Any], Tree]:
    """Return the entries of a text, and where they stand in it.

    Raises
    ------
    ScenarioError
        If there are none, or they are those of another kind of file.
    """
    tree = Tree()
    try:
        data = tree.read(text, needs)
    except RefusedText as error:
        raise ScenarioError(source, [str(error)]) from None
    if (other := of_another_kind(data, kind, source)) is not None:
        raise ScenarioError(source, [other])
    return data, tree


def _named(written: Any) -> Any:
    """Return the first file of a table that an entry, or a list of them, names; None if there is none."""
    events = written if isinstance(written, list) else [written]
    return next((e["table"] for e in events if isinstance(e, dict) and e.get("table")), None)


def _found(written: Any, folder: Path) -> Any:
    """Return what was written with tables that are named by paths that are found from anywhere."""
    if isinstance(written, list):
        return [_found(event, folder) for event in written]
    if isinstance(written, dict) and isinstance(name := written.get("table"), str) and name.strip():
        return written | {"table": str(folder / name)}
    return written


def read_scenario(
    data: dict[str, Any], tree: Tree, place: Place, base_dir: str | Path | None
) -> Scenario | None:
    """Return the scenario written at a place of the tree; None if it has mistakes, which the tree then has too."""
    robot = data.get("robot")
    if base_dir is not None and isinstance(robot, str) and is_path(robot):
        data["robot"] = str(Path(base_dir) / robot)
    if base_dir is not None:
        data |= {entry: _found(data[entry], Path(base_dir)) for entry in WITH_TABLES if entry in data}
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        for below, message, at_key in explained(error, data, Scenario):
            tree.report((*place, *below), message, at_key=at_key)
    return None
