"""The streams that a command prints to: what they cannot show, and readers that leave."""

from __future__ import annotations

import os
import sys
from typing import NoReturn

CLOSED_PIPE = 141
"""Exit status when nobody reads on, as that of a program that SIGPIPE ends."""
_CONTROLS = {
    code: "\N{REPLACEMENT CHARACTER}" for code in (*range(32), *range(127, 160)) if code not in (9, 10)
}


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
