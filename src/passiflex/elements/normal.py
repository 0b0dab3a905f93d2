"""How hard a surface presses back along its normal, as a law of the depth and of how fast it grows."""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, final

import casadi as cs
import numpy as np


class Pressed(NamedTuple):
    """Force of a surface along its normal [N] ≥ 0, what it stores [J], and what it loses [W]."""

    force: cs.SX
    stored: cs.SX
    lost: cs.SX


class AbstractNormal(abc.ABC):
    """How hard a surface presses back."""

    damping_unit: ClassVar[str]

    @abc.abstractmethod
    def press(self, depth: cs.SX, rate: cs.SX, stiffness: cs.SX, damping: cs.SX) -> Pressed:
        """Return the force at a depth ≥ 0 [m] that grows at a rate [m/s]."""

    @abc.abstractmethod
    def pole(self, mobility: float, stiffness: float, damping: float) -> float:
        """Return how fast a mass 1/mobility swings on it [1/s]."""


@final
@dataclass(frozen=True)
class Linear(AbstractNormal):
    """f = max(0, k δ + d δ̇): a spring and a damper that do not pull."""

    damping_unit: ClassVar[str] = "N s/m"

    def press(self, depth: cs.SX, rate: cs.SX, stiffness: cs.SX, damping: cs.SX) -> Pressed:
        """Return the force; where the damper would pull, the surface comes back by itself and loses what it stored."""
        spring = stiffness * depth
        force = cs.if_else(depth > 0, cs.fmax(spring + damping * rate, 0), 0)
        return Pressed(force, spring * depth / 2, (force - spring) * rate)

    def pole(self, mobility: float, stiffness: float, damping: float) -> float:
        """Return √(k/m) and four times d/m: its force jumps where the hand arrives, and a step that does not see it."""
        return float(np.sqrt(stiffness * mobility)) + 4 * damping * mobility


@final
@dataclass(frozen=True)
class HuntCrossley(AbstractNormal):
    """f = k δ (1 + c δ̇), not below 0: a damper that begins and ends with the depth, so that the force never jumps.

    Hunt, Crossley, "Coefficient of restitution interpreted as damping in vibroimpact", J. Applied Mechanics 42, 1975.
    A mass that meets it at a speed v leaves at the speed u with c (v + u) = ln((1 + c v)/(1 − c u)), whatever k and
    its mass.
    """

    damping_unit: ClassVar[str] = "s/m"

    def press(self, depth: cs.SX, rate: cs.SX, stiffness: cs.SX, damping: cs.SX) -> Pressed:
        """Return the force."""
        spring = stiffness * depth
        force = spring * cs.fmax(1 + damping * rate, 0)
        return Pressed(force, spring * depth / 2, (force - spring) * rate)

    def pole(self, mobility: float, stiffness: float, damping: float) -> float:
        """Return √(k/m): its damper is weak where it is fast."""
        return float(np.sqrt(stiffness * mobility))
