"""The terminal: how commands print, and how they show that they work."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.text import Text

from passiflex.cli.streams import drop_output, leave_closed_pipe, printable
from passiflex.files import OutputError

if TYPE_CHECKING:
    from passiflex.chunks.run_chunks import Progress


class PlainConsole(Console):
    """A console for which text is text: no markup, no emoji codes, no sequences that steer a terminal."""

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, soft_wrap=True, highlight=False, markup=False, emoji=False)

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
aside = PlainConsole(stderr=True)
"""What is said about the work: it does not come between the lines of an answer that is piped on."""


@contextmanager
def timed() -> Iterator[None]:
    """Print how long the block took, if it got to its end."""
    start = time.perf_counter()
    yield
    aside.print(f"took {time.perf_counter() - start:.1f} s")


@contextmanager
def progress_lines() -> Iterator[Callable[[str], None]]:
    """Give a function that shows what is being done: live on a terminal, a line each otherwise."""
    if not aside.is_terminal:
        yield lambda text: aside.print(text)
        return
    with aside.status("starting") as status:

        def report(text: str) -> None:
            status.update(aside.render_str(text))

        yield report


@contextmanager
def campaign_bar() -> Iterator[Callable[[Progress], None]]:
    """Give a function that shows how far a campaign is: a bar on a terminal, a line now and then otherwise."""
    if not aside.is_terminal:
        from passiflex.chunks.run_chunks import sparsely

        yield sparsely(lambda p: aside.print(f"{p.done} of {p.total} samples, {_words(p)}"))
        return
    import rich.progress as parts

    columns = (
        parts.BarColumn(), parts.MofNCompleteColumn(), parts.TextColumn("{task.description}", markup=False),
        parts.TimeElapsedColumn(),
    )  # fmt: skip
    with parts.Progress(*columns, console=aside) as bar:
        task = bar.add_task("compiling and starting", total=None)

        def show(progress: Progress) -> None:
            bar.update(task, total=progress.total, completed=progress.done, description=_words(progress))

        yield show


def _words(progress: Progress) -> str:
    verdicts = ", ".join(f"{count} {name}" for name, count in sorted(progress.verdicts.items()))
    return f"{progress.rate:.3g}/s, {progress.remaining:.0f} s left: {verdicts}"
