"""How far the gains of a setting may go: the largest K_x, the window of D_x, the slowest clock, and what limits it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.cards.setting import ROTATION, SCALES, TRANSLATION, Scales, Setting
from passiflex.cards.spread import Spread
from passiflex.stability.modes import Spectrum

Array = NDArray[np.float64]
Gains = Mapping[str, Array]

BEGUN = {
    "translation": (1000.0, 300.0, 3000.0, 100.0, 10_000.0, 30.0, 10.0),
    "rotation": (30.0, 100.0, 10.0, 300.0, 3.0, 1.0),
}
"""K_x from which on the largest one is looked for: the first that holds [N/m], [N m/rad]."""
WIDEST = 16.0
"""How many times the damping is raised or lowered at most."""
STEP = 1.15
"""Ratio of two values that are tried: beyond what does not hold something may hold again, as a low rate does."""
WIDE, INSIDE = 1.3, 1.15
"""The same ratio of damping, and how far a window of it stays inside of its ends."""
FINE = 1.04
"""Ratio to which a border is found."""
LOWERED = 0.8
"""By which K_x is lowered when a search of the box finds a robot that does not hold; by its square the second time."""
BEYOND = 1.1
"""By which K_x is raised until something does not hold, to see what that is."""
MOST_BEYOND = 40
LOWERINGS, TRIES = 8, 2
"""How often what a search does not pass is lowered, and how many dampings are searched before that."""
SLOWEST, FASTEST, FASTER = 20.0, 20_000.0, 2.0
"""[Hz] Between which the lowest rate is looked for; and from how many times its own rate on."""
LATEST = 18
"""Periods of delay at most."""


class Window(NamedTuple):
    """Least and largest D_x of a part, and that of the other part with it [N s/m, N m s/rad]."""

    least: float
    most: float
    beside: float


NO_WINDOW, NOWHERE = Window(math.nan, math.nan, math.nan), (math.nan, math.nan)


class Border(NamedTuple):
    """The largest K_x that holds with a margin.

    Attributes
    ----------
    part: translation or rotation.
    stiffness: [N/m] or [N m/rad]; 0 if nothing was found that holds.
    there: D_x of translation and rotation with which it holds [N s/m], [N m s/rad].
    damping: What D_x may be at half of it.
    mode: What does not die out beyond; None where nothing stiffer was looked for.
    joint: Whose name.
    posture: At which, (n,) rad.
    """

    part: str
    stiffness: float
    there: tuple[float, float]
    damping: Window
    mode: Spectrum | None
    joint: str
    posture: Array

    @property
    def why(self) -> str:
        """Return what limits it, in words."""
        if self.mode is None:
            return "the springs of the joints"
        body = "links" if self.mode.link_share > 0.5 else "motor"
        where = f"at {self.mode.frequency:.0f} Hz" if self.mode.frequency > 0.5 else "slowly"
        return f"the {body} of {self.joint} {where}"


def stiffness_of(part: str, value: float) -> tuple[float, float]:
    """Return K_x of translation and rotation, one of them as given and the other one as usual, or softer with it."""
    lever = ROTATION / TRANSLATION
    if part == "translation":
        return value, min(ROTATION, lever * value)
    return min(TRANSLATION, value / lever), value


def border(setting: Setting | Spread, part: str, *, thorough: bool = True, most: float = math.inf) -> Border:
    """Return the largest K_x that some damping holds with, the rest of the gains as usual, over the whole box.

    Parameters
    ----------
    setting, part: Of what.
    thorough: Whether the box is searched at every posture.
    most: Nothing stiffer is looked for.
    """

    def holds(k: float) -> bool:
        return borne(setting, part, k) is not None

    begun, cap = next((k for k in BEGUN[part] if holds(k)), 0.0), min(most, setting.stiffest[part])
    k = _largest(holds, min(begun, cap), cap) if begun else 0.0
    scales, window, softest = None, NO_WINDOW, BEGUN[part][-1]
    for lowering in range(1, 1 + LOWERINGS):
        if k < softest:
            break
        scales = searched(setting, part, k, thorough=thorough)
        window = NO_WINDOW if scales is None else damping_window(setting, part, k / 2)
        if window is not NO_WINDOW:
            break
        k *= LOWERED**lowering
    if scales is None or window is NO_WINDOW:  # what no search has passed is not called safe
        return Border(part, 0.0, NOWHERE, NO_WINDOW, *_failing(setting, part, softest, SCALES[0]))
    gains = _gains(setting, part, k, scales)
    there = float(gains["damping"][0, 0]), float(gains["damping"][-1, -1])
    if k >= cap:
        return Border(part, k, there, window, None, "", setting.worst(gains).angles)
    return Border(part, k, there, window, *_failing(setting, part, k, scales))


def searched(setting: Setting | Spread, part: str, k: float, *, thorough: bool = False) -> Scales | None:
    """Return a damping with which a K_x holds and no search finds anything that does not, if there is one."""
    for _ in range(TRIES):
        scales = borne(setting, part, k)
        if scales is None or setting.searched(_gains(setting, part, k, scales), thorough=thorough):
            return scales
    return None


def borne(
    setting: Setting | Spread, part: str, k: float, period: float | None = None, delay: float | None = None
) -> Scales | None:
    """Return a damping with which a K_x holds on all robots that are known; what has held last is asked first."""
    order = setting.order
    for i, scales in enumerate(order):
        if setting.holds(_gains(setting, part, k, scales), period, delay):
            order.insert(0, order.pop(i))
            return scales
    return None


def _gains(setting: Setting | Spread, part: str, k: float, scales: Scales) -> Gains:
    return setting.gains(*stiffness_of(part, k), scales)


def damping_window(setting: Setting | Spread, part: str, k: float) -> Window:
    """Return the least and the largest D_x that holds at a K_x, a little inside of what a search has passed."""
    pair, row = stiffness_of(part, k), 0 if part == "translation" else -1

    def gains(scales: Scales, way: int, share: float) -> Gains:
        push, turn = scales
        times = share**way
        return setting.gains(*pair, (times * push, turn) if part == "translation" else (push, times * turn))

    for scales in SCALES:
        if not setting.holds(gains(scales, 1, 1.0)):
            continue
        up, down = (_searched_end(setting, partial(gains, scales, way)) for way in (1, -1))
        if up and down:
            found = np.diag(gains(scales, 1, 1.0)["damping"])
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


def slowest_clock(setting: Setting, k: float, *, search: bool = True, thorough: bool = False) -> float:
    """Return the lowest rate [Hz] at which a translational K_x holds, with the delay in periods that it has; or inf.

    It holds at all rates that were tried from there up to `FASTER` times its own, or to `FASTEST` if not at that.
    """
    periods = setting.delay * setting.rate

    def holds(rate: float) -> bool:
        return borne(setting, "translation", k, 1 / rate, periods / rate) is not None

    top = next((rate for rate in (FASTER * setting.rate, FASTEST) if holds(rate)), math.inf)
    if math.isinf(top):
        return math.inf
    rate = top / _largest(lambda slower: holds(top / slower), 1.0, top / SLOWEST)
    for _ in range(LOWERINGS if search else 0):
        if searched(setting.at(rate, periods / rate), "translation", k, thorough=thorough):
            return rate
        rate *= STEP
    return math.inf if search else rate


def longest_delay(setting: Setting, k: float, *, thorough: bool = False) -> float:
    """Return the longest delay [s] with which a translational K_x holds at the setting's rate; nan if none does."""
    period = 1 / setting.rate

    def holds(delay: float) -> bool:
        return borne(setting, "translation", k, period, delay) is not None

    low, high = 0.0, period
    while high < LATEST * period and holds(high):  # upward, as what is later still may hold again
        low, high = high, high + period
    while high - low > period / 20:
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    for _ in range(LOWERINGS):
        if searched(setting.at(setting.rate, low), "translation", k, thorough=thorough):
            return low
        if low == 0:
            break
        low = low / STEP if low > period / 10 else 0.0
    return math.nan


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
