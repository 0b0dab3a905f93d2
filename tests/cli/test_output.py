"""What the command line prints arrives as it is, whatever the terminal, the reader or the names are."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from rich.table import Table

import passiflex.cli
from cli.shell import Shell
from passiflex.cli.terminal import PlainConsole, progress_lines
from passiflex.errors import PassiflexError

NAMES = ("[alt]", "[red]", "[/x]", "[link=file:///etc/passwd]l", ":warning:", "a\\[b]", "$x$", "{x}")


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(monkeypatch, capsys)


def command(monkeypatch: pytest.MonkeyPatch, does: Callable[[], Any]) -> None:
    """Make the command line do this, whatever it is told."""
    monkeypatch.setattr(sys, "argv", ["passiflex", "robots"])
    monkeypatch.setattr(passiflex.cli, "application", lambda: lambda *_, **__: does())


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_printed_as_it_is(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    console, table = PlainConsole(), Table(name, title=name)
    table.add_row(name)
    console.print(f"wrote {name}/run.nc")
    console.print(table)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"wrote {name}/run.nc"
    assert sum(name in line for line in lines) == 4


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_shown_as_it_is_while_work_goes_on(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setattr("passiflex.cli.terminal.aside", PlainConsole(stderr=True))
    with progress_lines() as report:
        report(name)
    assert name in capsys.readouterr().err


def test_a_name_does_not_steer_the_terminal(capsys: pytest.CaptureFixture[str], shell: Shell) -> None:
    PlainConsole().print("wrote \x1b[2J\x9b1m\r\x07.nc")
    assert capsys.readouterr().out == "wrote \ufffd[2J\ufffd1m\ufffd\ufffd.nc\n"
    assert "\x1b" not in shell("audit", "\x1b[2J.nc").err


def test_a_mistake_in_a_name_with_brackets_is_one_message(shell: Shell, tmp_path: Path) -> None:
    status, out, err = shell("audit", tmp_path / "x[/b].nc")
    assert (status, out) == (2, "")
    assert f"no such file: {tmp_path}/x[/b].nc" in err


@pytest.mark.parametrize(
    ("error", "status"),
    [(ZeroDivisionError("x"), 70), (MemoryError(), 70), (RecursionError(), 70), (FileNotFoundError("x"), 70),
     (PassiflexError("wrong"), 2), (KeyboardInterrupt(), 130)],
)  # fmt: skip
def test_a_fault_of_ours_is_told_from_a_verdict(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: BaseException, status: int
) -> None:
    def fail() -> None:
        raise error

    command(monkeypatch, fail)
    with pytest.raises(SystemExit) as end:
        passiflex.cli.main()
    assert end.value.code == status
    err = capsys.readouterr().err
    assert ("fault of passiflex" in err) == ("Traceback" in err) == (status == 70)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_an_ended_command_is_quiet_and_tidies_up(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    tidied = []

    def work() -> None:
        try:
            os.kill(os.getpid(), number)
            pytest.fail("the signal did not arrive")
        finally:
            tidied.append(True)

    before = signal.signal(number, signal.SIG_DFL)
    command(monkeypatch, work)
    try:
        assert shell("robots") == (128 + number, "", "")
        assert signal.getsignal(number) is signal.SIG_DFL
    finally:
        signal.signal(number, before)
    assert tidied


def test_a_signal_that_somebody_handles_stays_theirs(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []

    def note(number: int, _: FrameType | None) -> None:
        seen.append(number)

    before = signal.signal(signal.SIGHUP, note)
    command(monkeypatch, lambda: os.kill(os.getpid(), signal.SIGHUP))
    try:
        assert shell("robots").status == 0
    finally:
        signal.signal(signal.SIGHUP, before)
    assert seen == [signal.SIGHUP]


def robots(**popen: Any) -> subprocess.CompletedProcess[bytes]:
    words = [sys.executable, "-c", "from passiflex.cli import main; main()", "robots"]
    return subprocess.run(words, stderr=subprocess.PIPE, timeout=60, check=False, **popen)


def test_a_reader_that_leaves_is_no_fault() -> None:
    read, write = os.pipe()
    os.close(read)
    try:
        done = robots(stdout=write)
    finally:
        os.close(write)
    assert (done.returncode, done.stderr) == (128 + signal.SIGPIPE, b"")


def test_a_terminal_without_the_letters_gets_others() -> None:
    done = robots(stdout=subprocess.PIPE, env=os.environ | {"PYTHONIOENCODING": "ascii"})
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"?" in done.stdout
    assert b"iiwa14" in done.stdout.decode("ascii").encode()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_under_the_output_is_one_line() -> None:
    with open("/dev/full", "wb") as full:
        done = robots(stdout=full)
    assert done.returncode == 2
    assert done.stderr == b"passiflex: cannot print; got No space left on device\n"
