"""Packages that only some users need: imported when they are used, asked for by name when they are missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from passiflex.errors import PassiflexError


class MissingExtraError(PassiflexError):
    """A package that is asked for is not installed."""


def imported(module: str, extra: str, purpose: str) -> Any:
    """Return a module of one of the package's extras.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        what = f"{purpose} needs the package {module.partition('.')[0]!r}, which cannot be imported"
        raise MissingExtraError(
            what, got=error, try_=f"pip install 'passiflex[{extra}]', in a checkout `make extras`"
        ) from error
