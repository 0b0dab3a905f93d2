"""Which gains a rate and a delay allow: the border of stability of the sampled loop, and the refusal beyond it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.control.law import ImpedanceLaw
from passiflex.errors import UnstableLoopError
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
        periods = self.delay * self.rate
        late = "no delay" if periods < 1e-9 else f"{periods:g} period{'s' * (periods != 1)} of delay"
        words = [f"at {_hertz(self.rate)} with {late}:"]
        if not math.isnan(self.stiffness_ratio):
            words.append(
                f"K_e ≤ {self.most_stiffness:.3g} K with your B_e;"
                if self.most_stiffness
                else "no K_e is stable with your B_e;"
            )
            words.append(
                f"B_e ≥ {self.least_inertia:.3g} B with your K_e;"
                if math.isfinite(self.least_inertia)
                else "no B_e is stable with your K_e;"
            )
            words.append(f"B_e ≥ {self.least_inertia_unshaped:.3g} B with K_e = K;")
        if self.spectrum.stable:
            words.append("your gains are stable")
        else:
            words.append(
                f"your gains are unstable: joint {self.spectrum.joint} grows {self.spectrum.radius:.3g}-fold "
                f"per period, at {self.spectrum.frequency:.0f} Hz"
            )
        stable_from = (
            f"from {_hertz(self.from_rate)} on"
            if math.isfinite(self.from_rate)
            else "at no rate up to 200 kHz"
        )
        words.append(f"({stable_from})")
        return " ".join(words)


def check(problem: Problem, rate: float | None = None, delay: float | None = None) -> Admissible:
    """Return whether the problem's gains hold at a rate [Hz] and delay [s], its own unless given."""
    loop = LinearLoop(problem)
    period = loop.s.period if rate is None else 1 / rate
    late = loop.s.delay if delay is None else delay
    K_ratio, B_ratio = _ratios(problem)
    shaped = isinstance(problem.law, ImpedanceLaw)
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
    """Raise unless the linear loop is stable, or the scenario insists.

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
    if all(loop.spectrum(delay=d).stable for d in late):
        return
    found = check(problem, delay=max(late))
    raise UnstableLoopError(
        f"the law is unstable at the rate and delay of {problem.name!r}",
        got=f"radius {found.spectrum.radius:.4g} per period of {1 / found.rate:g} s, joint {found.spectrum.joint}, "
        f"{found.spectrum.frequency:.0f} Hz",
        needs=found.sentence,
        try_=_remedy(found) + ", or control.insist: true",
    )


def least_inertia(loop: LinearLoop, stiffness_ratio: float, period: float, delay: float) -> float:
    """Return the smallest B_e/B from which on the loop is stable with K_e/K; inf if there is none."""
    K, B = _own(loop)
    stiffness: dict[str, Any] = (
        {} if math.isnan(stiffness_ratio) else {"shaped_stiffness": stiffness_ratio * K}
    )

    def stable(ratio: float) -> bool:
        return loop.spectrum(period, delay, stiffness | {"shaped_inertia": ratio * B}).stable

    return _first_stable(stable, INERTIA_RATIOS)


def most_stiffness(loop: LinearLoop, inertia_ratio: float, period: float, delay: float) -> float:
    """Return the largest K_e/K up to which the loop is stable with B_e/B; 0 if there is none."""
    K, B = _own(loop)
    inertia: dict[str, Any] = {} if math.isnan(inertia_ratio) else {"shaped_inertia": inertia_ratio * B}

    def stable(inverse: float) -> bool:
        return loop.spectrum(period, delay, inertia | {"shaped_stiffness": K / inverse}).stable

    low, high = STIFFNESS_RATIOS
    border = _first_stable(stable, (1 / high, 1 / low))
    return 1 / border if math.isfinite(border) else 0.0


def stable_from(loop: LinearLoop, periods: float) -> float:
    """Return the rate [Hz] from which on the loop is stable with this many periods of delay; inf if none."""
    return _first_stable(lambda rate: loop.spectrum(1 / rate, periods / rate).stable, RATES)


def _first_stable(stable: Callable[[float], bool], limits: tuple[float, float]) -> float:
    """Return the least value from which all larger ones within the limits are stable; inf if the last one is not."""
    points = np.geomspace(*limits, SCAN)
    if not stable(points[-1]):
        return math.inf
    i = SCAN - 1
    while i > 0 and stable(points[i - 1]):
        i -= 1
    if i == 0:
        return float(points[0])
    low, high = float(points[i - 1]), float(points[i])
    while high / low > 1 + PRECISION:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if stable(middle) else (middle, high)
    return high


def _own(loop: LinearLoop) -> tuple[Array, Array]:
    """Return K and B of the law's model."""
    return loop.model["joint_stiffness"], loop.model["motor_inertia"]


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


def _hertz(rate: float) -> str:
    return f"{rate / 1e3:.3g} kHz" if rate >= 1e3 else f"{rate:.3g} Hz"
