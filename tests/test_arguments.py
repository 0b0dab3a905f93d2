"""Every function of the face is given what it does not take: an error of the package, which says what it does."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import passiflex as pf
from passiflex.errors import ArgumentError, PassiflexError
from passiflex.reports import report_text
from passiflex.simulation import resolve

NO_RUN: list[Any] = [None, "", "run.nc", Path("run.nc"), {}, [], 5, b"x", io.StringIO(), object()]
NO_PATH: list[Any] = [None, "", " ", {}, [], 5, b"x", io.StringIO(), object(), 1.5]


@pytest.mark.parametrize("function", [pf.audit, pf.show, report_text])
@pytest.mark.parametrize("given", NO_RUN, ids=lambda given: type(given).__name__)
def test_what_is_no_run(function: Callable[[Any], Any], given: Any) -> None:
    with pytest.raises(ArgumentError, match=r"needs a run, as simulate returns; try Run.load for a file"):
        function(given)


@pytest.mark.parametrize(
    "function",
    [
        pf.salvage,
        pf.Run.load,
        pf.load_scenario,
        pf.load_campaign,
        lambda given: pf.replay(given, 0),
        lambda given: pf.run_campaign(given, "nowhere"),
        lambda given: pf.recommend(given, 1000),
        pf.FlexibleJointRobot.load,
        pf.simulate,
        pf.check,
        resolve,
    ],
)
@pytest.mark.parametrize("given", NO_PATH, ids=lambda given: type(given).__name__)
def test_what_is_no_path(function: Callable[[Any], Any], given: Any, tmp_path: Path) -> None:
    with pytest.raises(PassiflexError) as error:
        function(given)
    assert len(str(error.value)) < 1000


def test_a_part_of_a_message_is_bearable() -> None:
    assert len(str(PassiflexError("x" * 10**6, got="y" * 10**6, needs="z" * 10**6))) < 31_000
    message = "\n".join(f"line {i}" for i in range(300))
    assert str(PassiflexError("it failed", got=message)) == f"it failed; got {message}"
