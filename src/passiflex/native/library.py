"""CasADi functions → C → one shared library, kept under the hash of everything that shaped it.

The key covers the C text, compiler, flags, CasADi version and processor, so a library in the cache is
never stale. Generating the C text again costs 1–2 µs per node; it is not worth a cache of its own.
"""

from __future__ import annotations

import atexit
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

from passiflex.errors import CompilerError, PassiflexWarning, ValueRangeError
from passiflex.native.builder import SEAL
from passiflex.native.cache import (
    DistrustError,
    NoCacheError,
    cache_folder,
    is_there,
    make_folder,
    own_folder,
)
from passiflex.native.cache import loads as _loads
from passiflex.native.compiler import SUFFIX, Compiler, find_compiler

WRITABLE = "set PASSIFLEX_CACHE to a folder that can be written"
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
_INCLUDED = re.compile(r'^#include "(.*)"$', re.MULTILINE)


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
    name = _key(source, compiler) + SUFFIX
    return _from_cache(compiler, source, name) or _ready(compiler, source, _fallback_folder() / name)


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
    """Return the text of one of the C files of this folder, with those that it includes in their places."""
    text = resources.files("passiflex.native").joinpath(name).read_text(encoding="utf-8")
    return _INCLUDED.sub(lambda found: c_source(found[1]), text)


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


def _from_cache(compiler: Compiler, source: str, name: str) -> Path | None:
    """Return the library in the user's cache; None, after a warning, if that cannot hold one."""
    try:
        return _ready(compiler, source, own_folder(make_folder(cache_folder())) / name)
    except DistrustError as error:
        why = f"the cache folder is not safe ({error})"
        remedy = "make it yours alone (chmod go-w), or set PASSIFLEX_CACHE to a folder that is"
    except NoCacheError as error:
        why, remedy = f"{error.what} ({error.got})", WRITABLE
    except OSError as error:
        why, remedy = f"the cache folder cannot be written ({error.strerror})", WRITABLE
    _warn_once(f"{why}: libraries are compiled again in every process; {remedy}")
    return None


def _ready(compiler: Compiler, source: str, path: Path) -> Path:
    """Return the path of a library, after compiling it there if what is there is not to be loaded."""
    path, folder_there = _beside_folders(path)
    if _loads(path):
        return path
    there = folder_there or is_there(path)
    compiler.build(source, path)
    if there:
        _warn_once(f"libraries in {path.parent} are damaged or not this user's: they are compiled again")
    if not _loads(path):
        raise CompilerError(
            "the compiled library does not load",
            got=path,
            needs="a folder from which libraries may be loaded, and a compiler for this processor",
            try_="setting PASSIFLEX_CACHE to another folder (is this one noexec?)",
        )
    return path


def _beside_folders(path: Path) -> tuple[Path, bool]:
    """Return a library's path, with another name if a folder has its own: that cannot be replaced; and if one has."""
    was = path
    while path.is_dir() and not path.is_symlink():
        path = path.with_name(f"_{path.name}")
    return path, path != was


def _key(source: str, compiler: Compiler) -> str:
    parts = (source, compiler.identity, *compiler.flags, cs.__version__, platform.machine(), _processor())
    return hashlib.sha256(SEAL + "\0".join(parts).encode()).hexdigest()  # before, libraries had no seal


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


def _fallback_folder() -> Path:
    """Return a private folder that lives as long as this process; another one, should it be removed meanwhile.

    Raises
    ------
    CompilerError
        If no temporary folder can be made.
    """
    try:
        try:
            return own_folder(_process_folder(os.getpid()))
        except (OSError, DistrustError):
            _process_folder.cache_clear()
            return own_folder(_process_folder(os.getpid()))
    except OSError as error:
        raise CompilerError(
            "there is no folder for compiled libraries", got=error, try_="setting PASSIFLEX_CACHE or TMPDIR"
        ) from error


@functools.cache
def _process_folder(process: int) -> Path:
    """Return a new folder of this process; a fork makes its own, and leaves that of its parent alone."""
    folder = tempfile.mkdtemp(prefix="passiflex-")

    def remove() -> None:
        if os.getpid() == process:
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    return Path(folder)


@functools.cache
def _warn_once(text: str) -> None:
    warnings.warn(text, PassiflexWarning, stacklevel=3)
