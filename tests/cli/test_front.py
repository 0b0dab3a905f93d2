"""What the command line answers before it imports anything: the list of commands, the version, a wrong first word."""

from __future__ import annotations

import importlib
import inspect
import shlex
import subprocess
import sys
import tomllib
from importlib.metadata import version
from itertools import chain
from pathlib import Path

import pytest

import passiflex
from cli.shell import Shell
from passiflex.cli import application
from passiflex.cli.command_table import EXAMPLES, GROUPS
from worlds import PLANAR

COMMANDS = list(chain.from_iterable(GROUPS.values()))
LARGE = {"casadi", "h5py", "matplotlib", "pandas", "pint", "pyarrow", "scipy", "xarray"}
ROOT = Path(__file__).parents[2]


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(monkeypatch, capsys)


def modules_after(statement: str) -> set[str]:
    """Return the modules that a new interpreter has imported when a statement ends the program."""
    report = f"import atexit, sys\natexit.register(lambda: print(*sys.modules, file=sys.stderr))\n{statement}"
    done = subprocess.run([sys.executable, "-c", report], capture_output=True, text=True, check=False)
    return set(done.stderr.splitlines()[-1].split())


def modules_of(*arguments: str) -> set[str]:
    """Return the modules that a call of the command line has imported when it ends."""
    argv = ["passiflex", *arguments]
    return modules_after(f"sys.argv = {argv!r}\nfrom passiflex.cli import main\nmain()")


@pytest.mark.parametrize("arguments", [(), ("--help",), ("-h",), ("--version",), ("simulat",), ("--hepl",)])
def test_the_front_imports_little_and_nothing_that_is_installed(arguments: tuple[str, ...]) -> None:
    """A module of the standard library takes some tenths of a millisecond: seconds are not what is counted."""
    bare = modules_after("pass")
    added = {name.split(".")[0] for name in modules_of(*arguments) - bare}
    assert added - sys.stdlib_module_names == {"passiflex"}
    assert len(modules_of(*arguments) - bare) < 40


def test_commands_import_nothing_large_before_they_do_something() -> None:
    places = sorted({command.place.partition(":")[0] for command in COMMANDS})
    imported = {name.split(".")[0] for name in modules_after(f"import {', '.join(places)}")}
    assert "cyclopts" in imported
    assert imported.isdisjoint({*LARGE, "numpy", "pydantic", "yaml"})


@pytest.mark.parametrize("unit", ["", " cm", " km"], ids=["plain numbers", "usual units", "rare units"])
def test_a_mistake_in_a_scenario_is_told_before_anything_else_is_imported(unit: str, tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(PLANAR.replace("[0, 0, 0.05]", f"[0{unit}, 0{unit}, 5{unit}]") + "durration: 3\n")
    imported = modules_of("simulate", str(path), "--out", str(tmp_path / "run.nc"))
    assert "passiflex.scenarios.scenario" in imported
    packages = {name.split(".")[0] for name in imported}
    assert {"numpy", "pydantic", "yaml"} <= packages
    rare = unit == " km"
    assert packages.isdisjoint(LARGE - ({"pint", "scipy"} if rare else set()))  # scipy is pint's
    assert rare == ("pint" in packages)


def test_a_command_imports_neither_the_others_nor_what_they_need() -> None:
    imported = modules_of("replay", "--sampel", "1")
    assert "passiflex.cli.campaign_commands" in imported
    assert imported.isdisjoint({"passiflex.cli.commands", "passiflex.campaigns", "numpy", "pydantic"})


@pytest.mark.parametrize("arguments", [[], ["--help"], ["-h"]])
def test_the_commands_are_listed_by_what_one_wants(shell: Shell, arguments: list[str]) -> None:
    status, out, err = shell(*arguments)
    assert (status, err) == (0, "")
    parts = out.split("\n\n")
    groups = {part.splitlines()[0]: part.splitlines()[1:] for part in parts[2:-1]}
    assert list(groups) == [
        "run:",
        "your arm:",
        "judge:",
        "look:",
        "on a robot:",
        "many robots:",
        "for example:",
    ]
    listed = [[line.split()[0] for line in lines] for lines in groups.values()][:-1]
    assert listed == [
        ["simulate", "reproduce", "keys", "robots"],
        ["robot", "robot", "card"],
        ["audit", "limits", "recommend"],
        ["show", "plot", "export", "export-model"],
        ["run", "export-law"],
        ["campaign", "replay", "search"],
    ]
    assert len(groups["for example:"]) == 3
    assert max(map(len, out.splitlines())) <= 100


def test_the_version_is_that_of_the_package(shell: Shell) -> None:
    assert shell("--version") == (0, f"{version('passiflex')}\n", "")
    assert passiflex.__version__ == version("passiflex")
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8").splitlines()
    assert f"version: {passiflex.__version__}" in citation
    assert "version" in tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dynamic"]


@pytest.mark.parametrize(
    ("word", "kind", "nearest"),
    [("simulat", "command", "simulate"), ("recomend", "command", "recommend"), ("--hepl", "option", "--help"),
     ("--versoin", "option", "--version")],
)  # fmt: skip
def test_a_wrong_first_word_is_one_line_with_the_nearest(
    shell: Shell, word: str, kind: str, nearest: str
) -> None:
    for more in ([], ["--out", "x.nc"]):
        status, out, err = shell(word, *more)
        assert (status, out) == (2, "")
        assert err.startswith(f"passiflex: unknown {kind}; got '{word}'; needs one of ")
        assert f"; try '{nearest}'" in err
        assert err.count("\n") == 1


def test_every_function_of_a_command_is_in_the_table() -> None:
    modules = {command.place.partition(":")[0] for command in COMMANDS}
    public = {
        f"{module}:{name}"
        for module in modules
        for name, value in vars(importlib.import_module(module)).items()
        if inspect.isfunction(value) and value.__module__ == module and not name.startswith("_")
    }
    assert public == {command.place for command in COMMANDS}


def test_the_application_has_the_commands_of_the_table() -> None:
    app = application()
    first = list(dict.fromkeys(command.name.split()[0] for command in COMMANDS))
    assert [name for name in app if not name.startswith("-")] == first
    for command in COMMANDS:
        *above, name = command.name.split()
        holder = app[above[0]] if above else app
        assert holder[name].default_command.__name__ == name.replace("-", "_")


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_is_understood(example: str) -> None:
    name, *arguments = shlex.split(example)
    command, _, _ = application().parse_args(arguments, exit_on_error=False, print_error=False)
    assert name == "passiflex"
    assert command.__name__ == arguments[0]


@pytest.mark.parametrize("shell_name", ["bash", "zsh", "fish"])
def test_the_shell_completes_commands_and_options(shell_name: str) -> None:
    script = application().generate_completion(shell=shell_name)  # type: ignore[arg-type]
    for word in ("simulate", "recommend", "inner-loop"):
        assert word in script
