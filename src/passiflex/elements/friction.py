"""Friction of the motors."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, final

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from passiflex.elements.element import AbstractElement, Effect, Port, Touch, nothing
from passiflex.layout import Field, Layout


class FrictionNumbers(Protocol):
    """The friction of the motors in symbols, as `MotorFriction.parameters` says."""

    coulomb_friction: cs.SX
    viscous_friction: cs.SX
    friction_width: cs.SX


@final
@dataclass(frozen=True)
class MotorFriction(AbstractElement):
    """Coulomb and viscous friction of the motors, against θ̇ [N m, N m s/rad], each (n,) or one for all."""

    meaning: ClassVar[str] = "lost in the motors' friction"
    port: ClassVar[Port] = "motors"
    always: ClassVar[bool] = True
    unknown: ClassVar[str] = "friction of the motors"
    acts: bool = True
    coulomb: ArrayLike = field(default=0.0, compare=False)
    viscous: ArrayLike = field(default=0.0, compare=False)
    width: float = field(default=0.01, compare=False)
    """Speed over which Coulomb friction changes its sign [rad/s]."""

    def parameters(self, n: int) -> Layout:
        """Return the friction of each motor."""
        return Layout(
            (
                Field("coulomb_friction", (n,), "N m", "at the motors, seen from the link"),
                Field("viscous_friction", (n,), "N m s/rad", "at the motors, seen from the link"),
                Field("friction_width", (), "rad/s", "speed over which Coulomb friction changes its sign"),
            ),
            FrictionNumbers,
        )

    def numbers(self, n: int) -> Mapping[str, ArrayLike]:
        """Return its values."""
        return {
            "coulomb_friction": np.broadcast_to(self.coulomb, n),
            "viscous_friction": np.broadcast_to(self.viscous, n),
            "friction_width": self.width,
        }

    @property
    def name(self) -> str:
        """Return what a run calls it."""
        return "friction"

    @property
    def structure(self) -> Hashable:
        """Return whether it acts: its numbers are parameters."""
        return type(self), self.acts

    def act(self, at: Touch, s: Any, m: FrictionNumbers) -> Effect:
        """Return the friction torque."""
        rubbing = friction(at.x.dtheta, m.coulomb_friction, m.viscous_friction, m.friction_width)
        return nothing(rubbing.numel())._replace(motor=-rubbing, lost=cs.dot(rubbing, at.x.dtheta))


def friction(dtheta: cs.SX, coulomb: cs.SX, viscous: cs.SX, width: cs.SX) -> cs.SX:
    """Return the friction torque against θ̇ (n,) N m; it never gives power: each entry has the sign of θ̇."""
    return coulomb * cs.tanh(dtheta / width) + viscous * dtheta
