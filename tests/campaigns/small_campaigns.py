"""Campaigns of the planar arm that cost milliseconds a sample."""

from __future__ import annotations

import math
from typing import Any

from passiflex.campaigns import Campaign
from worlds import merged, world

SAMPLED: dict[str, Any] = {
    "control": {"rate": 200, "delay": 5e-3},
    "law": {"shaped_inertia": {"ratio": 1}, "stiffness": {"translation": 60}, "damping": {"translation": 20}},
    "noise": {"torque_variance": 0.01, "hold": 5e-3},
    "forces": [{"from": 0.3, "to": 0.4, "force": [1, 0, 0]}],
    "output_interval": 0.01,
    "duration": 0.6,
}
"""At 200 Hz with one period of delay its loop is stable with K_e = K from 0.67 B on."""
CONTINUOUS: dict[str, Any] = {
    **SAMPLED,
    "control": None,
    "noise": None,
    "tank": {"kind": "paper", "initial": 2},
}
UNSTABLE: dict[str, Any] = merged(SAMPLED, {"law": {"shaped_inertia": {"ratio": 0.2}}})
STIFFNESS = "deviations.joint_stiffness"


def uniform(low: float, high: float, **more: Any) -> dict[str, Any]:
    return {"distribution": "uniform", "low": low, "high": high, **more}


def choice(*values: Any) -> dict[str, Any]:
    return {"distribution": "choice", "values": list(values)}


PARAMETERS = {STIFFNESS: uniform(-0.2, 0.2, per="joint"), "law.damping.translation": uniform(15, 30)}


def campaign(scenario: dict[str, Any] | None = None, **changes: Any) -> Campaign:
    """Return a campaign of six samples, with these changes."""
    usual = {"name": "small", "samples": 6, "seed": 3, "parameters": PARAMETERS}
    return Campaign(scenario=world(**(SAMPLED if scenario is None else scenario)), **(usual | changes))


def equal(one: Any, other: Any) -> bool:
    """Return whether two values of rows are the same to the last bit; nan is nan."""
    if isinstance(one, list):
        return len(one) == len(other) and all(map(equal, one, other))
    if isinstance(one, float) and math.isnan(one):
        return isinstance(other, float) and math.isnan(other)
    return type(one) is type(other) and bool(one == other)


def same_rows(ours: list[dict[str, Any]], theirs: list[dict[str, Any]]) -> bool:
    """Return whether rows have the same columns in the same order, and the same values."""
    assert len(ours) == len(theirs)
    assert all(list(a) == list(b) for a, b in zip(ours, theirs, strict=True))
    return all(equal(a[name], b[name]) for a, b in zip(ours, theirs, strict=True) for name in a)
