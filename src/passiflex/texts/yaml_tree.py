"""YAML text as plain Python values that remember their line and column."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, NamedTuple

import yaml

from passiflex.texts.quantity import shown

MAX_CHARACTERS = 4_000_000
MAX_NODES = 100_000
MAX_DEPTH = 30
MOST_LINES = 100
TOO_MANY = f"more than {MAX_NODES} entries, aliases counted as often as they are used"

Place = tuple[str | int, ...]
"""Where a value is: the names and indices that lead to it."""

_INT = re.compile(r"[-+]?(?:0|[1-9][0-9]{0,17})")
_FLOAT = re.compile(r"[-+]?[0-9]+\.[0-9]*(?:[eE][-+][0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")
_WORDS = {
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
}
XML = re.compile(r"\s*<[?!A-Za-z]")
"""How a text of XML begins."""
_SURROGATE = re.compile("[\ud800-\udfff]")
_STANDARD_TAGS = {f"tag:yaml.org,2002:{kind}" for kind in ("str", "seq", "map")}


class LineColumn(NamedTuple):
    """A place in a file, counted from 1."""

    line: int
    column: int


class RefusedText(Exception):  # noqa: N818 - becomes a ScenarioError
    """The text is no tree of mappings, lists and scalars of bearable size."""


_QUICK: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
"""For text of our own; the one in C takes a tenth of the time."""


class _Bounded(yaml.BaseLoader):
    """The composer of PyYAML, which gives up early on a text that is too large or too deep for its reader."""

    def __init__(self, text: str):
        super().__init__(text)
        self.nodes = self.depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Return the next node."""
        self.nodes += 1
        self.depth += 1
        if self.nodes > 2 * MAX_NODES:  # keys are nodes, too
            raise RefusedText(TOO_MANY)
        if self.depth > 3 * MAX_DEPTH:
            raise RefusedText("nested too deeply")
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


class Tree:
    """A YAML text as Python values, with the mark of every key and value, and the mistakes found so far.

    `spans` says from which to which character of the text a value goes.
    """

    def __init__(self) -> None:
        self.keys: dict[Place, LineColumn] = {}
        self.values: dict[Place, LineColumn] = {}
        self.spans: dict[Place, slice] = {}
        self.mistakes: list[tuple[LineColumn, str, str]] = []

    def read(self, text: str, needs: str) -> dict[str, Any]:
        """Return the mapping of the text; raise RefusedText where there is none, which says what one needs."""
        try:
            mapping: dict[str, Any] = self._value(_composed(text, needs), ())
        except RefusedText:
            if XML.match(text):
                what = "XML in place of YAML, as of a URDF, which a robot file names in its entry urdf"
                raise RefusedText(f"{what}; {needs}") from None
            raise
        return mapping

    def report(
        self, place: Place, message: str, *, at_key: bool = False, mark: LineColumn | None = None
    ) -> None:
        """Add a mistake at a key or value, or at the nearest thing around it that the file has."""
        for end in range(len(place), -1, -1):
            known = (self.keys if at_key and end == len(place) else self.values).get(place[:end])
            mark = mark or known
        self.mistakes.append((mark or LineColumn(1, 1), f", {dotted(place)}" if place else "", message))

    def lines(self) -> list[str]:
        """Return the mistakes, one line each, in the order of the file; of very many the first ones."""
        found = [f"line {m.line}, column {m.column}{name}: {text}" for m, name, text in sorted(self.mistakes)]
        found = list(dict.fromkeys(found))
        more = len(found) - MOST_LINES
        return [*found[:MOST_LINES], f"and {more} more"] if more > 0 else found

    def _value(self, node: yaml.Node, place: Place) -> Any:
        mark = _mark(node)
        self.values[place] = mark
        self.spans[place] = slice(node.start_mark.index, node.end_mark.index)
        if len(self.values) > MAX_NODES:
            raise RefusedText(TOO_MANY)
        if len(place) > MAX_DEPTH:
            raise RefusedText(f"line {mark.line}, column {mark.column}: nested too deeply")
        if node.tag not in _STANDARD_TAGS:
            self.report(place, f"the tag {shown(node.tag)} is not supported; remove it")
        if isinstance(node, yaml.SequenceNode):
            return [self._value(child, (*place, i)) for i, child in enumerate(node.value)]
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, place)
        if _SURROGATE.search(node.value):
            raise RefusedText(f"line {mark.line}, column {mark.column}: a character that is not Unicode text")
        plain = isinstance(node, yaml.ScalarNode) and not node.style
        return _scalar(node.value) if plain and node.tag in _STANDARD_TAGS else node.value

    def _mapping(self, node: yaml.MappingNode, place: Place) -> dict[str, Any]:
        out: dict[str, Any] = {}
        for key, child in node.value:
            if not isinstance(key, yaml.ScalarNode) or _SURROGATE.search(key.value):
                self.report(place, "a name is not plain text", mark=_mark(key))
                continue
            here = (*place, key.value)
            if key.value in out:
                message = f"twice in one mapping, first in line {self.keys[here].line}; remove one"
                self.report(here, message, mark=_mark(key))
                continue
            self.keys[here] = _mark(key)
            out[key.value] = self._value(child, here)
        return out


def _composed(text: str, needs: str) -> yaml.MappingNode:
    """Return the mapping that a text of bearable size is composed to."""
    if len(text) > MAX_CHARACTERS:
        raise RefusedText(f"longer than {MAX_CHARACTERS} characters")
    try:
        node = yaml.compose(text, _Bounded)
    except yaml.reader.ReaderError as error:
        before = text[: error.position]
        line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
        raise RefusedText(f"line {line}, column {column}: a character that YAML does not allow") from None
    except yaml.MarkedYAMLError as error:
        problem = error.problem_mark or error.context_mark
        at = f"line {problem.line + 1}, column {problem.column + 1}: " if problem else ""
        what = ", ".join(p for p in (error.context, error.problem) if p)
        raise RefusedText(f"{at}no YAML: {_one_line(what)}") from None
    except RecursionError:
        raise RefusedText("nested too deeply") from None
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        raise RefusedText(f"no YAML: {_one_line(str(error))}") from None
    if node is None:
        raise RefusedText(f"empty; {needs}")
    if not isinstance(node, yaml.MappingNode):
        mark = _mark(node)
        raise RefusedText(f"line {mark.line}, column {mark.column}: not a mapping; try 'name: ...'")
    return node


def read_back(text: str) -> dict[str, Any]:
    """Return the mapping of a text that the package itself has written."""
    node = yaml.compose(text, _QUICK)
    assert node is not None
    mapping: dict[str, Any] = Tree()._value(node, ())
    return mapping


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)[:200]


def _mark(node: yaml.Node) -> LineColumn:
    return LineColumn(node.start_mark.line + 1, node.start_mark.column + 1)


def _scalar(text: str) -> Any:
    """Return the value of a plain scalar. YAML 1.1 reads 010 as 8, 1:30 as 90 and `on` as true: not here.

    What is left out here, as 1e-9, stays text, which quantities read as well.
    """
    if text in _WORDS:
        return _WORDS[text]
    if _INT.fullmatch(text):
        return int(text)
    if _FLOAT.fullmatch(text):
        return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
    return text


def dotted(place: Iterable[str | int]) -> str:
    """Return a place as `law.stiffness.translation` or `reference[0].by`."""
    out = ""
    for part in place:
        if isinstance(part, int):
            out += f"[{part}]"
        else:
            out += ("." if out else "") + (part if re.fullmatch(r"[\w-]{1,40}", part) else shown(part))
    return out
