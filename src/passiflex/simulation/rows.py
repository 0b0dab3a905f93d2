"""What a sampled loop is told in each period: reference, gains, forces, noise, and which periods are late or missed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from passiflex.native import NativeFunction
from passiflex.simulation.motion import MOTION, Motion
from passiflex.simulation.problem import Event, Interval, Problem
from passiflex.simulation.sampled_loop import SampledLoop

Array = NDArray[np.float64]

NOW = 1e-9
"""Two instants closer than this are one [s]."""


class Rows:
    """The rows of one run, made piece by piece; events take effect at the first sample at or after them.

    Noise, jitter and missed periods have a random stream each, so that one of them changes nothing about
    the others.
    """

    def __init__(self, problem: Problem, loop: SampledLoop, reference: NativeFunction):
        assert problem.sampling is not None
        self.problem, self.s, self.loop, self.reference = problem, problem.sampling, loop, reference
        streams = np.random.SeedSequence(problem.seed).spawn(3)
        self.noise, self.late, self.lost = (np.random.default_rng(s) for s in streams)
        self.since = 1  # periods since the law last ran

    def take(self, first: int, count: int) -> tuple[Array, Array]:
        """Return rows (count, n) and timing (count, 2) of the periods from number `first` on, in order."""
        time: Array = np.arange(first, first + count, dtype=np.float64) * self.s.period
        runs: Array = np.ones(count)
        if self.s.missed:
            runs[self.lost.random(count) < self.s.missed] = 0.0
        if first == 0:
            runs[0] = 1.0
        delay = self.s.delay + (self.s.jitter * self.late.random(count) if self.s.jitter else 0.0)
        timing = np.column_stack([np.broadcast_to(delay, count), runs])
        rows = np.zeros((count, self.loop.row.size))
        at = self.loop.row.slices
        self._events(rows, time)
        stiffness, damping = self._gains(time)
        rows[:, at["desired_stiffness"]] = stiffness.reshape(count, -1)
        rows[:, at["desired_damping"]] = damping.reshape(count, -1)
        for name, intervals in (("feedforward", self.s.feedforward), ("viscous_drag", self.s.drags)):
            for interval in intervals:
                start = at[name].start
                rows[_inside(interval, time), start : start + interval.numbers.size] += interval.numbers
        if self.problem.noise is not None:
            n = self.problem.law.robot.n
            rows[:, at["torque_noise"]] = self.noise.normal(
                0.0, np.sqrt(self.problem.noise.variance), size=(count, n)
            )
        rows[:, at["elapsed"]] = (self._elapsed(runs) * self.s.period)[:, None]
        return rows, timing

    def _events(self, rows: Array, time: Array) -> None:
        at, events = self.loop.row.slices, self.problem.events
        starts = np.array([e.time for e in events])
        which = np.searchsorted(starts, time + NOW, side="right") - 1
        known = slice(at["desired_position"].start, at["desired_acceleration"].stop)
        for i in np.unique(which):
            here = np.flatnonzero(which == i)
            motion, began = _motion(events[: i + 1])
            numbers = MOTION.pack(motion)
            rows[here, known] = self.reference.map(np.maximum(time[here] - began, 0.0)[:, None], numbers)
            rows[here, at["F_e"]] = events[i].F_e

    def _gains(self, time: Array) -> tuple[Array, Array]:
        gains = self.problem.law.layout.unpack(self.problem.gains)
        done = [c for c in self.s.gains if c.end <= time[0]]
        going = [c for c in self.s.gains if c.end > time[0] and c.start <= time[-1]]
        values = []
        for name in ("stiffness", "damping"):
            begin = getattr(done[-1], name) if done else gains[name]
            value = np.broadcast_to(begin, (time.size, *begin.shape)).copy()
            for change in going:
                s = np.clip((time - change.start) / (change.end - change.start), 0, 1)
                blend = (s**3 * (10 - 15 * s + 6 * s**2))[:, None, None]
                target = getattr(change, name)
                value = np.where(blend >= 1, target, value + blend * (target - value))
            values.append(value)
        return values[0], values[1]

    def _elapsed(self, runs: Array) -> Array:
        """Return in each period how many periods ago the law ran last."""
        out = np.empty(runs.size)
        for i, ran in enumerate(runs):
            out[i] = self.since
            self.since = 1 if ran else self.since + 1
        return out


def _motion(events: tuple[Event, ...]) -> tuple[Motion, float]:
    """Return the motion in force after these events, and when it began."""
    return next((e.motion, e.time) for e in reversed(events) if e.motion is not None)


def _inside(interval: Interval, time: Array) -> NDArray[np.bool_]:
    return (time + NOW >= interval.start) & (time + NOW < interval.end)
