"""One generated function in a loaded library, as the package's own C code calls it."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from passiflex.errors import CompilerError


class Callable(ctypes.Structure):
    """A generated function with work arrays of its own, as the package's C code calls it (`passiflex_callable`)."""

    _fields_ = (
        ("function", ctypes.c_void_p),
        ("memory", ctypes.c_int),
        *((name, ctypes.c_void_p) for name in ("arg", "res", "iw", "w")),
    )

    @classmethod
    def of(cls, entry: Entry) -> Self:
        """Return the function of an entry with fresh work arrays, which live as long as it."""
        arg, res, iw, w = entry.work()
        made = cls(
            entry.address, entry.memory, ctypes.addressof(arg), ctypes.addressof(res), address(iw), address(w)
        )
        made.kept = (arg, res, iw, w)
        return made


class Entry:
    """Address and work sizes of the generated function `name` in the library `path`.

    Raises
    ------
    CompilerError
        If the library cannot be loaded or has no such function.
    """

    def __init__(self, path: Path, name: str):
        try:
            self.library = ctypes.CDLL(str(path))
            self.address = ctypes.cast(self.library[name], ctypes.c_void_p)
            sizes = [ctypes.c_longlong() for _ in range(4)]
            self.library[f"{name}_work"](*(ctypes.byref(s) for s in sizes))
        except (OSError, AttributeError) as error:
            raise CompilerError(f"function {name!r} cannot be loaded", got=f"{path}: {error}") from error
        self._sizes = [s.value for s in sizes]
        # Functions with memory of their own (none without iterations inside) export these two.
        if hasattr(self.library, f"{name}_incref"):
            self.library[f"{name}_incref"]()
        self.memory = self.library[f"{name}_checkout"]() if hasattr(self.library, f"{name}_checkout") else 0

    def work(self) -> tuple[Any, Any, NDArray[np.int64], NDArray[np.float64]]:
        """Return fresh work arrays (arg, res, iw, w), so that two threads never share them."""
        n_arg, n_res, n_iw, n_w = self._sizes
        pointers = ctypes.c_void_p * n_arg, ctypes.c_void_p * n_res
        return pointers[0](), pointers[1](), np.empty(n_iw, dtype=np.int64), np.empty(n_w)

    def routine(self, name: str, arguments: list[Any]) -> Any:
        """Return the package's own C routine `name` of the same library, which returns a count.

        Raises
        ------
        CompilerError
            If the library was compiled without it.
        """
        try:
            routine = getattr(self.library, name)
        except AttributeError as error:
            raise CompilerError(
                f"the library has no routine {name!r}",
                needs="the driver that defines it, given to compile_functions",
            ) from error
        routine.argtypes, routine.restype = arguments, ctypes.c_longlong
        return routine


def address(array: NDArray[Any]) -> int:
    """Return where the numbers of a contiguous array start."""
    return array.ctypes.data
