"""The time between two rows of a result: what fits the rate of a scenario, and what is wrong with one that does not."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from passiflex.scenarios.control_settings import Control
from passiflex.scenarios.noise_settings import is_multiple

USUAL = 0.005
"""The interval [s] that a scenario has, or is nearest to, if it says nothing."""


def fitting_interval(known: Mapping[str, Any]) -> float:
    """Return the interval [s] of a scenario that says nothing: of those that fit, the nearest to `USUAL`.

    Parameters
    ----------
    known: The scenario's entries as far as they are valid.
    """
    duration = known.get("duration", math.inf)
    step, _ = _step(known)
    if step == 0:
        return min(USUAL, duration)
    count = max(1, round(USUAL / step))
    if count * step > duration:
        count = max(1, math.floor(duration / step))
    control = known.get("control")
    return float(count / control.rate if isinstance(control, Control) else count * step)


def interval_mistake(interval: float, known: Mapping[str, Any]) -> str:
    """Return what is wrong with an interval [s] between two rows; nothing if it fits."""
    got = f"got {interval:g} s" + (" (the default)" if interval == fitting_interval(known) else "")
    if interval > known.get("duration", math.inf):
        return f"needs to be no longer than the duration, {known['duration']:g} s; {got}"
    step, name = _step(known)
    if step > 0 and not is_multiple(interval / step):
        return f"needs a whole multiple of {name}, {step:g} s; {got}"
    return ""


def _step(known: Mapping[str, Any]) -> tuple[float, str]:
    """Return what the interval has to be a multiple of [s], and its name; 0 for nothing."""
    noise, control = known.get("noise"), known.get("control", "in error")
    if isinstance(control, Control):
        return 1 / control.rate, "the period"
    if noise is not None and control is None:
        return noise.hold, "noise.hold" if "hold" in noise.model_fields_set else "noise.hold (the default)"
    return 0.0, ""
