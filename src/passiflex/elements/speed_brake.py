"""A brake on motors that are too fast."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, final

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from passiflex.elements.element import AbstractElement, Effect, Mobility, Port, Touch, nothing
from passiflex.layout import Field, Layout


class BrakeNumbers(Protocol):
    """The brake in symbols, as `SpeedBrake.parameters` says."""

    speed_limit: cs.SX
    speed_brake: cs.SX


@final
@dataclass(frozen=True)
class SpeedBrake(AbstractElement):
    """A brake on motors beyond their speed limit: −b (|θ̇| − ω) against their motion, and nothing below it."""

    meaning: ClassVar[str] = "lost in the brakes of motors that were too fast"
    port: ClassVar[Port] = "motors"
    unknown: ClassVar[str] = "speed limits of the motors"
    acts: bool = True
    limit: ArrayLike = field(default=1e9, compare=False)
    brake: ArrayLike = field(default=0.0, compare=False)

    @property
    def name(self) -> str:
        """Return what a run calls it."""
        return "speed_brake"

    @property
    def structure(self) -> Hashable:
        """Return whether it acts: its numbers are parameters."""
        return type(self), self.acts

    def parameters(self, n: int) -> Layout:
        """Return limit and strength."""
        return Layout(
            (
                Field("speed_limit", (n,), "rad/s", "of the motors"),
                Field("speed_brake", (n,), "N m s/rad", "against what is beyond it"),
            ),
            BrakeNumbers,
        )

    def numbers(self, n: int) -> Mapping[str, ArrayLike]:
        """Return their values."""
        return {"speed_limit": np.broadcast_to(self.limit, n), "speed_brake": np.broadcast_to(self.brake, n)}

    def rate(self, free: Mobility) -> float:
        """Return how fast it stops a motor."""
        return float(np.max(np.asarray(self.brake) * free.motors))

    def act(self, at: Touch, s: Any, m: BrakeNumbers) -> Effect:
        """Return the torque of the brake."""
        v = at.x.dtheta
        beyond = cs.fmax(v - m.speed_limit, 0) - cs.fmax(-v - m.speed_limit, 0)
        torque = m.speed_brake * beyond
        return nothing(v.numel())._replace(motor=-torque, lost=cs.dot(torque, v))
