"""The command line, called within this process."""

from __future__ import annotations

import sys
from typing import NamedTuple

import pytest

from passiflex.cli import main


class Result(NamedTuple):
    """What a call of the command line left behind."""

    status: int
    out: str
    err: str


class Shell:
    """Calls the command line; a traceback is never right."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
        self._monkeypatch, self._capsys = monkeypatch, capsys

    def __call__(self, *arguments: object) -> Result:
        self._monkeypatch.setattr(sys, "argv", ["passiflex", *map(str, arguments)])
        self._capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main()
        captured = self._capsys.readouterr()
        assert "Traceback" not in captured.out + captured.err
        return Result(int(end.value.code or 0), captured.out, captured.err)
