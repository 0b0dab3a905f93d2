"""What the command line answers from the table of commands alone, in about the time that Python takes to start."""

from __future__ import annotations

from collections.abc import Sequence

from passiflex.cli.command_table import EXAMPLES, GROUPS
from passiflex.errors import NameUnknownError
from passiflex.version import __version__

COMPLETION = "--install-completion"
OPTIONS = ("--help", "-h", "--version", COMPLETION)
"""Of the command line itself."""


def answer(arguments: Sequence[str]) -> str | None:
    """Return the version or the list of commands, where that is what is asked for; None if a command has to answer.

    Raises
    ------
    NameUnknownError
        For a first word that is neither command nor option; the message names the nearest.
    """
    if not arguments or list(arguments) in (["--help"], ["-h"]):
        return listed()
    if list(arguments) == ["--version"]:
        return __version__
    first, commands = arguments[0], [c.name.split()[0] for group in GROUPS.values() for c in group]
    kind, known = ("option", OPTIONS) if first.startswith("-") else ("command", commands)
    if first not in known:
        raise NameUnknownError(kind, first, known)
    return None


def listed() -> str:
    """Return the list of commands, by what one wants, and examples."""
    width = max(len(command.name) for group in GROUPS.values() for command in group)
    lines = [
        "Passive Cartesian impedance control of flexible-joint robots, with its energy accounted for.",
        "",
        "usage: passiflex COMMAND ...",
    ]
    for wanted, group in GROUPS.items():
        lines += ["", f"{wanted}:"]
        lines += [f"  {command.name:{width}}  {command.line}" for command in group]
    lines += ["", "for example:", *(f"  {example}" for example in EXAMPLES), ""]
    lines += ["passiflex COMMAND --help says what a command takes. Other options:"]
    lines += ["  --version", f"  {COMPLETION}  complete commands and options in the shell"]
    return "\n".join(lines)
