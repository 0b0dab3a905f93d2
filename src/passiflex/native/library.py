"""CasADi functions → C → one shared library, kept under the hash of everything that shaped it.

The key covers the C text, compiler, flags, CasADi version and processor, so a library in the cache is
never stale. Generating the C text again costs 1–2 µs per node; it is not worth a cache of its own.
"""

from __future__ import annotations

import atexit
import ctypes
import functools
import hashlib
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import casadi as cs
import platformdirs

from passiflex.errors import CompilerError, PassiflexWarning, ValueRangeError
from passiflex.native.compiler import SUFFIX, Compiler, find_compiler

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")


def compile_functions(functions: Sequence[cs.Function], *, driver: str = "") -> Path | None:
    """Return a shared library that holds `functions`, from the cache or compiled now.

    Parameters
    ----------
    functions: The functions; each is exported under its own name.
    driver: C text of the package to append, which may call the generated code.

    Returns
    -------
    The path of the library; None, after one warning per process, if there is no compiler.

    Raises
    ------
    ValueRangeError
        For a function name that is not a plain C name, or is given twice.
    CompilerError
        If the compiler fails, or the library does not load.
    """
    _check_names([f.name() for f in functions])
    if find_compiler() is None:
        _warn_once(
            "no C compiler: functions run in CasADi's virtual machine, about 30 times slower; "
            "install a C compiler (gcc or clang) or the extra passiflex[zig]"
        )
        return None
    return compile_source(generate(functions, driver))


def compile_source(source: str) -> Path:
    """Return a shared library of a C text, from the cache or compiled now.

    Raises
    ------
    CompilerError
        If there is no compiler, it fails, or the library does not load.
    """
    compiler = find_compiler()
    if compiler is None:
        raise CompilerError("no C compiler", needs="gcc, clang, or the extra passiflex[zig]")
    path = cache_folder() / (_key(source, compiler) + SUFFIX)
    if _loads(path):
        return path
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        workspace = tempfile.TemporaryDirectory(prefix="build-", dir=path.parent)
    except OSError as error:
        _warn_once(
            f"the cache folder cannot be written ({error}): libraries are compiled again in every process; "
            "set PASSIFLEX_CACHE to a folder that can be written"
        )
        path = _process_folder() / path.name
        if _loads(path):
            return path
        workspace = tempfile.TemporaryDirectory(prefix="build-", dir=path.parent)
    with workspace as folder:
        _build(compiler, source, Path(folder), path)
    if not _loads(path):
        raise CompilerError(
            "the compiled library does not load",
            got=path,
            needs="a folder from which libraries may be loaded, and a compiler for this processor",
            try_="setting PASSIFLEX_CACHE to another folder (is this one noexec?)",
        )
    return path


def load_external(name: str, path: Path, **opts: Any) -> cs.Function:
    """Return function `name` of the library `path` for CasADi, differentiated by finite differences.

    Raises
    ------
    CompilerError
        If the library has no such function.
    """
    try:
        return cs.external(name, str(path), {"enable_fd": True, **opts})
    except RuntimeError as error:
        raise CompilerError(f"function {name!r} cannot be loaded", got=f"{path}: {error}") from error


def generate(functions: Sequence[cs.Function], driver: str = "") -> str:
    """Return the C text of `functions`, of the loop over columns, and of `driver`."""
    generator = cs.CodeGenerator(
        "passiflex", {"with_header": False, "casadi_int": "long long int", "casadi_real": "double"}
    )
    for f in functions:
        generator.add(f)
    return "\n".join((generator.dump(), c_source("columns.c"), driver))


def c_source(name: str) -> str:
    """Return the text of one of the C files of this folder."""
    return resources.files("passiflex.native").joinpath(name).read_text(encoding="utf-8")


def cache_folder() -> Path:
    """Return the folder of compiled libraries: `$PASSIFLEX_CACHE`, else the user's cache folder."""
    return Path(os.environ.get("PASSIFLEX_CACHE") or platformdirs.user_cache_dir("passiflex")).absolute()


def _check_names(names: list[str]) -> None:
    for name in names:
        if not _NAME.fullmatch(name):
            raise ValueRangeError(
                "function name cannot be used in C",
                got=repr(name),
                needs="a letter, then up to 63 letters, digits or underscores",
            )
        if names.count(name) > 1:
            raise ValueRangeError(
                "function name is given twice", got=repr(name), needs="a name for each function"
            )


def _build(compiler: Compiler, source: str, workspace: Path, path: Path) -> None:
    """Compile in `workspace`, on the same file system, then put the library in place in one step."""
    text, built = workspace / "generated.c", workspace / path.name
    text.write_text(source, encoding="utf-8")
    compiler.build(text, built)
    with built.open("rb") as file:
        os.fsync(file.fileno())  # a name must never come to stand for half a library, even after a power cut
    os.replace(built, path)


def _loads(path: Path) -> bool:
    """Return whether `path` is a library that can be loaded (absent, empty and damaged files are not)."""
    try:
        if path.stat().st_size == 0:
            return False
        ctypes.CDLL(str(path))
    except OSError:
        return False
    return True


def _key(source: str, compiler: Compiler) -> str:
    parts = (source, compiler.identity, *compiler.flags, cs.__version__, platform.machine(), _processor())
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


@functools.cache
def _processor() -> str:
    """Return the processor's model and features: code for one may not run on another."""
    if sys.platform == "darwin":
        command = ["sysctl", "-n", "machdep.cpu.brand_string"]
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout
    try:
        first = Path("/proc/cpuinfo").read_text().split("\n\n")[0]
    except OSError:
        return platform.processor()
    kept = ("model name", "flags", "features", "cpu part", "isa")
    return "\n".join(line for line in first.splitlines() if line.lower().startswith(kept))


@functools.cache
def _process_folder() -> Path:
    """Return a private folder that lives as long as this process."""
    folder = tempfile.mkdtemp(prefix="passiflex-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


@functools.cache
def _warn_once(text: str) -> None:
    warnings.warn(text, PassiflexWarning, stacklevel=3)
