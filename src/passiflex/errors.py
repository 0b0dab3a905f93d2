"""The exception tree: every message says *what* is wrong, what was *got*, what is *needed*, what to *try*."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_LONGEST = 10_000
"""Characters of one part of a message: what compilers say fits, a name of a megabyte does not."""
_LONGEST_NAME = 200
"""Characters of a word for which a near one is looked for; the search is quadratic."""


class PassiflexError(Exception):
    """Base of all errors that a wrong use of the package raises.

    Parameters
    ----------
    what: What is wrong, in one clause.
    got: The offending value, as evidence.
    needs: What would have been right.
    try_: What the caller can do next.
    """

    def __init__(self, what: str, *, got: object = None, needs: str | None = None, try_: str | None = None):
        self.what, self.got, self.needs, self.try_ = what, got, needs, try_
        parts = [what]
        if got is not None:
            parts.append(f"got {got}")
        if needs:
            parts.append(f"needs {needs}")
        if try_:
            parts.append(f"try {try_}")
        super().__init__("; ".join(map(_bearable, parts)))


class RobotError(PassiflexError):
    """A robot description cannot be used: URDF, catalogue entry, or its numbers."""


class SizeError(PassiflexError):
    """A value has the wrong shape."""


class ValueRangeError(PassiflexError):
    """A value is outside its range, not finite, or a matrix lacks a required definiteness."""


class NameUnknownError(PassiflexError):
    """A name is not known; the message lists the nearest ones, and of very many known ones the first."""

    MOST_LISTED = 50

    def __init__(self, kind: str, got: str, known: Iterable[str]):
        names = sorted(known)
        near = nearest(str(got), names)
        super().__init__(
            f"unknown {kind}",
            got=repr(got),
            needs=f"one of {', '.join(names[: self.MOST_LISTED])}{', ...' * (len(names) > self.MOST_LISTED)}",
            try_=" or ".join(repr(n) for n in near) if near else None,
        )


class CompilerError(PassiflexError):
    """Generated C could not be compiled or loaded."""


class ScenarioError(PassiflexError):
    """A scenario file has mistakes; `mistakes` holds one line for each."""

    def __init__(self, source: str, mistakes: list[str]):
        self.mistakes = mistakes
        super().__init__(
            f"{source}: {len(mistakes)} mistake{'s' * (len(mistakes) != 1)}\n  "
            + "\n  ".join(map(_bearable, mistakes))
        )


class FrozenError(PassiflexError):
    """A value was to be changed in place; a changed copy is what to make."""

    def __init__(self, kind: str, got: str, try_: str):
        super().__init__(f"{kind} is frozen", got=got, needs="a changed copy", try_=try_)


class ArgumentError(PassiflexError):
    """An argument is of another kind than what a function takes."""

    def __init__(self, got: object, needs: str, try_: str | None = None):
        super().__init__("wrong kind of argument", got=shown(got), needs=needs, try_=try_)


class SimulationError(PassiflexError):
    """A run cannot be started, or left the finite numbers."""


class RunFileError(PassiflexError):
    """A file is not a complete run of this package."""


class PassiflexWarning(UserWarning):
    """Something works, but not as well as it could; the message says what to do."""


def nearest(name: str, known: Iterable[str]) -> list[str]:
    """Return up to three known names that are close to `name`, best first."""
    return difflib.get_close_matches(name, list(known), n=3, cutoff=0.5) if len(name) <= _LONGEST_NAME else []


def shown(value: object) -> str:
    """Return the value as evidence, on one line and not long."""
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _bearable(part: str) -> str:
    """Return a part of a message, without its middle if it is very long."""
    half = _LONGEST // 2
    return part if len(part) <= _LONGEST else f"{part[:half]} ... {part[-half:]}"


class UnstableLoopError(PassiflexError):
    """A law that does not hold at its control rate and delay: in three lines its cause, a number and a remedy."""

    def __init__(self, what: str, *, cause: str, number: str, remedy: str):
        super().__init__(what, got=number, needs=cause, try_=remedy)
        lines = [what, f"cause: {cause}", f"number: {number}", f"remedy: {remedy}"]
        self.args = ("\n  ".join(lines),)
