"""How far the gains of a setting may go: the largest K_x, the window of D_x, the slowest clock, and what limits it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.cards.setting import ROTATION, TRANSLATION, Scales, Setting
from passiflex.cards.spread import Spread
from passiflex.stability.modes import Spectrum

Array = NDArray[np.float64]
Gains = Mapping[str, Array]

STIFFEST = {"translation": 30_000.0, "rotation": 3_000.0}
"""[N/m], [N m/rad] Nothing stiffer is looked for: the springs of the joints are softer."""
BEGUN = {
    "translation": (1000.0, 300.0, 3000.0, 100.0, 10_000.0, 30.0, 10.0),
    "rotation": (30.0, 100.0, 10.0, 300.0, 3.0, 1.0),
}
"""K_x from which on the largest one is looked for: the first that holds [N/m], [N m/rad]."""
SCALES: tuple[Scales, ...] = (
    (1.0, 1.0), (0.5, 1.0), (0.5, 0.5), (1.0, 0.5), (2.0, 1.0), (0.25, 1.0), (0.25, 0.5), (0.25, 0.25), (0.125, 0.5),
    (4.0, 1.0), (2.0, 2.0), (1.0, 2.0),
)  # fmt: skip
"""Multiples of the designed damping that are tried, of translation and rotation, the likeliest first."""
WIDEST = 16.0
"""How many times the damping is raised or lowered at most."""
STEP = 1.15
"""Ratio of two values that are tried: beyond what does not hold something may hold again, as a low rate does."""
WIDE, INSIDE = 1.3, 1.15
"""The same ratio of damping, and how far a window of it stays inside of its ends."""
FINE = 1.04
"""Ratio to which a border is found."""
LOWERED = 0.8
"""By which K_x is lowered when a search of the box finds a robot that does not hold."""
BEYOND = 1.1
"""By which K_x is raised until something does not hold, to see what that is."""
MOST_BEYOND = 40
SEARCHES = 10
SLOWEST, FASTEST, FASTER = 20.0, 20_000.0, 4.0
"""[Hz] Between which the lowest rate is looked for; and from how many times its own rate on."""
LATEST = 40
"""Periods of delay at most."""


class Window(NamedTuple):
    """Least and largest D_x of a part, and that of the other part with it [N s/m, N m s/rad]."""

    least: float
    most: float
    beside: float


NO_WINDOW = Window(math.nan, math.nan, math.nan)


class Border(NamedTuple):
    """The largest K_x that holds with a margin.

    Attributes
    ----------
    part: translation or rotation.
    stiffness: [N/m] or [N m/rad]; 0 if nothing was found that holds, infinite if all up to `STIFFEST` does.
    damping: What D_x may be at half of it.
    mode: What does not die out beyond.
    joint: Whose name.
    posture: At which, (n,) rad.
    """

    part: str
    stiffness: float
    damping: Window
    mode: Spectrum | None
    joint: str
    posture: Array

    @property
    def why(self) -> str:
        """Return what limits it, in words."""
        if self.mode is None:
            return "nothing up to there"
        body = "links" if self.mode.link_share > 0.5 else "motor"
        where = f"at {self.mode.frequency:.0f} Hz" if self.mode.frequency > 0.5 else "slowly"
        return f"the {body} of {self.joint} {where}"


def stiffness_of(part: str, value: float) -> tuple[float, float]:
    """Return K_x of translation and rotation, one of them as given and the other one as usual."""
    return (value, ROTATION) if part == "translation" else (TRANSLATION, value)


def border(setting: Setting | Spread, part: str, *, thorough: bool = True, most: float = math.inf) -> Border:
    """Return the largest K_x that some damping holds with, the rest of the gains as usual, over the whole box.

    Parameters
    ----------
    setting, part: Of what.
    thorough: Whether the box is searched at every posture.
    most: Nothing stiffer is looked for.
    """
    scales = list(SCALES)

    def scale_for(k: float) -> Scales | None:
        pair = stiffness_of(part, k)
        found = next((s for s in scales if setting.holds(setting.gains(*pair, s))), None)
        if found is not None:
            scales.insert(0, scales.pop(scales.index(found)))  # what has just held is asked first
        return found

    begun = next((k for k in BEGUN[part] if scale_for(k) is not None), 0.0)
    cap = min(most, STIFFEST[part])
    k = _largest(lambda k: scale_for(k) is not None, min(begun, cap), cap) if begun else 0.0
    for _ in range(SEARCHES if k else 0):
        scale = scale_for(k)
        gains = setting.gains(*stiffness_of(part, k), scale or SCALES[0])
        if scale is not None and setting.searched(gains, thorough=thorough):
            break
        k *= LOWERED
    else:
        k = 0.0  # what no search has passed is not called safe
    if not k:
        return Border(part, 0.0, NO_WINDOW, *_failing(setting, part, BEGUN[part][-1], SCALES[0]))
    window = damping_window(setting, part, k / 2)
    if k >= STIFFEST[part]:
        return Border(part, math.inf, window, None, "", setting.worst(gains).angles)
    return Border(part, k, window, *_failing(setting, part, k, scales[0]))


def damping_window(setting: Setting | Spread, part: str, k: float) -> Window:
    """Return the least and the largest D_x that holds at a K_x, a little inside of what a search has passed."""
    pair, row = stiffness_of(part, k), 0 if part == "translation" else -1

    def gains(scales: Scales, share: float) -> Gains:
        push, turn = scales
        return setting.gains(*pair, (share * push, turn) if part == "translation" else (push, share * turn))

    for scales in SCALES:
        if not setting.holds(gains(scales, 1.0)):
            continue
        up = _searched_end(setting, partial(gains, scales))
        down = _searched_end(setting, lambda share, s=scales: gains(s, 1 / share))  # type: ignore[misc]
        if up and down:
            found = np.diag(gains(scales, 1.0)["damping"])
            return Window(found[row] / down, found[row] * up, float(found[-1 - row]))
    return NO_WINDOW


def _searched_end(setting: Setting | Spread, gains: Callable[[float], Gains]) -> float:
    """Return how far damping may go from 1, a little inside of what a search has passed; 0 if not at all."""
    end = _largest(lambda share: setting.holds(gains(share)), 1.0, WIDEST, WIDE)
    while end >= INSIDE:
        if setting.holds(gains(end)) and setting.searched(gains(end), thorough=False):
            return end / INSIDE
        end /= WIDE
    return 0.0


def slowest_clock(setting: Setting, k: float) -> float:
    """Return the lowest rate [Hz] at which a translational K_x holds, with the delay in periods that it has; or inf.

    It holds at all rates that were tried from there up to `FASTER` times its own, or to `FASTEST` if not at that.
    """
    periods = setting.delay * setting.rate

    def holds(rate: float) -> bool:
        return any(setting.holds(setting.gains(k, ROTATION, s), 1 / rate, periods / rate) for s in SCALES)

    top = next((rate for rate in (FASTER * setting.rate, FASTEST) if holds(rate)), math.inf)
    if math.isinf(top):
        return math.inf
    return top / _largest(lambda slower: holds(top / slower), 1.0, top / SLOWEST)


def longest_delay(setting: Setting, k: float) -> float:
    """Return the longest delay [s] with which a translational K_x holds at the setting's rate; nan if none does."""
    period = 1 / setting.rate

    def holds(delay: float) -> bool:
        return any(setting.holds(setting.gains(k, ROTATION, s), period, delay) for s in SCALES)

    if not holds(0.0):
        return math.nan
    low, high = 0.0, period
    while high < LATEST * period and holds(high):  # upward, as what is later still may hold again
        low, high = high, high + period
    while high - low > period / 20:
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _failing(setting: Setting | Spread, part: str, k: float, scale: Scales) -> tuple[Spectrum, str, Array]:
    """Return what does not die out beyond a K_x with a damping, in which joint, and where."""
    for _ in range(MOST_BEYOND):
        k *= BEYOND
        gains = setting.gains(*stiffness_of(part, k), scale)
        if not setting.holds(gains):
            break
    found = setting.worst(gains)
    mode = found.mode(gains)
    return mode, found.setting.robot.arm.chain.joints[mode.joint - 1].name, found.angles


def _largest(holds: Callable[[float], bool], low: float, high: float, step: float = STEP) -> float:
    """Return the largest value up to `high` that holds, walking up from `low`; 0 if that does not."""
    if not holds(low):
        return 0.0
    while low < high:
        beyond = min(low * step, high)
        if not holds(beyond):
            break
        low = beyond
    else:
        return high
    while beyond / low > FINE:
        middle = math.sqrt(low * beyond)
        low, beyond = (middle, beyond) if holds(middle) else (low, middle)
    return low
