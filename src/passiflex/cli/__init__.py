"""The command line: its commands are those of `cli.command_table`."""

from __future__ import annotations

import signal
import sys
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from passiflex.cli.front import answer
from passiflex.cli.streams import leave_closed_pipe, printable, replace_what_cannot_be_shown
from passiflex.errors import PassiflexError, PassiflexWarning

if TYPE_CHECKING:
    from types import FrameType

    from cyclopts import App

_SHOWN = warnings.showwarning
FAULT = 70
"""Exit status of a fault of ours, as sysexits.h has it: never that of a verdict."""


def application() -> App:
    """Return the command line with all its commands, each imported when it is called."""
    import cyclopts

    from passiflex.cli.command_table import GROUPS
    from passiflex.cli.front import COMPLETION
    from passiflex.cli.terminal import console
    from passiflex.version import __version__

    app = cyclopts.App(
        name="passiflex",
        version=__version__,
        console=console,
        suppress_keyboard_interrupt=False,  # main says what an interruption means
    )
    above: dict[str, App] = {}
    for wanted, group in GROUPS.items():
        for command in group:
            *first, last = command.name.split()
            for word in first:
                if word not in above:
                    above[word] = cyclopts.App(name=word, group=wanted)
                    app.command(above[word])
            (above[first[0]] if first else app).command(command.place, name=last, group=wanted)
    app.register_install_completion_command(name=COMPLETION)
    return app


def main() -> None:
    """Run the command line; a mistake of the user ends with one line on what to do, not with a traceback.

    The exit status is that of the command; 2 for a mistake of the user, FAULT for one of ours, 128 and the number
    of the signal for an interruption, CLOSED_PIPE where nobody reads what is printed.
    """
    replace_what_cannot_be_shown()
    warnings.showwarning = _say
    try:
        with _ended_quietly():
            status = _run(sys.argv[1:])
            if sys.stdout is not None:
                sys.stdout.flush()
    except PassiflexError as error:
        print(f"passiflex: {printable(str(error))}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print(
            "passiflex: interrupted; nothing is half-written, and the same command goes on", file=sys.stderr
        )
        sys.exit(128 + signal.SIGINT)
    except BrokenPipeError:
        leave_closed_pipe()
    except Exception:
        traceback.print_exc()
        print("passiflex: this is a fault of passiflex, not of yours; please report it", file=sys.stderr)
        sys.exit(FAULT)
    sys.exit(status if isinstance(status, int) else 0)


def _say(message: Warning | str, *where: object, **more: object) -> None:
    """Print a warning: of ours on one line, without the place in the source that a programmer would look for."""
    if isinstance(message, PassiflexWarning):
        print(f"passiflex: warning: {printable(str(message))}", file=sys.stderr)
    else:
        _SHOWN(message, *where, **more)  # type: ignore[arg-type]


def _run(arguments: list[str]) -> object:
    """Return what a command returned; 0 where the front has the answer, before anything is imported for it."""
    if (text := answer(arguments)) is None:
        return application()(arguments, result_action="return_value")
    print(text)
    return 0


@contextmanager
def _ended_quietly() -> Iterator[None]:
    """Let the signals that end a program end this one with its exit status, after what a `finally` has to do."""

    def end(number: int, _: FrameType | None) -> None:
        raise SystemExit(128 + number)

    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    ours = [number for number, handler in before.items() if handler is signal.SIG_DFL]  # as nohup ignores one
    for number in ours:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)
