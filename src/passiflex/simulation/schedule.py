"""What a sampled loop is told in each period: reference, gains, forces, noise, and which periods are late or missed."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.control.motion import Motion
from passiflex.loops.period_row import PeriodRow
from passiflex.native import NativeFunction
from passiflex.problems.problem import GainChange, SampledProblem
from passiflex.scenarios.setpoints import OF_STREAM

Array = NDArray[np.float64]

NOW = 1e-9
"""Two instants closer than this are one [s]."""
OF_POSITIONS = OF_STREAM + 1
"""Which random streams of a run's seed draw the noise of q and θ: this one and the next."""


class Scheduled(NamedTuple):
    """From period `first` on, these numbers of `PeriodRow.schedule` hold."""

    first: int
    numbers: Array


def schedule(problem: SampledProblem, row: PeriodRow) -> list[Scheduled]:
    """Return what is told to the loop, in the order of time; each takes effect at the first sample at or after it."""
    period, walk = problem.period, _Walk(problem, row)
    times = {e.time for e in problem.events} | {c.start for c in problem.gain_changes}
    times |= {t for i in problem.feedforward for t in (i.start, i.end)}
    firsts = sorted({_first_period(t, period) for t in times})
    within = (k for k in firsts if k * period <= problem.duration + NOW)
    return [Scheduled(k, walk.until(k * period)) for k in within]


class Chance:
    """The chance of one run, made chunk by chunk: noise, and which periods are late or missed.

    Noise of τ_a, jitter, missed periods, and noise of q and of θ have a random stream each, so that one of them
    changes nothing about the others.
    """

    def __init__(self, problem: SampledProblem, row: PeriodRow):
        self.problem, self.row = problem, row
        streams = np.random.SeedSequence(problem.seed).spawn(OF_POSITIONS + 2)
        self.noise, self.late, self.lost = (np.random.default_rng(s) for s in streams[:3])
        self.link, self.motor = (np.random.default_rng(s) for s in streams[OF_POSITIONS:])
        self.since = 1  # periods since the law last ran
        self.held: Array = np.zeros((0, row.n))  # the noise that lasts into the next chunk

    def take(self, first: int, count: int) -> tuple[Array, Array]:
        """Return what is drawn (count, n) and timing (count, 2) for the periods from number `first` on, in order."""
        runs: Array = np.ones(count)
        if self.problem.missed:
            runs[self.lost.random(count) < self.problem.missed] = 0.0
        for due, periods in self.problem.lost:
            begin = _first_period(due, self.problem.period) - first
            runs[max(begin, 0) : max(begin + periods, 0)] = 0.0
        if first == 0:
            runs[0] = 1.0
        delay = self.problem.delay + (
            self.problem.jitter * self.late.random(count) if self.problem.jitter else 0.0
        )
        drawn = np.zeros((count, self.row.drawn.size))
        at = self.row.drawn.slices
        if self.problem.noise is not None:
            drawn[:, at["torque_noise"]] = self._noise(first, count)
            if self.row.noisy:
                size, noise = (count, self.row.n), self.problem.noise
                drawn[:, at["link_noise"]] = self.link.normal(0.0, noise.link_deviation, size=size)
                drawn[:, at["motor_noise"]] = self.motor.normal(0.0, noise.motor_deviation, size=size)
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


class _Walk:
    """What is in force, from instant to instant in the order of time: each event is looked at once."""

    def __init__(self, problem: SampledProblem, row: PeriodRow):
        self.problem, self.row = problem, row
        self.event = self.change = 0  # how many have begun
        self.motion: Motion | None = None
        self.began = 0.0
        gains = problem.law.layout.unpack(problem.gains)
        self.own = GainChange(-1.0, 0.0, gains["stiffness"], gains["damping"])

    def until(self, time: float) -> Array:
        """Return the numbers of `PeriodRow.schedule` at an instant [s], no earlier than the last one asked for."""
        problem, row = self.problem, self.row
        while self.event < len(problem.events) and problem.events[self.event].time <= time + NOW:
            event = problem.events[self.event]
            if event.motion is not None:
                self.motion, self.began = event.motion, event.time
            self.event += 1
        changes = problem.gain_changes
        while self.change < len(changes) and changes[self.change].start <= time + NOW:
            self.change += 1
        assert self.motion is not None  # there is one from the start
        old, new = (changes[k] if k >= 0 else self.own for k in (self.change - 2, self.change - 1))
        pushing = (i.numbers for i in problem.feedforward if i.start <= time + NOW < i.end)
        values: dict[str, Any] = {
            **row.environment.zeros(),
            **problem.events[self.event - 1].environment,
            **self.motion,
            "began": self.began,
            "feedforward": sum(pushing, np.zeros(6)),
            "change_from": new.start,
            "change_to": new.end,
            "change_linear": float(new.linear),
            "old_in_tool": np.array(old.in_tool, dtype=float),
            "new_in_tool": np.array(new.in_tool, dtype=float),
            "old_stiffness": old.stiffness,
            "new_stiffness": new.stiffness,
            "old_damping": old.damping,
            "new_damping": new.damping,
        }
        return row.schedule.pack({f.name: values[f.name] for f in row.schedule})
