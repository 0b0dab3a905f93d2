"""Which gains a rate and a delay allow: the borders of stability around a problem's own, and the refusal beyond."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.errors import UnstableLoopError
from passiflex.problems.altered import altered
from passiflex.problems.problem import Problem, SampledProblem
from passiflex.stability.causes import Advice, advise
from passiflex.stability.clock_words import delay_words, hertz
from passiflex.stability.judgement import Judgement, judge, judged_fallback
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.modes import Spectrum

Array = NDArray[np.float64]

INERTIA_RATIOS = (1e-3, 4.0)
STIFFNESS_RATIOS = (0.25, 20.0)
RATES = (50.0, 200e3)
"""Where borders are looked for: B_e/B, K_e/K and the control rate [Hz]."""
PRECISION = 1e-3
"""Relative precision of a border."""
SEEN = 1e-3
"""[1/s] Growth of a drift that is worth a word."""
SCAN = 24
"""Points that are tried, evenly in the logarithm, before a border is refined."""


class Admissible(NamedTuple):
    """Whether the gains of a problem hold at its rate and delay, and which would.

    Attributes
    ----------
    judgement: Of the problem, whatever its scenario lets happen to it.
    advice: Why it does not hold and what would; None where it does.
    rate, delay: [Hz], [s].
    stiffness_ratio, inertia_ratio: K_e/K and B_e/B of the problem, nan if they differ between joints.
    least_inertia: Smallest stable B_e/B with the problem's K_e; inf if there is none.
    most_stiffness: Largest stable K_e/K with the problem's B_e; 0 if there is none.
    least_inertia_unshaped: Smallest stable B_e/B with K_e = K; inf if there is none.
    from_rate: Rate from which the problem's gains are stable, with as many periods of delay [Hz]; inf if none.
    lateness: Of the sensor that is latest [s]; it goes along with that rate as well.
    task_periods: From one run of the outer loop to the next, likewise.
    """

    judgement: Judgement
    advice: Advice | None
    rate: float
    delay: float
    stiffness_ratio: float
    inertia_ratio: float
    least_inertia: float
    most_stiffness: float
    least_inertia_unshaped: float
    from_rate: float
    lateness: float = 0.0
    task_periods: int = 1

    @property
    def stable(self) -> bool:
        """Return whether the problem holds."""
        return self.judgement.stable

    @property
    def spectrum(self) -> Spectrum:
        """Return the dominant mode of what is worst."""
        return self.judgement.spectrum

    @property
    def sentence(self) -> str:
        """Return the answer in words: one line, or three of cause, number and remedy."""
        if self.advice is not None:
            return str(self.advice)
        mode = self.spectrum
        drift = ""
        if mode.drifting:
            drift = f"; {drift_words(mode)}"
        return (
            f"at {hertz(self.rate)} with {delay_words(self.delay * self.rate)} your gains hold: the slowest motion "
            f"dies out by {mode.decay:.2g} 1/s{drift}"
        )

    @property
    def borders(self) -> str:
        """Return the borders around the gains in words."""
        words = [f"at {hertz(self.rate)} with {delay_words(self.delay * self.rate)}:"]
        if not math.isnan(self.most_stiffness):
            low, high = INERTIA_RATIOS[0], STIFFNESS_RATIOS[1]
            words.append(
                f"K_e ≤ {self.most_stiffness:.3g} K with your B_e;"
                if 0 < self.most_stiffness < high
                else f"{'any' if self.most_stiffness else 'no'} K_e up to {high:g} K is stable with your B_e;"
            )
            borders = {"your K_e": self.least_inertia, "K_e = K": self.least_inertia_unshaped}
            if self.stiffness_ratio == 1:
                del borders["your K_e"]
            for whose, border in borders.items():
                words.append(
                    f"B_e ≥ {border:.3g} B with {whose};"
                    if low < border < math.inf
                    else f"no B_e is stable with {whose};"
                    if border == math.inf
                    else f"any B_e down to {low:g} B is stable with {whose};"
                )
        if self.from_rate < math.inf:
            words.append(f"your gains are stable from {hertz(self.from_rate)} on")
        else:
            words.append(f"your gains are stable at no rate up to {hertz(RATES[1])}")
        return " ".join([*words, *self._as_many()])

    def _as_many(self) -> Iterator[str]:
        """Yield what a rate is told with: so many periods are kept."""
        kept = {"of delay": self.delay, "that the sensors are late": self.lateness}
        kinds = [name for name, late in kept.items() if late > 0]
        if kinds:
            yield f"with as many periods {' and '.join(kinds)}"
        if self.task_periods > 1:
            yield f"{'and' if kinds else 'with'} a task_rate of a {self.task_periods}th of it"


def check(problem: Problem, rate: float | None = None, delay: float | None = None) -> Admissible:
    """Return whether the problem's gains hold at a rate [Hz] and delay [s], its own unless given.

    The law knows of both: its inner loop predicts over that delay.

    Raises
    ------
    ValueRangeError
        For a problem in continuous time, or a rate or delay that makes no sense.
    """
    changed = altered(problem, rate=rate, delay=delay)
    found, loop = judge(changed), LinearLoop(changed)
    period, late = changed.period, changed.delay
    K_ratio, B_ratio = _ratios(changed)
    shaped, nan = changed.law.shapes, math.nan
    return Admissible(
        judgement=found,
        advice=None if found.stable else advise(changed, found),
        rate=1 / period,
        delay=late,
        stiffness_ratio=K_ratio,
        inertia_ratio=B_ratio,
        least_inertia=least_inertia(loop, K_ratio, period, late) if shaped else nan,
        most_stiffness=most_stiffness(loop, B_ratio, period, late) if shaped else nan,
        least_inertia_unshaped=least_inertia(loop, 1.0, period, late) if shaped else nan,
        from_rate=stable_from(loop, late / period),
        lateness=max(changed.lateness),
        task_periods=changed.task_periods,
    )


def require_stable(problem: SampledProblem) -> None:
    """Raise unless the judge lets the problem pass. Who insists is let go on if the fallback holds.

    Raises
    ------
    UnstableLoopError
        With cause, number and remedies that were tried.
    """
    allow_unstable = problem.allow_unstable
    found = judged_fallback(problem) if allow_unstable else judge(problem)
    if found is None or found.stable:
        return
    what = {
        "law": f"the law of {problem.name!r} does not hold",
        "gains": f"the law of {problem.name!r} does not hold with the gains that it goes over to",
        "fallback": f"the fallback of {problem.name!r} does not hold, and could not stop the arm",
    }[found.part]
    advice = advise(problem, found)
    all_the_same = allow_unstable or found.part == "fallback"
    insisting = "" if all_the_same else "; or control.allow_unstable: true, to run it all the same"
    raise UnstableLoopError(what, cause=advice.cause, number=advice.number, remedy=advice.remedy + insisting)


def drift_words(mode: Spectrum) -> str:
    """Return what becomes of a self-motion that nothing holds, in words."""
    if mode.drift > SEEN:
        return f"nothing holds the self-motion, which drifts away by {mode.drift:.2g} 1/s"
    if mode.undamped:
        return "nothing holds or damps the self-motion: once pushed, it drifts on"
    return "nothing holds the self-motion: it stays where a push leaves it"


def least_inertia(
    loop: LinearLoop,
    stiffness_ratio: float,
    period: float,
    delay: float,
    points: int = SCAN,
    precision: float = PRECISION,
) -> float:
    """Return the smallest B_e/B from which on the loop is stable with K_e/K; inf if there is none.

    nan stands for the problem's own K_e; points and precision are those of `first_stable`. The law goes on to
    predict over the delay that it was built for.
    """

    def stable(ratio: float) -> bool:
        return loop.radius(period, delay, shaping(loop, stiffness_ratio, ratio)) < 1

    return first_stable(stable, INERTIA_RATIOS, points, precision)


def most_stiffness(loop: LinearLoop, inertia_ratio: float, period: float, delay: float) -> float:
    """Return the largest K_e/K up to which the loop is stable with B_e/B; 0 if there is none."""
    low, high = STIFFNESS_RATIOS
    own, _ = _ratios(loop.problem)
    if own > low and loop.radius(period, delay, shaping(loop, own, inertia_ratio)) < 1:
        low = own  # what holds now is where the border is looked for from
    border = first_stable(
        lambda inverse: loop.radius(period, delay, shaping(loop, 1 / inverse, inertia_ratio)) < 1,
        (1 / high, 1 / low),
    )
    return 1 / border if math.isfinite(border) else 0.0


def stable_from(loop: LinearLoop, periods: float) -> float:
    """Return the rate [Hz] from which on the loop is stable with this many periods of delay; inf if none."""
    return first_stable(lambda rate: loop.radius(1 / rate, periods / rate) < 1, RATES)


def first_stable(
    stable: Callable[[float], bool],
    limits: tuple[float, float],
    points: int = SCAN,
    precision: float = PRECISION,
) -> float:
    """Return the least value from which all larger ones within the limits are stable; inf if the last one is not.

    So many points are tried, evenly in the logarithm; the border is then refined to a relative precision.
    """
    tried = np.geomspace(*limits, points)
    if not stable(tried[-1]):
        return math.inf
    i = points - 1
    while i > 0 and stable(tried[i - 1]):
        i -= 1
    if i == 0:
        return float(tried[0])
    low, high = float(tried[i - 1]), float(tried[i])
    while high / low > 1 + precision:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if stable(middle) else (middle, high)
    return high


def shaping(loop: LinearLoop, stiffness_ratio: float, inertia_ratio: float) -> dict[str, Array]:
    """Return the gains K_e and B_e of these multiples of the model's K and B; nan leaves one as it is."""
    model = loop.problem.law.robot.layout.unpack(loop.problem.model)
    gains = {
        "shaped_stiffness": stiffness_ratio * model["joint_stiffness"],
        "shaped_inertia": inertia_ratio * model["motor_inertia"],
    }
    return {name: value for name, value in gains.items() if not np.isnan(value).any()}


def _ratios(problem: Problem) -> tuple[float, float]:
    gains, model = problem.law.layout.unpack(problem.gains), problem.law.robot.layout.unpack(problem.model)
    if "shaped_stiffness" not in gains:
        return math.nan, math.nan
    pairs = (("shaped_stiffness", "joint_stiffness"), ("shaped_inertia", "motor_inertia"))
    ratios = [gains[shaped] / model[own] for shaped, own in pairs]
    K, B = (float(r[0]) if np.ptp(r) <= 1e-9 * r[0] else math.nan for r in ratios)
    return K, B
