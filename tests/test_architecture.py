"""Imports run one way, modules stay short, and every module is named after its one idea."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "passiflex"
MODULES = sorted(SOURCE.rglob("*.py"))

FOUNDATION = ("version", "origin", "lazy", "errors", "extras", "layout", "parts", "files")
ROOMS = (
    *FOUNDATION,
    "texts",
    "robots",
    "phs",
    "control",
    "sampled",
    "elements",
    "native",
    "scenarios",
    "loops",
    "problems",
    "stability",
    "runs",
    "engines",
    "simulation",
    "onboard",
    "passivity",
    "metrics",
    "limits",
    "cards",
    "chunks",
    "campaigns",
    "diagrams",
    "plotting",
    "reports",
    "exports",
    "studies",
    "cli",
)
"""A room imports from itself and from the rooms before it."""

ONLY = {"native": FOUNDATION, "chunks": (*FOUNDATION, "texts")}
"""What a room may import when that is less than the order allows: both know nothing of robots and laws."""

DRAWN_BY = ("plotting", "reports", "studies", "cli")
"""The only rooms that import plotting; reports takes its colours from there."""

UPWARD = {"passiflex.runs.run": "reports"}
"""The one door upward: `run.show()` is where people look for it."""

LONGEST = 300
EMPTY_NAMES = {"core", "helpers", "manager", "utils"}


def room_of(module: str) -> str:
    """Return the room of a dotted name; that of the package itself is "passiflex", above all others."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else parts[0]


def dotted_name(path: Path) -> str:
    parts = ["passiflex", *path.relative_to(SOURCE).with_suffix("").parts]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported_rooms(source: str, module: str, *, package: bool) -> Iterator[tuple[int, str]]:
    """Yield line and room of everything of passiflex that is imported, at any depth of the code."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            start = node.module or ""
            if node.level:
                above = module.split(".")
                above = above[: len(above) - node.level + package]
                start = ".".join([*above, start] if start else above)
            names = [f"{start}.{alias.name}" for alias in node.names]
        elif (
            isinstance(node, ast.Call)
            and getattr(node.func, "attr", getattr(node.func, "id", "")) in ("import_module", "__import__")
            and node.args
            and isinstance(node.args[0], ast.Constant)
        ):
            names = [str(node.args[0].value)]
        else:
            continue
        for name in names:
            if name.split(".")[0] == "passiflex":
                room = room_of(name)
                yield node.lineno, room if room in ROOMS else "passiflex"


def allowed_rooms(room: str) -> set[str]:
    below = ONLY.get(room, ROOMS[: ROOMS.index(room)])
    return {room, *(name for name in below if name != "plotting" or room in DRAWN_BY)}


def violations(source: str, module: str, *, package: bool = False) -> list[str]:
    room = room_of(module)
    return [
        f"{module}, line {line}: {room} must not import {other}"
        for line, other in imported_rooms(source, module, package=package)
        if other not in allowed_rooms(room) and UPWARD.get(module) != other
    ]


def test_the_modules_are_found() -> None:
    assert {room_of(dotted_name(path)) for path in MODULES} == {"passiflex", *ROOMS}


@pytest.mark.parametrize(
    "path", [path for path in MODULES if path.parent != SOURCE or path.stem in ROOMS], ids=dotted_name
)
def test_imports_run_one_way(path: Path) -> None:
    assert violations(path.read_text(), dotted_name(path), package=path.stem == "__init__") == []


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("passiflex.robots.arm", "import passiflex.control.law"),
        ("passiflex.robots.arm", "from passiflex.control.law import ImpedanceLaw"),
        ("passiflex.robots.arm", "from passiflex import control"),
        ("passiflex.robots.arm", "from ..control import law"),
        ("passiflex.robots.arm", "from .. import control"),
        ("passiflex.robots.arm", "def late():\n    from passiflex.simulation import run"),
        ("passiflex.robots.arm", "import importlib\nimportlib.import_module('passiflex.cli')"),
        ("passiflex.errors", "from passiflex import layout"),
        ("passiflex.phs.system", "import passiflex as pf"),
        ("passiflex.phs.system", "from passiflex import simulate"),
        ("passiflex.native.library", "from passiflex.robots import chain"),
        ("passiflex.runs.run", "from passiflex.plotting import figure"),
        ("passiflex.plotting.figure", "from passiflex.studies import paper"),
        ("passiflex.studies.paper", "from passiflex.cli import main"),
    ],
)
def test_an_import_that_goes_up_is_seen(module: str, source: str) -> None:
    (message,) = violations(source, module)
    assert message.startswith(f"{module}, line {len(source.splitlines())}: ")


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("passiflex.robots.arm", "from passiflex import errors"),
        (
            "passiflex.robots.arm",
            "from . import chain\nfrom .chain import SerialChain\nfrom ..errors import SizeError",
        ),
        (
            "passiflex.native.library",
            "from passiflex.files import write_whole\nfrom passiflex.native import compiler",
        ),
        (
            "passiflex.plotting.figure",
            "from passiflex.passivity import audit\nfrom passiflex.simulation import Run",
        ),
        ("passiflex.studies.paper", "from passiflex.plotting import figure"),
        ("passiflex.cli.main", "from passiflex.plotting import figure\nfrom passiflex.studies import paper"),
        ("passiflex.robots.arm", "import passiflexible"),
    ],
)
def test_an_import_that_goes_down_or_stays_is_allowed(module: str, source: str) -> None:
    assert violations(source, module) == []


def test_a_relative_import_of_a_room_itself_starts_at_the_room() -> None:
    assert violations("from .arm import Arm\nfrom ..phs import system", "passiflex.robots", package=True) == [
        "passiflex.robots, line 2: robots must not import phs"
    ]


def test_yaml_is_read_in_one_place() -> None:
    readers = {
        "load",
        "safe_load",
        "full_load",
        "unsafe_load",
        "load_all",
        "safe_load_all",
        "compose",
        "parse",
        "scan",
    }
    found = {
        dotted_name(path)
        for path in MODULES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Attribute)
        and node.attr in readers
        and getattr(node.value, "id", "") == "yaml"
    }
    assert found == {"passiflex.texts.yaml_tree"}


@pytest.mark.parametrize("path", MODULES, ids=dotted_name)
def test_a_module_is_short(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= LONGEST


def test_no_module_has_an_empty_name() -> None:
    assert [dotted_name(path) for path in MODULES if EMPTY_NAMES & set(dotted_name(path).split("."))] == []


def _names(tree: ast.AST) -> Iterator[str]:
    """Yield what is imported, at any depth; but for what only a type checker reads, which nothing waits for."""
    nodes = [tree]
    while nodes:
        node = nodes.pop()
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            nodes += node.orelse
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        nodes += ast.iter_child_nodes(node)


def _imported(trees: dict[str, ast.AST]) -> dict[str, set[str]]:
    """Return the modules that each module imports."""
    graph: dict[str, set[str]] = {module: set() for module in trees}
    for module, tree in trees.items():
        for name in _names(tree):
            while name and name not in trees:
                name = name.rpartition(".")[0]
            graph[module] |= {name} - {"", module, "passiflex"}
    return graph


def circles(trees: dict[str, ast.AST]) -> list[str]:
    """Return the modules that import themselves by way of others."""
    graph = _imported(trees)
    for door, room in UPWARD.items():
        graph[door] = {m for m in graph.get(door, set()) if room_of(m) != room}

    def reached(module: str) -> set[str]:
        found, waiting = set[str](), list(graph[module])
        while waiting:
            if (here := waiting.pop()) not in found:
                found.add(here)
                waiting += graph[here]
        return found

    return [module for module in graph if module in reached(module)]


def test_no_imports_go_in_a_circle() -> None:
    assert circles({dotted_name(path): ast.parse(path.read_text()) for path in MODULES}) == []


def test_a_circle_is_seen() -> None:
    texts = {
        "passiflex.a": "def f():\n    from passiflex.b import g",
        "passiflex.b": "from passiflex import c",
        "passiflex.c": "import passiflex.a",
        "passiflex.d": "if TYPE_CHECKING:\n    from passiflex import d\nimport passiflex.a",
    }
    assert circles({name: ast.parse(text) for name, text in texts.items()}) == [
        "passiflex.a", "passiflex.b", "passiflex.c",
    ]  # fmt: skip


def test_the_order_is_told_as_it_is() -> None:
    """To those who read the package's first lines, and to those who contribute."""
    root = SOURCE.parents[1]
    first = (SOURCE / "__init__.py").read_text().split("The rooms,")[1].split('"""')[0]
    told = (root / "CONTRIBUTING.md").read_text().split("Imports run one way:")[1].split("`cli`")[0] + "`cli`"
    rooms = ROOMS[len(FOUNDATION) :]
    assert tuple(re.findall(r"`(\w+)`", first)) == rooms
    assert tuple(re.findall(r"`(\w+)`", told)) == (*FOUNDATION, *rooms)
