"""A sampled loop in native code: a controller once per period, a plant under held commands between."""

from __future__ import annotations

import ctypes
import math
from pathlib import Path

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.errors import SizeError, ValueRangeError
from passiflex.native.entry import Callable, Entry, address
from passiflex.native.library import c_source
from passiflex.native.loop_state import LoopState, Samples, Watch
from passiflex.native.python_loop import LONGEST_LINE, Call, InMachine, Mover, walk

Array = NDArray[np.float64]

HELD_LOOP_DRIVER = c_source("held_loop.c")
"""The C text that `compile_functions` must append to a library that `HeldLoop` is to use."""

_ROUTINE = [
    *[ctypes.c_void_p] * 15, *[ctypes.c_longlong] * 3, *[ctypes.c_double] * 2, ctypes.c_longlong,
    *[ctypes.c_void_p] * 2,
]  # fmt: skip


class HeldLoop:
    """Advances control(x, c, row, p) → (c, command, signals) and plant(x, [command, environment], p) → (dx, dquad).

    The first numbers of a row are the environment that the plant feels. Threads may share the object if
    it is compiled.

    Parameters
    ----------
    plant, control: The two functions; all inputs and outputs are columns.
    library: What `compile_functions([plant, control, …], driver=HELD_LOOP_DRIVER)` returned; None runs
        CasADi's virtual machine.
    watch: What sees every sample and every step; its functions are in the library too.
    mover: Who moves the plant and runs the law in their place, period by period from Python.
    """

    def __init__(
        self,
        plant: cs.Function,
        control: cs.Function,
        library: Path | None = None,
        watch: Watch | None = None,
        mover: Mover | None = None,
    ):
        if not _fit(plant, control):
            raise SizeError(
                "plant and control do not fit",
                got=f"{plant}, {control}",
                needs="(x, [command, environment], p) -> (dx, dquad) and (x, c, row, p) -> (c, command, signals), "
                "dense columns",
            )
        self.n_x, inputs, self.n_p = (plant.size1_in(i) for i in range(3))
        _, self.n_c, self.n_w, self.n_p_control = (control.size1_in(i) for i in range(4))
        self.n_q, self.n_u, self.n_z = plant.size1_out(1), control.size1_out(1), control.size1_out(2)
        self.n_s = inputs - self.n_u
        self.n_line = 1 + self.n_u + LONGEST_LINE * (1 + self.n_u)
        self.n_m, self.n_p_watch = (watch.size, watch.parameters) if watch is not None else (0, 0)
        self._entries: list[Entry | None] | None = None
        self._mover: Mover | None = mover
        if mover is None and library is not None:
            self._entries = [Entry(library, f.name()) for f in (plant, control, *(watch or ()))]
            self._entries += [None] * (4 - len(self._entries))
            self._routine = Entry(library, plant.name()).routine("passiflex_held_loop", _ROUTINE)
        elif mover is None:
            self._mover = InMachine(plant, control, watch)

    def start(self, x: ArrayLike, controller: ArrayLike, command: ArrayLike) -> LoopState:
        """Return the state before the first sample, with `command` in force."""
        line = np.zeros(self.n_line)
        line[1 : 1 + self.n_u] = _column("command", command, self.n_u)
        return LoopState(
            _column("x", x, self.n_x),
            np.zeros(self.n_q),
            _column("controller", controller, self.n_c),
            line,
            np.full(self.n_z, np.nan),
            np.zeros(self.n_m),
        )

    def advance(
        self,
        state: LoopState,
        rows: ArrayLike,
        timing: ArrayLike,
        p_plant: ArrayLike,
        p_control: ArrayLike,
        period: float,
        longest: float,
        record_every: int = 1,
        *,
        last: bool = False,
        first: int = 0,
        p_watch: ArrayLike | None = None,
    ) -> Samples:
        """Return the samples of the rows, and the state after them.

        Parameters
        ----------
        state: From `start`, or from the call before.
        rows: Inputs (N, n_w); row i holds during period i.
        timing: (N, 2): delay of the command of each sample [s] ≥ 0, and whether the controller runs (0, 1).
        period: [s]; the same from `start` on.
        longest: Longest step of the plant [s].
        record_every: Samples from one recorded to the next.
        last: True if the last row is a sample only, with no period after it.
        first: Number of the first sample, by which the watch tells the time.
        p_watch: Parameters of the watch; None shows it nothing.

        Raises
        ------
        SizeError, ValueRangeError
            For an argument of the wrong shape or outside its range.
        """
        _require_steps(period, longest, record_every)
        record_every = int(record_every)
        rows, timing = self._driven(rows, timing, period)
        width = self.n_x + self.n_q + self.n_c + self.n_u + self.n_z
        out = np.full((-(-len(rows) // record_every), width), np.nan)
        sizes = (self.n_x, self.n_q, self.n_c, self.n_line, self.n_z, self.n_m)
        parts = zip(LoopState._fields, state, sizes, strict=True)
        x, quads, c, line, z, w = (_column(f"{name} of the state", *rest) for name, *rest in parts)
        y = np.concatenate([x, quads])
        given = (
            _column("p_plant", p_plant, self.n_p),
            _column("p_control", p_control, self.n_p_control),
            None if p_watch is None else _column("p_watch", p_watch, self.n_p_watch),
        )
        call = Call(
            y,
            c,
            line,
            z,
            w,
            rows,
            timing,
            *given,
            first,
            len(rows) - last,
            period,
            longest,
            record_every,
            out,
        )
        if self._entries is not None:
            completed = self._in_c(call, self._entries)
        else:
            assert self._mover is not None
            completed = walk(call, self._mover, self.n_u, self.n_s)
        ends = np.cumsum([self.n_x, self.n_q, self.n_c, self.n_u])
        x, quads, memory, command, signals = np.split(out, ends, axis=1)
        after = LoopState(y[: self.n_x], y[self.n_x :], c, line, z, w)
        why = self._mover.why if self._mover is not None else ""
        return Samples(x, quads, memory, command, signals, completed, after, why)

    def _in_c(self, call: Call, entries: list[Entry | None]) -> int:
        shown = entries if call.p_watch is not None else [*entries[:2], None, None]
        callables = [Callable.of(entry) if entry is not None else None for entry in shown]
        sizes = np.array(
            [self.n_x, self.n_q, self.n_c, self.n_u, self.n_w, self.n_s, self.n_z, self.n_m], np.int64
        )
        scratch = np.full(self.n_c + 2 * self.n_u + self.n_s + 3 * (self.n_x + self.n_q) + self.n_m, np.nan)
        arrays = [address(a) if a is not None else None for a in call[:10]]
        return self._routine(
            *(ctypes.byref(f) if f is not None else None for f in callables), address(sizes), *arrays,
            call.first, len(call.rows), *call[11:15], address(call.out), address(scratch),
        )  # fmt: skip

    def _driven(self, rows: ArrayLike, timing: ArrayLike, period: float) -> tuple[Array, Array]:
        """Return rows and timing as `advance` needs them."""
        rows = np.ascontiguousarray(rows, dtype=float)
        timing = np.ascontiguousarray(timing, dtype=float)
        if rows.ndim != 2 or rows.shape[1] != self.n_w:
            raise SizeError("rows", got=rows.shape, needs=f"shape (samples, {self.n_w})")
        if timing.shape != (len(rows), 2):
            raise SizeError("timing", got=timing.shape, needs=f"shape ({len(rows)}, 2)")
        if timing.size and not 0 <= timing[:, 0].min() <= timing[:, 0].max() < (LONGEST_LINE - 2) * period:
            raise ValueRangeError(
                "delay of a command",
                got=f"{timing[:, 0].min()} to {timing[:, 0].max()} s",
                needs=f"0 to {LONGEST_LINE - 3} periods",
            )
        return rows, timing


def _fit(plant: cs.Function, control: cs.Function) -> bool:
    """Return whether the two are what `HeldLoop` says."""
    if (plant.n_in(), plant.n_out(), control.n_in(), control.n_out()) != (3, 2, 4, 3):
        return False
    parts = [
        part(i)
        for f in (plant, control)
        for part, count in ((f.sparsity_in, f.n_in()), (f.sparsity_out, f.n_out()))
        for i in range(count)
    ]
    return (
        all(part.is_dense() and part.size2() == 1 for part in parts)
        and plant.size1_in(0) == plant.size1_out(0) == control.size1_in(0)
        and control.size1_in(1) == control.size1_out(0)
        and 0 <= plant.size1_in(1) - control.size1_out(1) <= control.size1_in(2)
    )


def _require_steps(period: float, longest: float, record_every: int) -> None:
    """Refuse times that are none."""
    for name, value in (("period", period), ("longest", longest)):
        if not (value > 0 and math.isfinite(value)):
            raise ValueRangeError(name, got=value, needs="a positive time in s")
    if record_every < 1 or record_every % 1:
        raise ValueRangeError("record_every", got=record_every, needs="a whole number, at least 1")


def _column(name: str, value: ArrayLike, size: int) -> Array:
    column = np.array(value, dtype=float).ravel()
    if column.shape != (size,):
        raise SizeError(name, got=column.shape, needs=f"shape {(size,)}")
    return column
