"""What is in a scenario's environment, in one line each."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from passiflex.scenarios.environment import Drag, EndStops, labelled
from passiflex.scenarios.held_settings import AbstractHeld, Load, Person
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.surface_settings import AbstractSurface, Box, Cylinder, Sphere
from passiflex.scenarios.touching import AbstractTouching

MOST = 24
"""So many entries have a line of their own."""


def surroundings(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Yield kind and name, and what it is made of, of each entry that acts."""
    entries = labelled(scenario.environment)
    for label, entry in list(entries.items())[:MOST]:
        kind = entry.usual.replace("_", " ")
        yield (kind if label == entry.usual else f"{kind} {label}"), _made_of(entry)
    if len(entries) > MOST:
        yield "environment", f"{len(entries) - MOST} more entries"
    if any(isinstance(entry, AbstractSurface) for entry in entries.values()):
        hand = scenario.hand
        points = f"{len(hand.points)} points, " if len(hand.points) > 1 else ""
        yield "hand", f"{points}radius {1000 * hand.radius:.4g} mm"


def _made_of(entry: AbstractTouching) -> str:
    match entry:
        case AbstractSurface():
            return ", ".join(_surface(entry))
        case AbstractHeld():
            return ", ".join(_held(entry))
        case EndStops():
            stiffness = np.ravel(entry.stiffness)
            said = ", ".join(f"{k:g}" for k in dict.fromkeys(stiffness.tolist()))
            return f"{said} N m/rad"
        case Drag():
            parts = [f"{entry.viscous:g} N s/m"] * bool(entry.viscous) + [f"{entry.dry:g} N"] * bool(
                entry.dry
            )
            return f"{', '.join(parts)}, {_when(entry)}"
    return entry.usual


def _surface(entry: AbstractSurface) -> Iterator[str]:
    match entry:
        case Sphere():
            yield f"radius {entry.radius:g} m"
        case Cylinder():
            ends = "endless" if math.isinf(entry.length) else f"{entry.length:g} m long"
            yield f"radius {entry.radius:g} m, {ends}"
        case Box():
            yield " × ".join(f"{edge:g}" for edge in entry.size) + " m"
    yield f"{entry.stiffness:g} N/m"
    yield f"friction {entry.friction:g}" if entry.friction else "no friction"
    if entry.viscous:
        yield f"{entry.viscous:g} N s/m along it"
    if entry.motion:
        yield "moved"


def _held(entry: AbstractHeld) -> Iterator[str]:
    yield f"{entry.mass:g} kg"
    yield f"grip {entry.grip_stiffness:g} N/m"
    match entry:
        case Load():
            yield "the law knows it" if entry.known else "the law does not know it"
        case Person():
            yield f"arm {entry.arm_stiffness:g} N/m"
            count = len(entry.pushes)
            if count:
                yield f"{count} push{'es' * (count != 1)}"
    yield _when(entry)


def _when(entry: AbstractHeld | Drag) -> str:
    return f"{entry.start:g} to {entry.end:g} s"
