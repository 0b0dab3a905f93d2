"""What a sampled loop is told in each period: reference, gains, forces, noise, and which periods are late or missed."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.control.motion import Motion
from passiflex.loops.period_row import PeriodRow
from passiflex.native import NativeFunction
from passiflex.problems.problem import Event, SampledProblem

Array = NDArray[np.float64]

NOW = 1e-9
"""Two instants closer than this are one [s]."""


class Scheduled(NamedTuple):
    """From period `first` on, these numbers of `PeriodRow.schedule` hold."""

    first: int
    numbers: Array


def schedule(problem: SampledProblem, row: PeriodRow) -> list[Scheduled]:
    """Return what is told to the loop, in the order of time; each takes effect at the first sample at or after it."""
    period = problem.period
    times = {e.time for e in problem.events} | {c.start for c in problem.gain_changes}
    times |= {t for i in problem.feedforward for t in (i.start, i.end)}
    firsts = sorted({_first_period(t, period) for t in times})
    within = (k for k in firsts if k * period <= problem.duration + NOW)
    return [Scheduled(k, _in_force(problem, row, k * period)) for k in within]


class Chance:
    """The chance of one run, made chunk by chunk: noise, and which periods are late or missed.

    Noise, jitter and missed periods have a random stream each, so that one of them changes nothing about
    the others.
    """

    def __init__(self, problem: SampledProblem, row: PeriodRow):
        self.problem, self.row = problem, row
        streams = np.random.SeedSequence(problem.seed).spawn(3)
        self.noise, self.late, self.lost = (np.random.default_rng(s) for s in streams)
        self.since = 1  # periods since the law last ran
        self.held: Array = np.zeros((0, row.n))  # the noise that lasts into the next chunk

    def take(self, first: int, count: int) -> tuple[Array, Array]:
        """Return what is drawn (count, n) and timing (count, 2) for the periods from number `first` on, in order."""
        runs: Array = np.ones(count)
        if self.problem.missed:
            runs[self.lost.random(count) < self.problem.missed] = 0.0
        if first == 0:
            runs[0] = 1.0
        delay = self.problem.delay + (
            self.problem.jitter * self.late.random(count) if self.problem.jitter else 0.0
        )
        drawn = np.zeros((count, self.row.drawn.size))
        at = self.row.drawn.slices
        if self.problem.noise is not None:
            drawn[:, at["torque_noise"]] = self._noise(first, count)
        drawn[:, at["elapsed"]] = (self._elapsed(runs) * self.problem.period)[:, None]
        return drawn, np.column_stack([np.broadcast_to(delay, count), runs])

    def _noise(self, first: int, count: int) -> Array:
        """Return the noise of each period; a sample of it may last for several."""
        assert self.problem.noise is not None
        deviation, hold = math.sqrt(self.problem.noise.variance), self.problem.noise.hold
        lasting = round(hold / self.problem.period)
        which = np.arange(first, first + count) // lasting
        begun = len(self.held)  # the first sample began in the chunk before
        fresh = self.noise.normal(0.0, deviation, size=(which[-1] - which[0] + 1 - begun, self.row.n))
        samples = np.concatenate([self.held, fresh])
        self.held = samples[-1:] if (first + count) % lasting else samples[:0]
        return samples[which - which[0]]

    def _elapsed(self, runs: Array) -> Array:
        """Return in each period how many periods ago the law ran last."""
        index = np.arange(runs.size)
        ran = np.maximum.accumulate(np.where(runs > 0, index, -self.since))
        before = np.concatenate([[-self.since], ran[:-1]])
        self.since = int(runs.size - ran[-1])
        return np.asarray(index - before, dtype=float)


class PeriodRows:
    """The rows of one run, made chunk by chunk."""

    def __init__(self, problem: SampledProblem, row: PeriodRow, function: NativeFunction):
        self.period, self.function = problem.period, function
        self.chance, self.schedule = Chance(problem, row), schedule(problem, row)

    def take(self, first: int, count: int) -> tuple[Array, Array]:
        """Return rows (count, n) and timing (count, 2) of the periods from number `first` on, in order."""
        drawn, timing = self.chance.take(first, count)
        time = np.arange(first, first + count, dtype=np.float64) * self.period
        begins = [*(scheduled.first for scheduled in self.schedule), first + count]
        parts = []
        for scheduled, end in zip(self.schedule, begins[1:], strict=True):
            here = slice(max(scheduled.first - first, 0), max(min(end, first + count) - first, 0))
            if here.start < here.stop:
                parts.append(self.function.map(time[here][:, None], scheduled.numbers, drawn[here]))
        return np.vstack(parts), timing


def _first_period(time: float, period: float) -> int:
    """Return the number of the first sample at or after an instant."""
    k = max(0, math.ceil((time - NOW) / period))
    while k > 0 and (k - 1) * period + NOW >= time:
        k -= 1
    while k * period + NOW < time:
        k += 1
    return k


def _in_force(problem: SampledProblem, row: PeriodRow, time: float) -> Array:
    gains = problem.law.layout.unpack(problem.gains)
    so_far = tuple(e for e in problem.events if e.time <= time + NOW)
    motion, began = _motion(so_far)
    changes = [c for c in problem.gain_changes if c.start <= time + NOW]
    old = changes[-2] if len(changes) > 1 else None
    new = changes[-1] if changes else None
    pushing = (i.numbers for i in problem.feedforward if i.start <= time + NOW < i.end)
    values: dict[str, Any] = {
        **row.environment.zeros(),
        **so_far[-1].environment,
        **motion,
        "began": began,
        "feedforward": sum(pushing, np.zeros(6)),
        "change_from": new.start if new else -1.0,
        "change_to": new.end if new else 0.0,
    }
    for name in ("stiffness", "damping"):
        values[f"old_{name}"] = getattr(old, name) if old else gains[name]
        values[f"new_{name}"] = getattr(new, name) if new else gains[name]
    return row.schedule.pack({f.name: values[f.name] for f in row.schedule})


def _motion(events: tuple[Event, ...]) -> tuple[Motion, float]:
    """Return the motion in force after these events, and when it began."""
    return next((e.motion, e.time) for e in reversed(events) if e.motion is not None)
