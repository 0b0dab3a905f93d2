"""The terminal: the application that commands register with, and how they show that they work."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import cyclopts
from rich.console import Console

if TYPE_CHECKING:
    from passiflex.pieces.run_pieces import Progress

app = cyclopts.App(
    name="passiflex",
    help="Passive Cartesian impedance control of flexible-joint robots, with its energy accounted for.",
    suppress_keyboard_interrupt=False,  # main says what an interruption means
)
console = Console(soft_wrap=True, highlight=False)


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
            status.update(text)

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
        parts.BarColumn(), parts.MofNCompleteColumn(), parts.TextColumn("{task.description}"),
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
