"""A process that runs one compilation for its parent, and leaves neither compiler nor folder if that is killed.

    python -I -S builder.py

It reads a request from its standard input, which its parent keeps open: the end of it is the end of the parent. It
answers with one line of JSON. Nothing of the package is imported, so that it starts at once.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

SEAL = b"\npassiflex %016x %s\n"
"""What follows the bytes of a library in its file: their number and their SHA-256."""
SEAL_SIZE = len(SEAL % (0, b"0" * 64))
LAST_LINES = 12
"""Lines of the compiler's own words that are handed on."""


def sealed(content: bytes) -> bytes:
    """Return the file of a library: loaders do not read beyond what a library says of itself."""
    return content + SEAL % (len(content), hashlib.sha256(content).hexdigest().encode())


def is_sealed(data: bytes) -> bool:
    """Return whether a file is the library that was written, complete and to the last bit."""
    return len(data) > SEAL_SIZE and sealed(data[:-SEAL_SIZE]) == data


def build(request: dict[str, Any]) -> dict[str, Any]:
    """Return how a compilation ended, after putting the library in its place in one step.

    Parameters
    ----------
    request: `source`, C text; `before` and `after`, the words of the command around input and output; `target`,
        the file of the library, or null to see only whether it compiles.
    """
    target = Path(request["target"]) if request["target"] else None
    folder = Path(tempfile.mkdtemp(prefix="build-", dir=target and target.parent))
    try:
        text, built = folder / "generated.c", folder / "built"
        text.write_text(request["source"], encoding="utf-8")
        words = [*request["before"], str(text), "-o", str(built), *request["after"]]
        try:
            status, said = _compile(words, folder)
        except OSError as error:
            return {"unstarted": str(error)}
        if status or not built.is_file():
            return {"status": status, "said": "\n".join(said.splitlines()[-LAST_LINES:])}
        if target is not None:
            _put(built, target)
        return {"status": None}
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _compile(words: list[str], folder: Path) -> tuple[int, str]:
    """Return exit status and words of a compiler that ends with the parent, and so do its own processes."""
    with subprocess.Popen(
        words,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        env=os.environ | {"TMPDIR": str(folder)},
        process_group=0,
    ) as compiler:
        threading.Thread(target=_end_with_parent, args=(compiler,), daemon=True).start()
        said = compiler.communicate()[1]
    return compiler.returncode, said


def _end_with_parent(compiler: subprocess.Popen[str]) -> None:
    os.read(0, 1)
    if compiler.poll() is None:
        with suppress(ProcessLookupError):
            os.killpg(compiler.pid, signal.SIGKILL)


def _put(built: Path, target: Path) -> None:
    """Move a library to its place, sealed; nobody else may ever write it, whatever the umask."""
    with built.open("r+b") as file:
        content = file.read()
        file.write(sealed(content)[len(content) :])
        os.fchmod(file.fileno(), os.fstat(file.fileno()).st_mode & 0o755)
        file.flush()
        os.fsync(file.fileno())  # a name must never come to stand for half a library, even after a power cut
    os.replace(built, target)


def main() -> None:
    """Answer the one request of the parent."""
    line = sys.stdin.buffer.readline()
    if not line.endswith(b"\n"):
        return  # the parent is gone already
    try:
        answer = build(json.loads(line))
    except OSError as error:
        answer = {"error": [error.errno, error.strerror, error.filename]}
    with suppress(BrokenPipeError):
        os.write(1, json.dumps(answer).encode())


if __name__ == "__main__":
    main()
