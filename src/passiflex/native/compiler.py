"""Find a C compiler and turn one C file into one shared library.

The order is `$CC`, then `cc`, `gcc`, `clang` on the path, then the C compiler inside the package
`ziglang` (the extra `passiflex[zig]`). `PASSIFLEX_COMPILER=none` looks for none; `=zig` takes that one.
`PASSIFLEX_OPTIMISE` says how hard it tries, 2 unless given: with 1 code is there in half the time.
"""

from __future__ import annotations

import functools
import importlib.metadata
import importlib.util
import json
import os
import platform
import shlex
import shutil
import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from passiflex.errors import CompilerError, NameUnknownError
from passiflex.native import builder

# Only what the header exports is visible: calls inside the library can then be inlined.
FLAGS = (
    "-fPIC",
    "-dynamiclib" if sys.platform == "darwin" else "-shared",
    "-fno-math-errno",
    "-ffp-contract=fast",
    "-fvisibility=hidden",
    "-DGCC_HASCLASSVISIBILITY",
)
LEVELS = ("0", "1", "2", "3")
SUFFIX = ".dylib" if sys.platform == "darwin" else ".so"
PROBE = "double probe(double x) { return x + 1; }\n"
_ZIG_MACHINES = {"amd64": "x86_64", "arm64": "aarch64", "i686": "x86", "ppc64le": "powerpc64le"}


@dataclass(frozen=True)
class Compiler:
    """One usable C compiler.

    Parameters
    ----------
    argv: The command and its fixed arguments.
    identity: Path and version; two compilers with the same identity make the same code.
    flags: The flags that every compilation gets.
    """

    argv: tuple[str, ...]
    identity: str
    flags: tuple[str, ...] = ("-O2", *FLAGS)

    def build(self, source: str, target: Path | None) -> None:
        """Compile a C text into the shared library `target`, whole or not at all; only try to, if that is None.

        A process of its own does it: were this one killed, it would end the compiler and remove what it has made.

        Raises
        ------
        CompilerError
            With the last lines that the compiler wrote.
        OSError
            If the library cannot be written.
        """
        request = {
            "source": source,
            "before": [*self.argv, *self.flags],
            "after": ["-lm"],
            "target": target and str(target),
        }
        answer = _asked(request)
        if (error := answer.get("error")) is not None:
            raise OSError(*error)
        if (why := answer.get("unstarted")) is not None:
            raise CompilerError("the C compiler cannot be started", got=f"{self.argv[0]}: {why}")
        if (status := answer["status"]) is not None:
            raise CompilerError(
                f"{shlex.join(self.argv)} stopped with exit status {status} and made no library",
                got=f"\n{answer['said']}\n",
                try_="another compiler in $CC, or PASSIFLEX_COMPILER=none to run without one, slower",
            )


def _asked(request: dict[str, Any]) -> dict[str, Any]:
    """Return the answer of a builder."""
    words = [sys.executable, "-I", "-S", builder.__file__]
    try:
        begun = subprocess.Popen(
            words,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,  # Ctrl-C in a terminal comes by way of this process
        )
    except OSError as error:
        got = f"{sys.executable!r}: {error.strerror}"
        raise CompilerError(
            "Python cannot be started for the process that runs the compiler", got=got
        ) from error
    with begun as process:
        assert process.stdin is not None
        assert process.stdout is not None
        with suppress(BrokenPipeError):  # it has ended already, and has said why
            process.stdin.write(json.dumps(request).encode() + b"\n")
            process.stdin.flush()  # and it stays open: its end is the end of this process
        said = process.stdout.read()
        with suppress(BrokenPipeError):
            process.stdin.close()
    try:
        return dict(json.loads(said))
    except ValueError as error:
        got = said.decode(errors="replace").strip().rpartition("\n")[2] or f"exit status {process.returncode}"
        raise CompilerError("the process that runs the compiler ended", got=got) from error


def find_compiler() -> Compiler | None:
    """Return the C compiler to use, or None where there is none; asked again only if the environment changes.

    Raises
    ------
    CompilerError
        If `$CC` is set and cannot compile, or zig was asked for and is not installed.
    NameUnknownError
        If `PASSIFLEX_COMPILER` is neither "none" nor "zig", or `PASSIFLEX_OPTIMISE` is not 0 to 3.
    """
    env = os.environ
    level = env.get("PASSIFLEX_OPTIMISE", "") or "2"
    if level not in LEVELS:
        raise NameUnknownError("PASSIFLEX_OPTIMISE", level, LEVELS)
    return _find(env.get("PASSIFLEX_COMPILER", ""), env.get("CC", ""), env.get("PATH", ""), level)


@functools.cache
def _find(choice: str, cc: str, path: str, level: str) -> Compiler | None:
    if choice not in ("", "none", "zig"):
        raise NameUnknownError("PASSIFLEX_COMPILER", choice, ("none", "zig"))
    if choice == "none" or os.name == "nt":
        return None
    if choice == "zig":
        zig = _zig(level)
        if zig is None:
            raise CompilerError(
                "PASSIFLEX_COMPILER=zig finds no zig",
                needs="the package ziglang",
                try_="installing passiflex[zig]",
            )
        return zig
    if cc.strip():
        try:
            return _system(tuple(shlex.split(cc)), path, level)
        except (CompilerError, ValueError) as error:
            raise CompilerError(
                "the compiler in $CC does not work",
                got=f"CC={cc!r} ({getattr(error, 'what', error)})",
                needs="a command that compiles C",
                try_="unsetting CC",
            ) from error
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name, path=path):
            try:
                return _system((name,), path, level)
            except CompilerError:
                continue
    return _zig(level)


def _system(argv: tuple[str, ...], path: str, level: str) -> Compiler:
    """Return the compiler behind `argv`, with the flags that it was seen to accept."""
    where = shutil.which(argv[0], path=path)
    if where is None:
        raise CompilerError("no such command", got=repr(argv[0]))
    argv = (where, *argv[1:])
    version = subprocess.run(
        [*argv, "--version"], capture_output=True, text=True, errors="replace", check=False
    )
    identity = f"{shlex.join(argv)}\n{version.stdout}"
    always = (f"-O{level}", *FLAGS)
    for flags in ((*always, "-march=native"), always):
        compiler = Compiler(argv, identity, flags)
        try:
            compiler.build(PROBE, None)
        except CompilerError as error:
            failure = error
        else:
            return compiler
    raise failure


def _zig(level: str) -> Compiler | None:
    """Return the compiler of the package `ziglang`, or None where it is not installed."""
    if importlib.util.find_spec("ziglang") is None or not sys.platform.startswith(("linux", "darwin")):
        return None
    machine = _ZIG_MACHINES.get(platform.machine().lower(), platform.machine().lower())
    if sys.platform == "darwin":
        target = f"{machine}-macos"
    else:
        target = f"{machine}-linux-{'gnu' if platform.libc_ver()[0] == 'glibc' else 'musl'}"
    argv = (sys.executable, "-m", "ziglang", "cc", "-target", target, "-mcpu=native")
    return Compiler(
        argv, f"{shlex.join(argv)}\nziglang {importlib.metadata.version('ziglang')}", (f"-O{level}", *FLAGS)
    )
