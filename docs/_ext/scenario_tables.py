"""The directives `scenario-table`, the entries of one section of a scenario file, and `tank-table`, read from the code.

A table cannot differ from the package: key, what may be written, default and meaning are those of
`passiflex.scenarios.scenario`.
"""

from __future__ import annotations

import math
import typing
from collections.abc import Iterator
from typing import Any

from docutils import nodes
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.tank_settings import TankSettings
from passiflex.scenarios.tank_uses import CONTINUOUS, SAMPLED, Uses
from passiflex.texts.quantity import Quantity

COLUMNS = (("key", 22), ("write", 30), ("default", 12), ("meaning", 36))


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
    return {str: "text", int: "whole number, ≥ 0", bool: "true | false"}[field.annotation]


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


class ScenarioTable(SphinxDirective):
    """`scenario-table:: NAME` with NAME the class of a section."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        known = {s.__name__: s for s in sections()}
        if self.arguments[0] not in known:
            raise self.error(f"no section {self.arguments[0]!r}; one of {', '.join(known)}")
        rows = [
            (field.alias or name, written(field), default(field), field.description or "")
            for name, field in known[self.arguments[0]].model_fields.items()
        ]
        table, group = nodes.table(classes=["scenario"]), nodes.tgroup(cols=len(COLUMNS))
        group += [nodes.colspec(colwidth=width) for _, width in COLUMNS]
        head, body = nodes.thead(), nodes.tbody()
        head += _row([nodes.Text(title) for title, _ in COLUMNS])
        body += [_row([nodes.literal(text=r[0]), *map(nodes.Text, r[1:])]) for r in rows]
        group += [head, body]
        table += group
        return [table]


class TankTable(SphinxDirective):
    """`tank-table::`, which kind of tank goes by which of its settings, read from the code."""

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        kinds = {"paper, in continuous time": CONTINUOUS} | SAMPLED
        names = [n for n in TankSettings.model_fields if n not in ("kind", "initial")]
        table, group = nodes.table(classes=["scenario"]), nodes.tgroup(cols=len(kinds) + 1)
        group += [nodes.colspec(colwidth=1) for _ in range(len(kinds) + 1)]
        head, body = nodes.thead(), nodes.tbody()
        head += _row([nodes.Text(title) for title in ("setting", *kinds)])
        for name in names:
            body += _row([nodes.literal(text=name), *(nodes.Text(_used(t, name)) for t in kinds.values())])
        group += [head, body]
        table += group
        return [table]


def _used(uses: Uses, name: str) -> str:
    return "yes" if name in uses.always else "yes (v)" if name in uses.gates else "–"


def _row(cells: list[nodes.Node]) -> nodes.row:
    row = nodes.row()
    for cell in cells:
        row += nodes.entry("", nodes.paragraph("", "", cell))
    return row


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("scenario-table", ScenarioTable)
    app.add_directive("tank-table", TankTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
