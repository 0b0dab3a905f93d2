"""The one judge of stability: does a sampled law hold at its start, whatever its scenario lets happen?

`simulate` refuses by it, `limits` and `recommend` find by it, campaigns ask it. It looks at the law's own gains and
those that it goes over to, at both ends of the jitter, at periods missed at random, and at the fallback.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple

from passiflex.problems.problem import Problem
from passiflex.stability.law_slope import Gains
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.many_gains import judged_gains
from passiflex.stability.missed import dies_out
from passiflex.stability.modes import Spectrum

Part = Literal["law", "gains", "fallback"]


class Case(NamedTuple):
    """One thing that may happen: which part of the scenario acts, on which loop, how late [s], with which gains."""

    part: Part
    loop: LinearLoop
    delay: float
    gains: Gains


@dataclass(frozen=True)
class Judgement:
    """Whether a sampled law holds, and what decides it.

    Attributes
    ----------
    spectrum: The dominant mode of the case that is worst.
    part: Which part of the scenario that is: the law's own gains, those of a change of gains, or the fallback.
    rate, delay: Of that case [Hz], [s]; the delay with the jitter, where that end is the worse one.
    missed: Share of missed periods, if the mean square does not die out with them although each period alone would
        do; else 0.
    """

    spectrum: Spectrum
    part: Part
    rate: float
    delay: float
    missed: float = 0.0

    @property
    def stable(self) -> bool:
        """Return whether everything dies out that should; drift is no instability."""
        return self.spectrum.stable and not self.missed


def judge(problem: Problem) -> Judgement:
    """Return the judgement of a sampled problem at its start.

    Raises
    ------
    ValueRangeError
        For a problem in continuous time.
    """
    loop = LinearLoop(problem)
    cases = [*law_cases(loop), *fallback_cases(loop)]
    worst = _worst(cases)
    found = _of(worst)
    if found.stable:  # then it is the law's own motion that is of interest
        found = _of(_worst([c for c in cases if c.part != "fallback"]))
    missed = loop.problem.missed
    if found.stable and missed:
        for case in cases:
            if not dies_out(case.loop, missed, case.delay, case.gains):
                return _of(case, missed)
    return found


def holds(problem: Problem, *, native: bool = True) -> bool:
    """Return whether the judge lets the problem pass: looks no further than the first case that fails.

    Where it is not compiled yet and native is not wanted, nothing is compiled for it.
    """
    loop = LinearLoop(problem, native=native)
    missed = loop.problem.missed
    return all(
        c.loop.radius(delay=c.delay, gains=c.gains) < 1
        and (not missed or dies_out(c.loop, missed, c.delay, c.gains))
        for c in (*law_cases(loop), *fallback_cases(loop))
    )


def judged_fallback(problem: Problem) -> Judgement | None:
    """Return the judgement of the fallback alone; None where there is none."""
    cases = list(fallback_cases(LinearLoop(problem)))
    if not cases:
        return None
    found, missed = _of(_worst(cases)), cases[0].loop.problem.missed
    for case in cases if found.stable and missed else ():
        if not dies_out(case.loop, missed, case.delay, case.gains):
            return _of(case, missed)
    return found


def law_cases(loop: LinearLoop) -> Iterator[Case]:
    """Yield the law's own gains and those that it goes over to, of very many the worst, at both ends of the jitter."""
    s = loop.problem
    for delay in sorted({s.delay, s.delay + s.jitter}):
        yield Case("law", loop, delay, {})
        for change in judged_gains(loop, delay):
            yield Case("gains", loop, delay, {"stiffness": change.stiffness, "damping": change.damping})


def fallback_cases(loop: LinearLoop) -> Iterator[Case]:
    """Yield the fallback at both ends of the jitter, if the tank has one; the valve is shut by then."""
    s, tank = loop.problem, loop.problem.controller.tank
    if tank is None or not tank.falls_back:
        return
    alone, gains = loop.without_actions(), loop.fallback()
    for delay in sorted({s.delay, s.delay + s.jitter}):
        yield Case("fallback", alone, delay, gains)


def _worst(cases: list[Case]) -> Case:
    return max(cases, key=lambda c: c.loop.radius(delay=c.delay, gains=c.gains))


def _of(case: Case, missed: float = 0.0) -> Judgement:
    spectrum = case.loop.spectrum(delay=case.delay, gains=case.gains)
    return Judgement(spectrum, case.part, 1 / case.loop.problem.period, case.delay, missed)
