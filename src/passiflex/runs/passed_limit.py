"""Which limits of its robot a run passed: joint ranges, joint speeds, motor torques; one sentence for each kind."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.loops.joint_extremes import SLACK
from passiflex.problems.unbooked import listed
from passiflex.runs.run import Run
from passiflex.runs.run_arm import chain_of

Array = NDArray[np.float64]

WORDS = {
    "position": "joint {} leaves its range",
    "speed": "joint {} exceeds its speed limit",
    "torque": "motor {} exceeds its torque limit",
}
"""What is said of each kind of limit."""


class PassedLimit(NamedTuple):
    """A limit of the robot that a run passed.

    Attributes
    ----------
    kind: position, speed or torque.
    joint: The joint that passed its limit first, counted from 1.
    time: When that was [s].
    limit: The limit of that joint; of its range the end that it went beyond most.
    most: By how much it was passed at most.
    unit: Of both.
    others: The other joints that passed theirs at any time.
    every_step: Whether it was looked for in every step or period, and not at the rows alone.
    """

    kind: str
    joint: int
    time: float
    limit: float
    most: float
    unit: str
    others: tuple[int, ...]
    every_step: bool

    def __str__(self) -> str:
        """Return the sentence."""
        said = WORDS[self.kind].format(self.joint)
        by = f"{said}, {self.limit:.4g} {self.unit}, first at {self.time:.4g} s, by {self.most:.4g} {self.unit} at most"
        who = "motor" if self.kind == "torque" else "joint"
        verb = f"so does {who}" if len(self.others) == 1 else f"so do {who}s"
        also = f"; {verb} {listed([str(joint) for joint in self.others])}" if self.others else ""
        return by + also + ("" if self.every_step else " (as far as its rows show)")


class _Reached(NamedTuple):
    """How far the joints went to either side (n,), and which passed its limit first, and when."""

    low: Array
    high: Array
    joint: int
    time: float
    every_step: bool


def passed_limits(run: Run) -> tuple[PassedLimit, ...]:
    """Return the limits that a run passed, at most one of each kind; none where the robot has none.

    A sampled loop notes its joints in every period, one in continuous time at every step, all but the torque
    of its motors. That, and all of an older file, is read from the rows.
    """
    found = []
    for kind in WORDS:
        try:
            lower, upper = _ends(run, kind)
            reached = _reached(run, kind, lower, upper)
        except KeyError:  # how a run says that it has no signal of this name
            continue
        below, above = lower - reached.low, reached.high - upper
        excess = np.maximum(below, above)
        i = reached.joint - 1
        if not (0 <= i < excess.size and np.isfinite(reached.time)):
            continue
        others = tuple(int(j) + 1 for j in np.flatnonzero(excess > _rounding(kind, upper)) if j != i)
        limit = float(lower[i] if below[i] > above[i] and kind == "position" else upper[i])
        unit = _unit(run, i, kind)
        found.append(
            PassedLimit(kind, i + 1, reached.time, limit, float(excess[i]), unit, others, reached.every_step)
        )
    return tuple(found)


def _ends(run: Run, kind: str) -> tuple[Array, Array]:
    """Return the least and the largest value that the robot allows (n,)."""
    if kind == "position":
        return run["lower_position_limit"], run["upper_position_limit"]
    most = run["velocity_limit" if kind == "speed" else "torque_limit"]
    return -most, most


def _rounding(kind: str, upper: Array) -> Array:
    """Return by how much rounding may pass a limit (n,): a motor at its limit gives it to the last digits."""
    return np.zeros_like(upper) if kind == "position" else SLACK * upper


def _reached(run: Run, kind: str, lower: Array, upper: Array) -> _Reached:
    """Return what was noted in the loop, or else what the rows show."""
    if f"{kind}_time" in run.data:
        high = run["highest_q" if kind == "position" else f"highest_{kind}"]
        low = run["lowest_q"] if kind == "position" else -high
        return _Reached(low, high, int(run[f"{kind}_joint"]), float(run[f"{kind}_time"]), every_step=True)
    values = run[{"position": "q", "speed": "dq", "torque": "tau_m"}[kind]]
    room = _rounding(kind, upper)
    outside = (values < lower - room) | (values > upper + room)
    row = int(np.argmax(outside.any(axis=1)))
    joint = int(np.argmax(outside[row])) + 1 if outside.any() else 0
    low, high = np.nanmin(values, axis=0), np.nanmax(values, axis=0)
    return _Reached(low, high, joint, float(run.time[row]), every_step=False)


def _unit(run: Run, joint: int, kind: str) -> str:
    """Return the unit of a joint, counted from 0: some turn, some slide."""
    chain = chain_of(run)
    signal = {"position": "q", "speed": "dq", "torque": "tau_m"}[kind]
    unit = str(run.data[signal].attrs.get("units", "")) if signal in run.data else ""
    return chain.unit_of(joint, unit) if chain is not None else unit
