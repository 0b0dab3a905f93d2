"""The carts of `carts.py` with all that can differ from lane to lane, in lanes and each alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as cs
import numpy as np

from native.carts import FIRST_COMMAND, GAINS, PERIOD, START, regulator
from passiflex.native import Change, HeldLoop, LaneFunctions, LaneInputs, LaneLoop, LaneState, Samples
from passiflex.native.lane_data import LaneSamples
from passiflex.native.python_loop import TOGETHER


def period_row() -> cs.Function:
    """Return (time, told, drawn) → row: a push that is drawn, a target that is told and moves with the time."""
    time, told, drawn = cs.SX.sym("time"), cs.SX.sym("told", 3), cs.SX.sym("drawn", 2)
    return cs.Function("row", [time, told, drawn], [cs.vertcat(drawn, told[:2] + cs.sin(told[2] * time))])


def truth() -> cs.Function:
    """Return (x, command, environment, p) → the force, the distance to the start, the first gain."""
    x, u, s, p = cs.SX.sym("x", 4), cs.SX.sym("u", 2), cs.SX.sym("s", 2), cs.SX.sym("p", 3)
    return cs.Function("truth", [x, u, s, p], [cs.vertcat(u + s, cs.norm_2(x[:2] - START[:2]), p[0])])


def functions(plant: cs.Function) -> LaneFunctions:
    return LaneFunctions(plant, regulator(), period_row(), truth())


@dataclass
class Robot:
    """What one lane does; delays in periods: `delay` and up to `jitter` more."""

    seed: int = 0
    mass: float = 2.0
    gains: np.ndarray = field(default_factory=lambda: GAINS)
    delay: float = 0.0
    jitter: float = 0.0
    missed: float = 0.0
    longest: float = PERIOD
    begin: np.ndarray = field(default_factory=lambda: START)
    changes: Sequence[int] = (0,)
    push: float = 1.0

    def told(self) -> list[tuple[int, np.ndarray]]:
        rng = np.random.default_rng([1, self.seed])
        return [(k, rng.uniform(-1, 1, 3)) for k in self.changes]

    def chance(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return what is drawn (count, 2), and timing (count, 2)."""
        rng = np.random.default_rng([2, self.seed])
        delays = (self.delay + self.jitter * rng.random(count)) * PERIOD
        runs = (rng.random(count) >= self.missed).astype(float)
        return self.push * rng.uniform(-1, 1, (count, 2)), np.column_stack([delays, runs])

    def rows(self, count: int) -> np.ndarray:
        f, rows, told = period_row(), [], np.zeros(3)
        for k, drawn in enumerate(self.chance(count)[0]):
            told = next((numbers for first, numbers in reversed(self.told()) if first <= k), told)
            rows.append(f(k * PERIOD, told, drawn).full().ravel())
        return np.array(rows)


ROBOTS = (
    Robot(0),
    Robot(1, mass=1.3, delay=0.35, longest=0.03, changes=(0, 7)),
    Robot(2, gains=np.array([1.0, 1.8, 0.01]), delay=1.5, missed=0.3, longest=0.3 * PERIOD),
    Robot(3, mass=4.0, delay=3.0, changes=(0, 1, 20, 39), longest=0.011),
    Robot(4, jitter=3.0, missed=0.2, longest=0.05, begin=-START),
    Robot(5, gains=np.array([0.5, 0.4, 0.0]), delay=0.2, jitter=0.7, changes=(3, 13)),
    Robot(6, mass=0.9, delay=1.0, jitter=1e-7, longest=0.07),
    Robot(7, delay=1 - 1e-10, missed=0.5, changes=(0, 20, 21, 22), begin=2 * START),
)
"""Ahead of the delay, in the middle of a period, after several; commands that wait for one before them."""


def side_by_side(
    loop: LaneLoop,
    robots: Sequence[Robot],
    count: int = 40,
    chunks: Sequence[int] = (),
    *,
    last: bool = False,
    record_every: int = 1,
    kept: np.ndarray | None = None,
) -> tuple[np.ndarray, list[LaneSamples]]:
    """Return all that was recorded (samples, numbers, lanes), and what came of each chunk."""
    held = HeldLoop(_like(loop), regulator())
    state = loop.start([held.start(r.begin, np.zeros(3), FIRST_COMMAND) for r in robots])
    drawn, timing = (np.stack(part, axis=-1) for part in zip(*(r.chance(count) for r in robots), strict=True))
    told = [Change(k, lane, numbers) for lane, r in enumerate(robots) for k, numbers in r.told()]
    p_plant, p_control = np.array([[r.mass for r in robots]]), np.stack([r.gains for r in robots], axis=1)
    longest = np.array([r.longest for r in robots])
    kept = np.arange(loop.instant["row"].stop) if kept is None else kept
    parts, first = [], 0
    for size in chunks or (count,):
        here = slice(first, first + size)
        changes = [c for c in told if first <= c.period < first + size]
        inputs = LaneInputs(first, changes, drawn[here], timing[here])
        end = last and first + size == count
        parts.append(
            loop.advance(state, inputs, p_plant, p_control, PERIOD, longest, kept, record_every, last=end)
        )
        state, first = parts[-1].state, first + size
    return np.concatenate([part.values for part in parts]), parts


def _like(loop: LaneLoop) -> cs.Function:
    """Return a function with the sizes of the loop's plant, for `HeldLoop.start`."""
    shapes = [cs.SX.sym(name, size) for name, size in (("x", loop.n_x), ("u", loop.n_u + loop.n_s), ("p", 1))]
    return cs.Function("like", shapes, [cs.SX.zeros(loop.n_x), cs.SX.zeros(loop.n_q)])


def alone(
    loop: HeldLoop, robot: Robot, count: int = 40, *, last: bool = False, record_every: int = 1
) -> Samples:
    """Return what `HeldLoop` makes of a robot."""
    _, timing = robot.chance(count)
    return loop.advance(
        loop.start(robot.begin, np.zeros(3), FIRST_COMMAND), robot.rows(count), timing,
        [robot.mass], robot.gains, PERIOD, robot.longest, record_every, last=last,
    )  # fmt: skip


def waiting(state: LaneState, lane: int) -> np.ndarray:
    """Return the command in force and those on their way in a lane; `HeldLoop` takes what is due a moment earlier."""
    line = state.line[lane]
    queue = line[3 : 3 + 3 * int(line[0])].reshape(-1, 3)
    due = queue[:, 0] <= TOGETHER * PERIOD
    held = queue[due][-1, 1:] if due.any() else line[1:3]
    return np.concatenate([[(~due).sum()], held, queue[~due].ravel()])
