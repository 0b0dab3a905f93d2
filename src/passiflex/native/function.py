"""Call a CasADi function on NumPy arrays in place, compiled or in the virtual machine alike."""

from __future__ import annotations

import ctypes
from pathlib import Path

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.errors import SimulationError, SizeError, ValueRangeError
from passiflex.native.entry import Entry, address
from passiflex.native.library import load_external

Arrays = tuple[NDArray[np.float64], ...]
_COLUMNS = [ctypes.c_void_p, ctypes.c_int, *[ctypes.c_longlong] * 3, *[ctypes.c_void_p] * 8]


class NativeFunction:
    """One function with arrays of its own: write `inputs`, `call()`, read `outputs`.

    A column is an array of shape (k,), a matrix one of shape (r, c) stored column by column.
    `call` and `__call__` use the arrays of the object: one object per thread. `map` of a compiled
    function does not, and lets other threads run.

    Parameters
    ----------
    function: The function; inputs and outputs are dense.
    library: The library that `compile_functions` made of it; None runs CasADi's virtual machine.

    Raises
    ------
    ValueRangeError
        If an input or output is sparse.
    CompilerError
        If the library does not hold the function.
    """

    def __init__(self, function: cs.Function, library: Path | None = None):
        self.name: str = function.name()
        self.n_in, self.n_out = function.n_in(), function.n_out()
        self.names_in, self.names_out = tuple(function.name_in()), tuple(function.name_out())
        self.compiled = library is not None
        sparsities = [
            *map(function.sparsity_in, range(self.n_in)),
            *map(function.sparsity_out, range(self.n_out)),
        ]
        for label, sparsity in zip(self.names_in + self.names_out, sparsities, strict=True):
            if not sparsity.is_dense():
                raise ValueRangeError(
                    f"{label!r} of function {self.name!r} is sparse",
                    got=sparsity.dim(True),
                    try_="casadi.densify",
                )
        self._entry = Entry(library, self.name) if library is not None else None
        self._function = load_external(self.name, library) if library is not None else function
        self._buffer, self._evaluate = self._function.buffer()
        flat = [np.zeros(s.numel()) for s in sparsities]
        shaped = tuple(_shaped(a, s.shape) for a, s in zip(flat, sparsities, strict=True))
        self.inputs: Arrays = shaped[: self.n_in]
        self.outputs: Arrays = shaped[self.n_in :]
        for i, array in enumerate(flat[: self.n_in]):
            self._buffer.set_arg(i, array.data)
        for i, array in enumerate(flat[self.n_in :]):
            self._buffer.set_res(i, array.data)

    def __repr__(self) -> str:
        how = "compiled" if self.compiled else "virtual machine"
        return f"<{self.name}({', '.join(self.names_in)}) -> ({', '.join(self.names_out)}), {how}>"

    def call(self) -> None:
        """Evaluate `inputs` into `outputs`, without a copy.

        Raises
        ------
        SimulationError
            If an assertion or iteration inside failed; a number that is not finite is no failure.
        """
        try:
            self._evaluate()
        except RuntimeError as error:
            raise self._refused() from error
        if self._buffer.ret():
            raise self._refused()

    def __call__(self, *arguments: ArrayLike) -> NDArray[np.float64] | Arrays:
        """Return the outputs at `arguments` as new arrays; one output is returned bare.

        Raises
        ------
        SizeError
            For a wrong number of arguments, or an argument of the wrong shape; the message names it.
        """
        self._check_count(len(arguments))
        for name, array, value in zip(self.names_in, self.inputs, arguments, strict=True):
            given = np.asarray(value, dtype=float)
            if given.shape != array.shape and not (given.ndim == 0 and array.shape == (1,)):
                raise SizeError(
                    f"argument {name!r} of {self.name!r}", got=given.shape, needs=f"shape {array.shape}"
                )
            array[...] = given
        self.call()
        copies = tuple(a.copy(order="K") for a in self.outputs)
        return copies[0] if self.n_out == 1 else copies

    def map(self, *columns: ArrayLike) -> NDArray[np.float64] | Arrays:
        """Return the outputs at N points.

        Parameters
        ----------
        columns: For each input an array of shape (N, k), one row per point, or (k,), the same at all
            points; k counts the numbers of the input, a matrix column by column.

        Returns
        -------
        An array of shape (N, m) for each output, m counted likewise; one output is returned bare.
            N is 1 if no input has rows.

        Raises
        ------
        SizeError
            For a wrong number of arguments, or an argument of the wrong shape; the message names it.
        SimulationError
            As `call`.
        """
        self._check_count(len(columns))
        given = tuple(np.ascontiguousarray(c, dtype=float) for c in columns)
        n = next((len(g) for g in given if g.ndim == 2), 1)
        for name, array, g in zip(self.names_in, self.inputs, given, strict=True):
            if g.shape not in ((array.size,), (n, array.size)):
                raise SizeError(
                    f"argument {name!r} of {self.name!r}",
                    got=g.shape,
                    needs=f"shape {(n, array.size)} or {(array.size,)}",
                )
        results = tuple(np.empty((n, a.size)) for a in self.outputs)
        if self._entry is None:
            self._map_in_machine(given, results)
        elif self._map_in_c(self._entry, given, results) < n:
            raise self._refused()
        return results[0] if self.n_out == 1 else results

    def _map_in_c(self, entry: Entry, given: Arrays, results: Arrays) -> int:
        arg, res, iw, w = entry.work()
        arrays = (*given, *results)
        starts = np.array([address(a) for a in arrays], dtype=np.uintp)
        steps = np.array([a.shape[1] if a.ndim == 2 else 0 for a in arrays], dtype=np.int64)
        k, n = self.n_in, (len(results[0]) if results else 0)
        return entry.routine("passiflex_columns", _COLUMNS)(
            entry.address, entry.memory, k, self.n_out, n,
            address(starts), address(steps), address(starts[k:]), address(steps[k:]),
            arg, res, address(iw), address(w),
        )  # fmt: skip

    def _map_in_machine(self, given: Arrays, results: Arrays) -> None:
        flat_in = [a.reshape(-1, order="F") for a in self.inputs]
        flat_out = [a.reshape(-1, order="F") for a in self.outputs]
        varying = [(a, g) for a, g in zip(flat_in, given, strict=True) if g.ndim == 2]
        for a, g in zip(flat_in, given, strict=True):
            if g.ndim == 1:
                a[:] = g
        for k in range(len(results[0]) if results else 0):
            for a, g in varying:
                a[:] = g[k]
            self.call()
            for a, r in zip(flat_out, results, strict=True):
                r[k] = a

    def _refused(self) -> SimulationError:
        return SimulationError(
            f"function {self.name!r} could not be evaluated",
            needs="inputs for which its assertions and iterations hold",
        )

    def _check_count(self, count: int) -> None:
        if count != self.n_in:
            raise SizeError(
                f"arguments of function {self.name!r}",
                got=count,
                needs=f"{self.n_in}: {', '.join(self.names_in)}",
            )


def _shaped(flat: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.float64]:
    """Return a view of `flat`: itself for a column, else a matrix stored column by column."""
    return flat if shape[1] == 1 else flat.reshape(shape, order="F")
