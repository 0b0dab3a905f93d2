"""A sampled loop for several robots side by side in native code, each in a lane of its own."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.errors import SizeError, ValueRangeError
from passiflex.native.entry import address
from passiflex.native.lane_data import LaneInputs, LaneSamples, LaneState, aligned
from passiflex.native.lane_source import lane_source
from passiflex.native.library import c_source, compile_source
from passiflex.native.loop_state import LoopState, Watch
from passiflex.native.python_loop import LONGEST_LINE

Array = NDArray[np.float64]


class _Run(ctypes.Structure):
    _fields_ = (
        *((n, ctypes.c_longlong) for n in ("first", "n_rows", "steps", "record_every", "n_changes", "n_kept")),
        ("period", ctypes.c_double),
        *(
            (name, ctypes.c_void_p)
            for name in (
                "y", "c", "scheduled", "z", "w", "line", "longest", "changes", "scheduled_values", "drawn", "timing",
                "p_plant", "p_control", "p_watch", "kept", "out", "completed", "whole",
            )
        ),
    )  # fmt: skip


class LaneFunctions(NamedTuple):
    """The functions of a loop, all of dense columns.

    Attributes
    ----------
    plant: (x, [command, environment], p) → (dx, dquad).
    control: (x, c, row, p) → (c, command, signals); a row begins with the environment.
    row: (time, scheduled, drawn) → row.
    truth: (x, command, environment, p) → what is true then, with p as for control.
    watch: What sees every sample and every step, or none.
    """

    plant: cs.Function
    control: cs.Function
    row: cs.Function
    truth: cs.Function
    watch: Watch | None = None

    @property
    def there(self) -> dict[str, cs.Function]:
        """Return all functions that there are, by name."""
        return {
            **dict(zip(self._fields, self[:4], strict=False)),
            **(self.watch._asdict() if self.watch else {}),
        }


class LaneLoop:
    """Advances as many loops as the processor has lanes. Threads may share the object.

    Each lane does exactly what `HeldLoop` does, whatever the others do: the same steps from arrival to
    arrival. Its results differ from `HeldLoop`'s by rounding only (where the compiler joins products and
    sums, sin, cos, exp and tanh of `lanes.h`, shared divisors), and not at all with lane or neighbours.

    Parameters
    ----------
    functions: The loop.
    width: Number of lanes; what the processor has (8, 4 or 1) if None.

    Raises
    ------
    CompilerError
        If there is no compiler.
    SizeError
        If the functions do not fit together.
    """

    def __init__(self, functions: LaneFunctions, width: int | None = None):
        f = functions
        self.n_x, self.n_q = f.plant.size1_out(0), f.plant.size1_out(1)
        self.n_c, self.n_u, self.n_z = (f.control.size1_out(i) for i in range(3))
        self.n_s = f.plant.size1_in(1) - self.n_u
        self.n_scheduled, self.n_drawn, self.n_w = f.row.size1_in(1), f.row.size1_in(2), f.row.size1_out(0)
        self.n_p_plant, self.n_p_control = f.plant.size1_in(2), f.control.size1_in(3)
        self.n_truth = f.truth.size1_out(0)
        self.n_m, self.n_p_watch = (f.watch.size, f.watch.parameters) if f.watch is not None else (0, 0)
        _require_fit(f, self)
        self.n_line = 1 + self.n_u + LONGEST_LINE * (1 + self.n_u)
        self.library = compile_source(self._source(f, width))
        loaded = ctypes.CDLL(str(self.library))
        self.width: int = loaded.passiflex_lanes()
        self._routine = loaded.passiflex_lane_loop
        self._routine.argtypes, self._routine.restype = [ctypes.c_void_p], None

    @property
    def instant(self) -> dict[str, slice]:
        """Return where each part stands in the numbers of one sample, which `kept` of `advance` picks from."""
        sizes = {
            "x": self.n_x, "quads": self.n_q, "controller": self.n_c, "command": self.n_u,
            "signals": self.n_z, "truth": self.n_truth, "row": self.n_w,
        }  # fmt: skip
        ends = np.cumsum(list(sizes.values())).tolist()
        return {name: slice(end - size, end) for (name, size), end in zip(sizes.items(), ends, strict=True)}

    def start(self, states: Sequence[LoopState]) -> LaneState:
        """Return the state of lanes that begin as `HeldLoop.start` says, one for each lane.

        Raises
        ------
        SizeError
            For another number of states than lanes.
        """
        if len(states) != self.width:
            raise SizeError("states", got=len(states), needs=f"one for each of {self.width} lanes")
        return LaneState(
            np.stack([np.concatenate([s.x, s.quads]) for s in states], axis=1),
            np.stack([s.controller for s in states], axis=1),
            np.stack([s.signals for s in states], axis=1),
            np.stack([s.line for s in states]),
            np.zeros((self.n_scheduled, self.width)),
            np.stack([s.watched for s in states], axis=1),
        )

    def advance(
        self,
        state: LaneState,
        inputs: LaneInputs,
        p_plant: Array,
        p_control: Array,
        period: float,
        longest: Array,
        kept: NDArray[np.int64],
        record_every: int = 1,
        *,
        last: bool = False,
        p_watch: Array | None = None,
    ) -> LaneSamples:
        """Return the samples of a stretch, and the state after it.

        Parameters
        ----------
        state: From `start`, or from the call before.
        inputs: What drives the stretch; commands may be late by fewer than 62 periods.
        p_plant, p_control: Parameters (n, lanes).
        period: [s]; the same for all lanes, from `start` on.
        longest: Longest step of the plant in each lane [s].
        kept: Which numbers of a sample to record, see `instant`.
        record_every: Samples from one recorded to the next.
        last: True if the last row is a sample only, with no period after it.
        p_watch: Parameters of the watch (n, lanes), if there is one.

        Raises
        ------
        SizeError, ValueRangeError
            For an argument of the wrong shape or outside its range.
        """
        w, n = self.width, len(inputs.drawn)
        _require_steps(period, longest, record_every)
        record_every = int(record_every)
        _require_range("kept", kept, (kept >= 0) & (kept < self.instant["row"].stop), "numbers of a sample")
        _require_inputs(inputs, period, w)
        arrays = {
            "y": aligned("y", state.y, (self.n_x + self.n_q, w)),
            "c": aligned("controller", state.controller, (self.n_c, w)),
            "z": aligned("signals", state.signals, (self.n_z, w)),
            "line": aligned("line", state.line, (w, self.n_line)),
            "scheduled": aligned("scheduled", state.scheduled, (self.n_scheduled, w)),
            "w": aligned("watched", state.watched, (self.n_m, w)),
            "drawn": aligned("drawn", inputs.drawn, (n, self.n_drawn, w)),
            "timing": aligned("timing", inputs.timing, (n, 2, w)),
            "p_plant": aligned("p_plant", p_plant, (self.n_p_plant, w)),
            "p_control": aligned("p_control", p_control, (self.n_p_control, w)),
            "p_watch": aligned(
                "p_watch", np.zeros((0, w)) if p_watch is None else p_watch, (self.n_p_watch, w)
            ),
            "longest": aligned("longest", longest, (w,)),
            "out": aligned("out", None, (-(-n // record_every), kept.size, w)),
        }
        when, scheduled = self._changes(inputs)
        kept = np.ascontiguousarray(kept, dtype=np.int64)
        completed, whole = np.zeros(w, dtype=np.int64), np.zeros(w, dtype=np.int64)
        run = _Run(
            inputs.first, n, n - last, record_every, len(when), kept.size, period,
            changes=address(when), scheduled_values=address(scheduled), kept=address(kept),
            completed=address(completed), whole=address(whole), **{name: address(a) for name, a in arrays.items()},
        )  # fmt: skip
        self._routine(ctypes.byref(run))
        after = LaneState(*(arrays[name] for name in ("y", "c", "z", "line", "scheduled", "w")))
        return LaneSamples(arrays["out"], completed, whole, after)

    def _changes(self, inputs: LaneInputs) -> tuple[NDArray[np.int64], Array]:
        """Return period, lane and number of each change in order of time, and what is scheduled from there on."""
        changes = sorted(inputs.changes, key=lambda change: change.period)
        scheduled = np.zeros((len(changes), self.n_scheduled))
        for i, c in enumerate(changes):
            scheduled[i] = aligned("scheduled in a change", c.scheduled, (self.n_scheduled,))
        return np.array([(c.period, c.lane, i) for i, c in enumerate(changes)], dtype=np.int64), scheduled

    def _source(self, f: LaneFunctions, width: int | None) -> str:
        sizes = {
            "N_X": self.n_x, "N_Q": self.n_q, "N_C": self.n_c, "N_U": self.n_u, "N_S": self.n_s,
            "N_Z": self.n_z, "N_W": self.n_w, "N_SCHEDULED": self.n_scheduled, "N_DRAWN": self.n_drawn,
            "N_TRUTH": self.n_truth, "LONGEST_LINE": LONGEST_LINE,
        }  # fmt: skip
        lines = [f"enum {{ {', '.join(f'{name} = {size}' for name, size in sizes.items())} }};"]
        lines += [f"#define {part.upper()} {g.name()}_in_lanes" for part, g in f.there.items()]
        lines.append(f"#define N_M {self.n_m}")
        return "\n".join((lane_source(list(f.there.values()), width), *lines, c_source("lane_loop.c")))


def _require_steps(period: float, longest: Array, record_every: int) -> None:
    """Refuse times that are none."""
    _require_range("period", period, period > 0 and np.isfinite(period), "a positive time in s")
    _require_range("longest", longest, (longest > 0) & (longest < np.inf), "positive times in s")
    whole = record_every >= 1 and not record_every % 1
    _require_range("record_every", record_every, whole, "a whole number, at least 1")


def _require_inputs(inputs: LaneInputs, period: float, width: int) -> None:
    """Refuse commands that are too late, and changes in lanes that there are not."""
    late, most = inputs.timing[:, 0], (LONGEST_LINE - 2) * period
    _require_range(
        "delay of a command", late, (late >= 0) & (late < most), f"0 to {LONGEST_LINE - 3} periods"
    )
    for change in inputs.changes:
        _require_range("lane of a change", change.lane, 0 <= change.lane < width, f"below {width}")


def _require_range(
    name: str, value: ArrayLike, good: bool | np.bool_ | NDArray[np.bool_], needs: str
) -> None:
    if not np.all(good):
        got = f"{np.min(value)} to {np.max(value)}" if np.size(value) > 1 else value
        raise ValueRangeError(name, got=got, needs=needs)


def _require_fit(f: LaneFunctions, n: LaneLoop) -> None:
    """Refuse functions that are not what `LaneFunctions` says: the native loop takes their sizes on trust."""
    needed = {
        "plant": ((n.n_x, n.n_u + n.n_s, n.n_p_plant), (n.n_x, n.n_q)),
        "control": ((n.n_x, n.n_c, n.n_w, n.n_p_control), (n.n_c, n.n_u, n.n_z)),
        "row": ((1, n.n_scheduled, n.n_drawn), (n.n_w,)),
        "truth": ((n.n_x, n.n_u, n.n_s, n.n_p_control), (n.n_truth,)),
    }
    if f.watch is not None:
        seen = (n.n_m, 1, n.n_x + n.n_q)
        needed["look"] = ((*seen, n.n_u, n.n_c, n.n_z, n.n_p_watch), (n.n_m,))
        needed["glance"] = ((*seen, n.n_p_watch), (n.n_m,))
    for name, sizes in needed.items():
        g = f.there[name]
        parts = [g.sparsity_in(i) for i in range(g.n_in())], [g.sparsity_out(i) for i in range(g.n_out())]
        found = tuple(tuple(part.size1() if part.size2() <= 1 else -1 for part in side) for side in parts)
        if found != sizes or not all(part.is_dense() for side in parts for part in side):
            raise SizeError(f"{name} does not fit", got=g, needs=f"dense columns of sizes {sizes}")
    if not 0 <= n.n_s <= n.n_w:
        raise SizeError("rows do not fit", got=f"{n.n_w} numbers", needs=f"{n.n_s} environment first")
