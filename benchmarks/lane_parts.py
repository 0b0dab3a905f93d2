"""The generated functions alone in lanes: how long each takes, and what its machine code is made of."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multiply_add import cpu_seconds
from passiflex.loops.compiled import compiled_sampled_loop
from passiflex.native import Change, LaneInputs
from passiflex.native.lane_source import lane_source
from passiflex.simulation import Problem
from passiflex.simulation.batch import lane_loop
from passiflex.simulation.schedule import Chance, PeriodRows, schedule
from passiflex.simulation.simulate_sampled import longest_step, start

Array = NDArray[np.float64]


class Part(NamedTuple):
    """A generated function and a point to evaluate it at: one column for each input."""

    name: str
    function: cs.Function
    point: list[Array]


class Code(NamedTuple):
    """What the machine code of a function is made of, in instructions; `size` in bytes.

    Attributes
    ----------
    arithmetic: +, −, ×, and the two joined.
    divisions: Also roots.
    logic: Comparisons, masks and blends of vectors.
    loads: Vectors read from memory, alone or as part of an instruction.
    stores: Vectors written.
    """

    size: int
    instructions: int
    arithmetic: int
    divisions: int
    logic: int
    loads: int
    stores: int


def parts_of(problem: Problem) -> list[Part]:
    """Return the functions of a sampled loop, at a point where the robot moves and the joints are stretched."""
    s = problem
    assert s is not None
    compiled = compiled_sampled_loop(s.loop)
    loop, rng = compiled.loop, np.random.default_rng(0)
    state = start(problem, compiled)
    row, _ = PeriodRows(problem, loop.period, compiled.row).take(0, 1)
    n = problem.law.robot.n
    x = state.x + np.concatenate([np.zeros(n), *(rng.normal(0, s, n) for s in (1e-4, 0.1, 0.1))])
    environment = row[0][: loop.plant.rhs.size1_in(1) - n]
    u = np.concatenate([s.held, environment])
    chance = rng.normal(0, 0.1, loop.period.function.size1_in(2))
    told = rng.uniform(0.1, 0.5, loop.period.function.size1_in(1))
    return [
        Part("plant", loop.plant.rhs, [x, u, s.plant]),
        Part("control", loop.control, [x, state.controller, row[0], s.numbers]),
        Part("row", loop.period.function, [np.ones(1), told, chance]),
        Part("truth", loop.outputs, [x, s.held, environment, s.numbers]),
    ]


def timing_text(parts: list[Part], width: int | None) -> str:
    """Return C text with `time_NAME(n, inputs, outputs)` for each part, which calls it n times in a row."""
    lines = [lane_source([part.function for part in parts], width)]
    for part in parts:
        f = part.function
        told = [f"x[{i}]" for i in range(f.n_in())] + [f"y[{i}]" for i in range(f.n_out())]
        lines.append(
            f"LANE_EXPORT void time_{part.name}(long long n, lanes** x, lanes** y)\n"
            f"{{ for (long long k = 0; k < n; k++) {{ {f.name()}_in_lanes({', '.join(told)});"
            " x[0][0] += 1e-30 * y[0][0]; } }"
        )
    return "\n".join((*lines, "LANE_EXPORT int width(void) { return LANES; }"))


class Alone:
    """Calls the parts of one library, compiled from `timing_text`."""

    def __init__(self, library: Path, parts: list[Part]):
        self.library = ctypes.CDLL(str(library))
        self.width: int = self.library.width()
        self.kept, self.arguments = [], {}
        for part in parts:
            f = part.function
            x = [_lanes(value, self.width) for value in part.point]
            y = [_lanes(np.zeros(f.size1_out(i)), self.width) for i in range(f.n_out())]
            self.kept += [*x, *y]
            self.arguments[part.name] = tuple(
                (ctypes.c_void_p * len(a))(*(v.ctypes.data for v in a)) for a in (x, y)
            )

    def seconds(self, name: str, calls: int) -> float:
        """Return the time of one call of a part [s]."""
        routine = getattr(self.library, f"time_{name}")
        routine.argtypes, routine.restype = [ctypes.c_longlong, ctypes.c_void_p, ctypes.c_void_p], None
        return cpu_seconds(routine, calls, *self.arguments[name]) / calls


def _lanes(value: Array, width: int) -> Array:
    """Return the column with each number in all lanes, where wide registers want it."""
    room = np.empty(value.size * width + 16)
    begin = -room.ctypes.data % 128 // 8
    column = room[begin : begin + value.size * width]
    column[:] = np.repeat(value, width)
    return column


def code_of(library: Path, parts: list[Part]) -> dict[str, Code]:
    """Return what the machine code of the parts is made of; nothing without objdump, or for another processor."""
    if shutil.which("objdump") is None:
        return {}
    done = subprocess.run(
        ["objdump", "-d", "--no-show-raw-insn", "-M", "att", str(library)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    found = {}
    for part in parts:
        begin = done.stdout.find(f"<{part.function.name()}_in_lanes>:\n")
        if begin < 0:
            return {}
        text = done.stdout[begin:].split("\n\n", 1)[0]
        rows = [m.groups() for m in re.finditer(r"^\s*([0-9a-f]+):\s+(\S+)[ \t]*(.*)$", text, re.M)]
        kinds: Counter[str] = Counter()
        for _, op, of in rows:
            kinds.update(_kinds(op, of))
        size = int(rows[-1][0], 16) - int(rows[0][0], 16)
        counts = (kinds[k] for k in ("arithmetic", "divisions", "logic", "loads", "stores"))
        found[part.name] = Code(size, len(rows), *counts)
    return found


def _kinds(op: str, of: str) -> list[str]:
    if not op.startswith("v") or not re.search(r"%[xyz]mm|%k[0-7]", of):
        return []
    kinds = []
    if re.match(r"v(div|sqrt)", op):
        kinds.append("divisions")
    elif re.match(r"v(add|sub|mul|fn?m(add|sub))", op):
        kinds.append("arithmetic")
    elif re.match(r"v(p?(cmp|and|or|xor|ternlog|blend|add|sub|sll|srl)|(min|max|rndscale|round))", op):
        kinds.append("logic")
    memory = re.search(r"\(", of)
    if memory:
        operands = re.split(r",(?![^(]*\))", re.sub(r"#.*|<.*", "", of))
        kinds.append("stores" if "(" in operands[-1] else "loads")
    return kinds


def native_seconds(problem: Problem, periods: int) -> float:
    """Return the time of one period of the compiled loop in all lanes [s], without what Python does around it."""
    s, lanes = problem, lane_loop(problem)
    assert s is not None
    compiled = compiled_sampled_loop(s.loop)
    row = compiled.loop.period
    drawn, timing = Chance(problem, row).take(0, periods)
    told = [
        Change(o.first, lane, o.numbers) for o in schedule(problem, row)[:1] for lane in range(lanes.width)
    ]
    inputs = LaneInputs(0, told, *(np.repeat(a[..., None], lanes.width, axis=-1) for a in (drawn, timing)))
    state = lanes.start([start(problem, compiled)] * lanes.width)
    numbers = [np.repeat(p[:, None], lanes.width, axis=1) for p in (s.plant, s.numbers)]
    longest = np.full(lanes.width, longest_step(problem, compiled.plant))
    every = round(problem.output_interval / s.period)
    kept, robot = np.arange(100), problem.law.robot
    watched = np.concatenate([s.numbers, compiled.loop.witness.numbers(robot, problem.tank.initial)])
    p_watch = np.repeat(watched[:, None], lanes.width, axis=1)

    def advance() -> None:
        lanes.advance(state, inputs, *numbers, s.period, longest, kept, every, p_watch=p_watch)

    return cpu_seconds(advance) / periods
