"""Which gains a rate and a delay allow: the border of stability of the sampled loop, and the refusal beyond it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.control.law import ImpedanceLaw
from passiflex.errors import UnstableLoopError
from passiflex.simulation.altered import altered
from passiflex.simulation.linear_loop import LinearLoop, Spectrum
from passiflex.simulation.problem import Problem

Array = NDArray[np.float64]

INERTIA_RATIOS = (1e-3, 4.0)
STIFFNESS_RATIOS = (0.25, 20.0)
RATES = (50.0, 200e3)
"""Where borders are looked for: B_e/B, K_e/K and the control rate [Hz]."""
PRECISION = 1e-3
"""Relative precision of a border."""
SCAN = 24
"""Points that are tried, evenly in the logarithm, before a border is refined."""


class Admissible(NamedTuple):
    """Whether the gains of a problem hold at its rate and delay, and which would.

    Attributes
    ----------
    spectrum: The dominant mode of the problem's own gains.
    rate, delay: [Hz], [s].
    stiffness_ratio, inertia_ratio: K_e/K and B_e/B of the problem, nan if they differ between joints.
    least_inertia: Smallest stable B_e/B with the problem's K_e; inf if there is none.
    most_stiffness: Largest stable K_e/K with the problem's B_e; 0 if there is none.
    least_inertia_unshaped: Smallest stable B_e/B with K_e = K; inf if there is none.
    from_rate: Rate from which the problem's gains are stable, with as many periods of delay [Hz]; inf if none.
    """

    spectrum: Spectrum
    rate: float
    delay: float
    stiffness_ratio: float
    inertia_ratio: float
    least_inertia: float
    most_stiffness: float
    least_inertia_unshaped: float
    from_rate: float

    @property
    def sentence(self) -> str:
        """Return the answer in words."""
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
        if not self.spectrum.stable:
            words.append(
                f"your gains are unstable, joint {self.spectrum.joint} grows {self.spectrum.radius:.4g}-fold "
                f"per period, at {self.spectrum.frequency:.0f} Hz;"
            )
        if self.from_rate < math.inf:
            words.append(f"your gains are stable from {hertz(self.from_rate)} on")
        else:
            words.append(f"your gains are stable at no rate up to {hertz(RATES[1])}")
        return " ".join(words) + (" with as many periods of delay" if self.delay > 0 else "")


def check(problem: Problem, rate: float | None = None, delay: float | None = None) -> Admissible:
    """Return whether the problem's gains hold at a rate [Hz] and delay [s], its own unless given.

    The law knows of both: its inner loop predicts over that delay.

    Raises
    ------
    ValueRangeError
        For a problem in continuous time, or a rate or delay that makes no sense.
    """
    changed = altered(problem, rate=rate, delay=delay)
    assert changed.sampling is not None
    return _judged(LinearLoop(changed), changed.sampling.delay)


def _judged(loop: LinearLoop, late: float) -> Admissible:
    """Return the answer for a loop whose commands are this late [s], whatever its law predicts over."""
    period = loop.s.period
    K_ratio, B_ratio = _ratios(loop.problem)
    shaped = isinstance(loop.problem.law, ImpedanceLaw)
    nan = math.nan
    return Admissible(
        spectrum=loop.spectrum(period, late),
        rate=1 / period,
        delay=late,
        stiffness_ratio=K_ratio,
        inertia_ratio=B_ratio,
        least_inertia=least_inertia(loop, K_ratio, period, late) if shaped else nan,
        most_stiffness=most_stiffness(loop, B_ratio, period, late) if shaped else nan,
        least_inertia_unshaped=least_inertia(loop, 1.0, period, late) if shaped else nan,
        from_rate=stable_from(loop, late / period),
    )


def require_stable(problem: Problem) -> None:
    """Raise unless the linear loop and its fallback are stable, or the scenario insists.

    Raises
    ------
    UnstableLoopError
        With the nearest gains that hold.
    """
    assert problem.sampling is not None
    if problem.sampling.insist:
        return
    loop = LinearLoop(problem)
    late = {problem.sampling.delay, problem.sampling.delay + problem.sampling.jitter}
    changes = [{"stiffness": c.stiffness, "damping": c.damping} for c in problem.sampling.gains]
    if all(loop.radius(delay=d, gains=gains) < 1 for d in late for gains in ({}, *changes)):
        _require_stable_fallback(loop, late)
        return
    if all(loop.radius(delay=d) < 1 for d in late):
        raise UnstableLoopError(
            f"the law of {problem.name!r} becomes unstable by its change of gains",
            got="a K_x or D_x in `gains` that does not hold at this rate and delay",
            needs="gains between which the loop stays stable",
            try_="passiflex limits, which maps K_x and D_x; or control.insist: true",
        )
    found = _judged(loop, max(late))
    raise UnstableLoopError(
        f"the law is unstable at the rate and delay of {problem.name!r}",
        got=f"radius {found.spectrum.radius:.4g} per period of {1 / found.rate:g} s, joint {found.spectrum.joint}, "
        f"{found.spectrum.frequency:.0f} Hz",
        needs=found.sentence,
        try_=_remedy(found) + ", or control.insist: true",
    )


def _require_stable_fallback(loop: LinearLoop, late: set[float]) -> None:
    tank = loop.s.controller.tank
    if tank is None or not tank.falls_back:
        return
    gains = loop.fallback()
    loop = loop.without_actions()  # the valve of a law that has fallen back is shut
    radius = max(loop.radius(delay=d, gains=gains) for d in late)
    if radius < 1:
        return
    least = max(least_inertia(loop, 1.0, loop.s.period, d) for d in late)
    raise UnstableLoopError(
        f"the fallback of {loop.problem.name!r} is unstable at its rate and delay",
        got=f"radius {radius:.4g} per period of {loop.s.period:g} s",
        needs="a law that stops the arm at this rate and delay",
        try_=f"control.fallback.shaped_inertia: {{ratio: {_round_up(1.2 * least):g}}}"
        if math.isfinite(least)
        else "a higher rate, less delay, or softer K_x and D_x in control.fallback",
    )


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


def _remedy(found: Admissible) -> str:
    if math.isfinite(found.least_inertia):
        return f"shaped_inertia: {{ratio: {_round_up(1.2 * found.least_inertia):g}}}"
    if math.isfinite(found.least_inertia_unshaped):
        return (
            "shaped_stiffness: {ratio: 1} with shaped_inertia: "
            f"{{ratio: {_round_up(1.2 * found.least_inertia_unshaped):g}}}"
        )
    return "a higher rate, less delay, or softer gains"


def _round_up(value: float) -> float:
    """Return the value with two digits, rounded up."""
    step = 10 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / step) * step


def hertz(rate: float) -> str:
    """Return a rate in words."""
    return f"{rate / 1e3:.3g} kHz" if rate >= 1e3 else f"{rate:.3g} Hz"


def delay_words(periods: float) -> str:
    """Return a delay in words."""
    periods = round(periods, 9)
    return f"{periods:g} period{'s' * (periods != 1)} of delay" if periods else "no delay"
