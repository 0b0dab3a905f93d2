"""What `held_loop.c` does, in Python, for whoever moves the plant: a virtual machine, or another simulator."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.native.fixed_step import step_function
from passiflex.native.function import NativeFunction
from passiflex.native.loop_state import Watch

Array = NDArray[np.float64]

LONGEST_LINE = 64
"""Commands that may be on their way at one time."""
TOGETHER = 1e-9
"""Two instants closer than this share of a period are one."""


class Call(NamedTuple):
    """The arguments of one call; `y`, `c`, `line`, `z`, `w` and `out` are written to."""

    y: Array
    c: Array
    line: Array
    z: Array
    w: Array
    rows: Array
    timing: Array
    p_plant: Array
    p_control: Array
    p_watch: Array | None
    first: int
    steps: int
    period: float
    longest: float
    record_every: int
    out: Array


class Mover(Protocol):
    """Moves a plant, and runs the law; y = (x, quadratures), p as in the call."""

    @property
    def why(self) -> str:
        """Return why it can go no further, in words; empty as long as it can."""

    def control(self, y: Array, c: Array, row: Array, p: Array) -> tuple[Array, Array, Array]:
        """Return the memory after a period, the command, and the signals."""

    def step(self, y: Array, inputs: Array, p: Array, h: float) -> None:
        """Move y by h seconds under [command, environment]."""

    def look(self, w: Array, time: float, y: Array, held: Array, c: Array, z: Array, p: Array) -> Array:
        """Return what the watch remembers after a sample."""

    def glance(self, w: Array, time: float, y: Array, p: Array) -> Array:
        """Return what the watch remembers after a step."""


class InMachine:
    """The functions of a loop in CasADi's virtual machine."""

    why = ""

    def __init__(self, plant: cs.Function, control: cs.Function, watch: Watch | None):
        self._n_x = plant.size1_in(0)
        self._step, self._law = NativeFunction(step_function(plant)), NativeFunction(control)
        self._watch = [NativeFunction(f) for f in watch or ()]

    def control(self, y: Array, c: Array, row: Array, p: Array) -> tuple[Array, Array, Array]:
        """Return the memory after a period, the command, and the signals."""
        after, command, z = self._law(y[: self._n_x], c, row, p)
        return after, command, z

    def step(self, y: Array, inputs: Array, p: Array, h: float) -> None:
        """Take one step of Runge-Kutta."""
        y[:] = self._step(y, inputs, p, h)

    def look(self, w: Array, time: float, y: Array, held: Array, c: Array, z: Array, p: Array) -> Array:
        """Return what the watch remembers after a sample."""
        return np.asarray(self._watch[0](w, time, y, held, c, z, p)) if self._watch else w

    def glance(self, w: Array, time: float, y: Array, p: Array) -> Array:
        """Return what the watch remembers after a step."""
        return np.asarray(self._watch[1](w, time, y, p)) if self._watch else w


def walk(call: Call, by: Mover, n_u: int, n_s: int) -> int:
    """Return the number of samples done: all rows, or the first at which it could go no further."""
    y, c, line, z, w, rows, timing, p_plant, p_control, p_watch, first, steps, period, longest, every, out = (
        call
    )
    held, queue = line[1 : 1 + n_u], line[1 + n_u :].reshape(LONGEST_LINE, 1 + n_u)
    inputs = np.empty(n_u + n_s)
    for k, (row, (delay, runs)) in enumerate(zip(rows, timing.tolist(), strict=True)):
        start = (first + k) * period
        if runs:
            waiting = int(line[0])
            c[:], command, z[:] = by.control(y, c, row, p_control)
            queue[waiting, 0] = max(delay, queue[waiting - 1, 0] if waiting else 0.0)
            queue[waiting, 1:] = command
            line[0] += 1
        t = 0.0
        while True:
            while line[0] and queue[0, 0] <= t + TOGETHER * period:
                held[:] = queue[0, 1:]
                queue[:-1] = queue[1:].copy()
                line[0] -= 1
            if t == 0.0 and p_watch is not None:
                w[:] = by.look(w, start, y, held, c, z, p_watch)
            if t == 0.0 and k % every == 0:
                np.concatenate([y, c, held, z], out=out[k // every])
            if k >= steps or t >= period:
                break
            until = min(queue[0, 0], period) if line[0] else period
            count = max(1, math.ceil((until - t) / longest * (1 - 1e-12)))
            inputs[:n_u], inputs[n_u:] = held, row[:n_s]
            h = (until - t) / count
            for i in range(count):
                by.step(y, inputs, p_plant, h)
                if p_watch is not None:
                    w[:] = by.glance(w, start + (t + (i + 1) * h), y, p_watch)
            t = until
        queue[: int(line[0]), 0] -= period
        if by.why or not np.isfinite(y).all():
            return k
    return len(rows)
