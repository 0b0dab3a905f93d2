"""Fixed-step integration under held inputs: classical Runge-Kutta of order 4, in native code.

Between two control instants the input is held, as a digital controller does; each period is split
into equal steps that are short enough for the fastest pole. Quadratures (energies, dissipated work)
are integrated beside the state, with the same order.
"""

from __future__ import annotations

import ctypes
import math
from pathlib import Path
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.errors import SizeError, ValueRangeError
from passiflex.native.entry import Callable, Entry, address
from passiflex.native.function import NativeFunction
from passiflex.native.library import c_source

DRIVER = c_source("fixed_step.c")
"""The C text that `compile_functions` must append to a library that `FixedStep` is to use."""

_RK4 = [
    *[ctypes.c_void_p] * 2, *[ctypes.c_longlong] * 4, *[ctypes.c_void_p] * 5, ctypes.c_double,
    *[ctypes.c_longlong] * 2, ctypes.c_double, *[ctypes.c_longlong] * 3, *[ctypes.c_void_p] * 2,
]  # fmt: skip
_ROWS = [
    ctypes.c_void_p,
    *[ctypes.c_longlong] * 2,
    *[ctypes.c_void_p] * 2,
    ctypes.c_longlong,
    *[ctypes.c_void_p] * 4,
]


class Advance(NamedTuple):
    """States and quadratures at the recorded instants, and the number of periods that were completed.

    `completed` below the number of periods is the index of the period in which a number ceased to be
    finite; the rows from there on are NaN. `watched` is what the watch remembers after it.
    """

    states: NDArray[np.float64]
    quads: NDArray[np.float64]
    completed: int
    watched: NDArray[np.float64]


class Watched(NamedTuple):
    """What a watch remembers so far (zeros before it saw anything), its parameters, and the time now [s]."""

    memory: NDArray[np.float64]
    p: NDArray[np.float64]
    time: float = 0.0


class Refinement(NamedTuple):
    """The first `steps` steps of every period are split into `split` equal ones.

    A held input jumps at the start of its period; the fast modes that it kicks decay within a few steps,
    but what they do meanwhile is energy, and wants a finer step than stability does.
    """

    steps: int
    split: int


class FixedStep:
    """Integrates dx/dt, dquad/dt = rhs(x, u, p) under held inputs u. Threads may share it if it is compiled.

    Parameters
    ----------
    rhs: The function (x, u, p) → (dx, dquad), all columns; quadratures may be empty.
    library: What `compile_functions([rhs, …], driver=DRIVER)` returned; None runs CasADi's virtual machine.
    watch: Sees the start and the end of every step: (memory, time, (x, quad), u, p) → memory, in the library too.

    Raises
    ------
    SizeError
        If `rhs` has other inputs or outputs.
    CompilerError
        If the library does not hold `rhs` or the driver.
    """

    def __init__(self, rhs: cs.Function, library: Path | None = None, watch: cs.Function | None = None):
        columns = all(rhs.size2_in(i) == 1 for i in range(rhs.n_in())) and all(
            rhs.size2_out(i) == 1 for i in range(rhs.n_out())
        )
        if (rhs.n_in(), rhs.n_out()) != (3, 2) or not columns or rhs.size1_in(0) != rhs.size1_out(0):
            raise SizeError("right-hand side", got=rhs, needs="(x[n], u, p) -> (dx[n], dquad), all columns")
        self.rhs = NativeFunction(rhs, library)
        self.n_x, self.n_u, self.n_p = (a.size for a in self.rhs.inputs)
        self.n_q = self.rhs.outputs[1].size
        self.n_m: int = watch.size1_in(0) if watch is not None else 0
        self.n_p_watch: int = watch.size1_in(4) if watch is not None else 0
        self._entry = Entry(library, rhs.name()) if library is not None else None
        self._watch: Entry | NativeFunction | None = None
        if self._entry is not None and library is not None:
            self._routine = self._entry.routine("passiflex_rk4", _RK4)
            self._rows = self._entry.routine("passiflex_watch_rows", _ROWS)
            self._watch = Entry(library, watch.name()) if watch is not None else None
        else:
            self._step = NativeFunction(step_function(rhs))
            self._watch = NativeFunction(watch) if watch is not None else None

    def advance(
        self,
        x0: ArrayLike,
        quad0: ArrayLike,
        held: ArrayLike,
        p: ArrayLike,
        period: float,
        substeps: int = 1,
        record_every: int = 1,
        refine: Refinement | None = None,
        watched: Watched | None = None,
    ) -> Advance:
        """Return the motion over the periods of `held`.

        Parameters
        ----------
        x0, quad0: State (n_x,) and quadratures (n_q,) at the start.
        held: Inputs (N, n_u); row i is held during period i.
        p: Parameters (n_p,).
        period: Length of a period [s].
        substeps: Steps per period, see `stable_step`.
        record_every: Periods from one recorded row to the next; row 0 is the start.
        refine: Finer steps at the start of every period; None keeps all steps equal.
        watched: What the watch starts from, at the time of the start; None shows it nothing.

        Raises
        ------
        SizeError, ValueRangeError
            For an argument of the wrong shape or outside its range. A motion that leaves the finite
            numbers is no error; see `Advance`.
        """
        held = np.ascontiguousarray(held, dtype=float)
        start = np.concatenate([_column("x0", x0, self.n_x), _column("quad0", quad0, self.n_q)])
        p = _column("p", p, self.n_p)
        if held.ndim != 2 or held.shape[1] != self.n_u:
            raise SizeError("held inputs", got=held.shape, needs=f"shape (periods, {self.n_u})")
        if not (period > 0 and math.isfinite(period)):
            raise ValueRangeError("period", got=period, needs="a positive time in s")
        refine = refine or Refinement(0, 1)
        for name, count in (("substeps", substeps), ("record_every", record_every), ("split", refine.split)):
            if count < 1 or count % 1:
                raise ValueRangeError(name, got=count, needs="a whole number, at least 1")
        substeps, record_every = int(substeps), int(record_every)
        out = np.full((len(held) // record_every + 1, start.size), np.nan)
        shown = self._shown(watched)
        run = self._advance_in_machine if self._entry is None else self._advance_in_c
        completed = run(start, held, p, shown, substeps, period / substeps, refine, record_every, out)
        return Advance(
            out[:, : self.n_x], out[:, self.n_x :], completed, np.zeros(0) if shown is None else shown.memory
        )

    def _shown(self, watched: Watched | None) -> Watched | None:
        """Return what the watch starts from, with a memory of its own to write to."""
        if watched is None:
            return None
        memory = _column("memory of the watch", watched.memory, self.n_m).copy()
        return watched._replace(
            memory=memory, p=_column("parameters of the watch", watched.p, self.n_p_watch)
        )

    def watch_rows(
        self, watched: Watched, time: NDArray[np.float64], y: NDArray[np.float64], u: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return what the watch remembers after it was shown instants in a row: times (N,), (x, quad) (N, n), u."""
        memory, p, room = watched.memory.copy(), watched.p, np.empty(self.n_m)
        time, y = np.ascontiguousarray(time, dtype=float), np.ascontiguousarray(y, dtype=float)
        if isinstance(self._watch, Entry):
            self._rows(
                ctypes.byref(Callable.of(self._watch)), self.n_m, y.shape[1], address(memory),
                address(room), len(y), address(time), address(y), address(u), address(p),
            )  # fmt: skip
        elif self._watch is not None:
            for t, row in zip(time, y, strict=True):
                memory[:] = self._watch(memory, t, row, u, p)
        return memory

    def _advance_in_c(
        self,
        start: NDArray[np.float64],
        held: NDArray[np.float64],
        p: NDArray[np.float64],
        watched: Watched | None,
        substeps: int,
        h: float,
        refine: Refinement,
        record_every: int,
        out: NDArray[np.float64],
    ) -> int:
        assert self._entry is not None
        rhs = Callable.of(self._entry)
        watch = None
        if watched is not None and isinstance(self._watch, Entry):
            watch = ctypes.byref(Callable.of(self._watch))
        memory, p_watch, begin = watched or Watched(np.zeros(0), np.zeros(0))
        scratch = np.empty(4 * start.size + self.n_m)
        return self._routine(
            ctypes.byref(rhs), watch, self.n_m, self.n_x, self.n_q, self.n_u,
            address(start), address(held), address(p), address(memory), address(p_watch), begin,
            len(held), substeps, h, refine.steps, refine.split, record_every, address(out), address(scratch),
        )  # fmt: skip

    def _advance_in_machine(
        self,
        start: NDArray[np.float64],
        held: NDArray[np.float64],
        p: NDArray[np.float64],
        watched: Watched | None,
        substeps: int,
        h: float,
        refine: Refinement,
        record_every: int,
        out: NDArray[np.float64],
    ) -> int:
        y, u, parameters, length = self._step.inputs
        (y_next,) = self._step.outputs
        y[:], parameters[:] = start, p
        fine = min(refine.steps, substeps)
        lengths = [h / refine.split] * (fine * refine.split) + [h] * (substeps - fine)
        ends = np.cumsum(lengths)
        out[0] = start
        for i, row in enumerate(held):
            u[:] = row
            if i == 0:
                self._look(watched, 0.0, y, u)
            for length[0], end in zip(lengths, ends, strict=True):
                self._step.call()
                y[:] = y_next
                self._look(watched, i * substeps * h + end, y, u)
            if not np.isfinite(y).all():
                return i
            if (i + 1) % record_every == 0:
                out[(i + 1) // record_every] = y
        return len(held)

    def _look(
        self, watched: Watched | None, elapsed: float, y: NDArray[np.float64], u: NDArray[np.float64]
    ) -> None:
        if watched is not None and isinstance(self._watch, NativeFunction):
            watched.memory[:] = self._watch(watched.memory, watched.time + elapsed, y, u, watched.p)


def _column(name: str, value: ArrayLike, size: int) -> NDArray[np.float64]:
    column = np.ascontiguousarray(value, dtype=float)
    if column.shape != (size,):
        raise SizeError(name, got=column.shape, needs=f"shape {(size,)}")
    return column


def step_function(rhs: cs.Function) -> cs.Function:
    """Return one Runge-Kutta 4 step (y, u, p, h) → y_next of the extended state, as in `fixed_step.c`."""
    n_x = rhs.size1_in(0)
    y = cs.MX.sym("y", n_x + rhs.size1_out(1))
    u, p, h = cs.MX.sym("u", rhs.size1_in(1)), cs.MX.sym("p", rhs.size1_in(2)), cs.MX.sym("h")
    stage, total = y[:n_x], cs.MX.zeros(y.shape[0])
    for weight, next_node in ((1 / 6, 0.5), (1 / 3, 0.5), (1 / 3, 1.0), (1 / 6, None)):
        dx, dquad = rhs(stage, u, p)
        total += weight * cs.vertcat(dx, dquad)
        if next_node is not None:
            stage = y[:n_x] + h * next_node * dx
    return cs.Function("rk4_step", [y, u, p, h], [cs.densify(y + h * total)])
