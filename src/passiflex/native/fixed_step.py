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
from passiflex.native.entry import Entry, address
from passiflex.native.function import NativeFunction
from passiflex.native.library import c_source

DRIVER = c_source("fixed_step.c")
"""The C text that `compile_functions` must append to a library that `FixedStep` is to use."""

STABILITY_LIMIT = 2.78
"""Largest h·|λ| at which Runge-Kutta 4 is stable (2.785 on the real, 2.828 on the imaginary axis)."""

_RK4 = [
    ctypes.c_void_p, ctypes.c_int, *[ctypes.c_longlong] * 3, *[ctypes.c_void_p] * 3,
    *[ctypes.c_longlong] * 2, ctypes.c_double, *[ctypes.c_longlong] * 3, *[ctypes.c_void_p] * 6,
]  # fmt: skip


class Advance(NamedTuple):
    """States and quadratures at the recorded instants, and the number of periods that were completed.

    `completed` below the number of periods is the index of the period in which a number ceased to be
    finite; the rows from there on are NaN.
    """

    states: NDArray[np.float64]
    quads: NDArray[np.float64]
    completed: int


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

    Raises
    ------
    SizeError
        If `rhs` has other inputs or outputs.
    CompilerError
        If the library does not hold `rhs` or the driver.
    """

    def __init__(self, rhs: cs.Function, library: Path | None = None):
        columns = all(rhs.size2_in(i) == 1 for i in range(rhs.n_in())) and all(
            rhs.size2_out(i) == 1 for i in range(rhs.n_out())
        )
        if (rhs.n_in(), rhs.n_out()) != (3, 2) or not columns or rhs.size1_in(0) != rhs.size1_out(0):
            raise SizeError("right-hand side", got=rhs, needs="(x[n], u, p) -> (dx[n], dquad), all columns")
        self.rhs = NativeFunction(rhs, library)
        self.n_x, self.n_u, self.n_p = (a.size for a in self.rhs.inputs)
        self.n_q = self.rhs.outputs[1].size
        self._entry = Entry(library, rhs.name()) if library is not None else None
        if self._entry is not None:
            self._routine = self._entry.routine("passiflex_rk4", _RK4)
        else:
            self._step = NativeFunction(step_function(rhs))

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
        run = self._advance_in_machine if self._entry is None else self._advance_in_c
        completed = run(start, held, p, substeps, period / substeps, refine, record_every, out)
        return Advance(out[:, : self.n_x], out[:, self.n_x :], completed)

    def _advance_in_c(
        self,
        start: NDArray[np.float64],
        held: NDArray[np.float64],
        p: NDArray[np.float64],
        substeps: int,
        h: float,
        refine: Refinement,
        record_every: int,
        out: NDArray[np.float64],
    ) -> int:
        assert self._entry is not None
        arg, res, iw, w = self._entry.work()
        scratch = np.empty(4 * start.size)
        return self._routine(
            self._entry.address, self._entry.memory, self.n_x, self.n_q, self.n_u,
            address(start), address(held), address(p),
            len(held), substeps, h, refine.steps, refine.split, record_every, address(out),
            arg, res, address(iw), address(w), address(scratch),
        )  # fmt: skip

    def _advance_in_machine(
        self,
        start: NDArray[np.float64],
        held: NDArray[np.float64],
        p: NDArray[np.float64],
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
        out[0] = start
        for i, row in enumerate(held):
            u[:] = row
            for length[0] in lengths:
                self._step.call()
                y[:] = y_next
            if not np.isfinite(y).all():
                return i
            if (i + 1) % record_every == 0:
                out[(i + 1) // record_every] = y
        return len(held)


def fastest_pole(rhs: NativeFunction, x: ArrayLike, u: ArrayLike, p: ArrayLike) -> float:
    """Return max |λ| [1/s] of the Jacobian ∂(dx)/∂x, by central differences at (x, u, p).

    Raises
    ------
    ValueRangeError
        If the slope is not finite around x.
    """
    x = np.atleast_1d(np.asarray(x, dtype=float))
    if x.size == 0:
        return 0.0
    # The step that balances truncation (h²) against rounding (ε/h).
    h = np.cbrt(np.finfo(float).eps) * np.maximum(np.abs(x), 1.0)
    above, below = x + np.diag(h), x - np.diag(h)
    dx = rhs.map(np.vstack([above, below]), u, p)[0]
    jacobian = ((dx[: x.size] - dx[x.size :]) / (np.diag(above) - np.diag(below))[:, None]).T
    if not np.isfinite(jacobian).all():
        raise ValueRangeError("the slope around this state is not finite", got=f"x = {x}")
    return float(np.abs(np.linalg.eigvals(jacobian)).max())


def stable_step(pole: float, period: float, safety: float = 0.5) -> int:
    """Return the number of Runge-Kutta 4 steps per period with h·|λ| ≤ safety · 2.78.

    Parameters
    ----------
    pole: |λ| of the fastest mode [1/s], see `fastest_pole`.
    period: Length of a period [s].
    safety: Share of the stability limit; 1 is the edge.

    Raises
    ------
    ValueRangeError
        For a number that is negative, zero (period, safety) or not finite.
    """
    for name, value, least in (
        ("pole", pole, 0.0),
        ("period", period, math.ulp(0)),
        ("safety", safety, math.ulp(0)),
    ):
        if not (math.isfinite(value) and value >= least):
            raise ValueRangeError(name, got=value, needs="a positive number")
    return max(1, math.ceil(pole * period / (safety * STABILITY_LIMIT)))


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
