"""The terminal: the application that commands register with, and how they show that they work."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NoReturn

import cyclopts
from rich.console import Console
from rich.text import Text

from passiflex.files import OutputError

if TYPE_CHECKING:
    from passiflex.pieces.run_pieces import Progress

CLOSED_PIPE = 141
"""Exit status when nobody reads on, as that of a program that SIGPIPE ends."""
_CONTROLS = {
    code: "\N{REPLACEMENT CHARACTER}" for code in (*range(32), *range(127, 160)) if code not in (9, 10)
}


class PlainConsole(Console):
    """A console for which text is text: no markup, no emoji codes, no sequences that steer a terminal."""

    def __init__(self) -> None:
        super().__init__(soft_wrap=True, highlight=False, markup=False, emoji=False)

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a text as it is shown, in lines and tables alike."""
        return super().render_str(printable(text), **options)

    def print(self, *objects: Any, **options: Any) -> None:
        """Print, or raise OutputError where that cannot be done, as on a full disk."""
        try:
            super().print(*objects, **options)
        except OSError as error:
            drop_output()
            raise OutputError("cannot print", got=error.strerror) from error

    def on_broken_pipe(self) -> None:
        """End quietly when nobody reads on."""
        leave_closed_pipe()


console = PlainConsole()
app = cyclopts.App(
    name="passiflex",
    help="Passive Cartesian impedance control of flexible-joint robots, with its energy accounted for.",
    console=console,
    suppress_keyboard_interrupt=False,  # main says what an interruption means
)


def printable(text: str) -> str:
    """Return a text without characters that steer a terminal."""
    return text.translate(_CONTROLS)


def replace_what_cannot_be_shown() -> None:
    """Make the streams show a replacement for what their encoding does not have, in place of an error."""
    for stream, how in ((sys.stdout, "replace"), (sys.stderr, "backslashreplace")):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors=how)


def leave_closed_pipe() -> NoReturn:
    """End without another word."""
    drop_output()
    raise SystemExit(CLOSED_PIPE)


def drop_output() -> None:
    """Send what is left in the stream's buffer nowhere, or the end of the process would try it again."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)


@contextmanager
def timed() -> Iterator[None]:
    """Print how long the block took, if it got to its end."""
    start = time.perf_counter()
    yield
    console.print(f"took {time.perf_counter() - start:.1f} s")


@contextmanager
def progress_lines() -> Iterator[Callable[[str], None]]:
    """Give a function that shows what is being done: live on a terminal, a line each otherwise."""
    if not console.is_terminal:
        yield lambda text: console.print(text)
        return
    with console.status("starting") as status:

        def report(text: str) -> None:
            status.update(console.render_str(text))

        yield report


@contextmanager
def campaign_bar() -> Iterator[Callable[[Progress], None]]:
    """Give a function that shows how far a campaign is: a bar on a terminal, a line now and then otherwise."""
    if not console.is_terminal:
        from passiflex.pieces.run_pieces import sparsely

        yield sparsely(lambda p: console.print(f"{p.done} of {p.total} samples, {_words(p)}"))
        return
    import rich.progress as parts

    columns = (
        parts.BarColumn(), parts.MofNCompleteColumn(), parts.TextColumn("{task.description}", markup=False),
        parts.TimeElapsedColumn(),
    )  # fmt: skip
    with parts.Progress(*columns, console=console) as bar:
        task = bar.add_task("compiling and starting", total=None)

        def show(progress: Progress) -> None:
            bar.update(task, total=progress.total, completed=progress.done, description=_words(progress))

        yield show


def _words(progress: Progress) -> str:
    verdicts = ", ".join(f"{count} {name}" for name, count in sorted(progress.verdicts.items()))
    return f"{progress.rate:.3g}/s, {progress.remaining:.0f} s left: {verdicts}"
