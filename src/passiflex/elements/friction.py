"""Friction of the motors: smooth, or dry friction that sticks."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, final

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from passiflex.elements.bristle import slipping
from passiflex.elements.element import AbstractElement, Effect, Mobility, Port, Touch, nothing
from passiflex.layout import Field, Layout


class RubbingNumbers(Protocol):
    """Dry and viscous friction of the motors in symbols."""

    coulomb_friction: cs.SX
    viscous_friction: cs.SX


class FrictionNumbers(RubbingNumbers, Protocol):
    """The friction of the motors in symbols, as `MotorFriction.parameters` says."""

    friction_width: cs.SX


class StickingNumbers(RubbingNumbers, Protocol):
    """The friction of the motors in symbols, as `StickingFriction.parameters` says."""

    static_friction: cs.SX
    stribeck_speed: cs.SX
    break_away: cs.SX


class AbstractMotorFriction(AbstractElement):
    """Coulomb and viscous friction of the motors, against θ̇ [N m, N m s/rad], each (n,) or one for all."""

    meaning: ClassVar[str] = "lost in the motors' friction"
    port: ClassVar[Port] = "motors"
    always: ClassVar[bool] = True
    unknown: ClassVar[str] = "friction of the motors"
    beside: ClassVar[tuple[Field, ...]]
    """Its numbers beside these two; each is an attribute of this name."""
    promised: ClassVar[type]
    """The protocol of all of them."""
    coulomb: ArrayLike
    viscous: ArrayLike

    @property
    def name(self) -> str:
        """Return what a run calls it."""
        return "friction"

    @property
    def structure(self) -> Hashable:
        """Return whether it acts: its numbers are parameters."""
        return type(self), self.acts

    def parameters(self, n: int) -> Layout:
        """Return the friction of each motor."""
        return Layout(
            (
                Field("coulomb_friction", (n,), "N m", "at the motors, seen from the link"),
                Field("viscous_friction", (n,), "N m s/rad", "at the motors, seen from the link"),
                *self.beside,
            ),
            self.promised,
        )

    def numbers(self, n: int) -> Mapping[str, ArrayLike]:
        """Return its values."""
        return {
            "coulomb_friction": np.broadcast_to(self.coulomb, n),
            "viscous_friction": np.broadcast_to(self.viscous, n),
            **{f.name: getattr(self, f.name) for f in self.beside},
        }


@final
@dataclass(frozen=True)
class MotorFriction(AbstractMotorFriction):
    """Smooth: c tanh(θ̇/w) + f_v θ̇. It creeps where dry friction would stick."""

    beside: ClassVar[tuple[Field, ...]] = (
        Field("friction_width", (), "rad/s", "speed over which Coulomb friction changes its sign"),
    )
    promised: ClassVar[type] = FrictionNumbers
    acts: bool = True
    coulomb: ArrayLike = field(default=0.0, compare=False)
    viscous: ArrayLike = field(default=0.0, compare=False)
    friction_width: float = field(default=0.01, compare=False)

    def act(self, at: Touch, s: Any, m: FrictionNumbers) -> Effect:
        """Return the friction torque."""
        rubbing = friction(at.x.dtheta, m.coulomb_friction, m.viscous_friction, m.friction_width)
        return nothing(rubbing.numel())._replace(motor=-rubbing, lost=cs.dot(rubbing, at.x.dtheta))


@final
@dataclass(frozen=True)
class StickingFriction(AbstractMotorFriction):
    """Dry friction that holds motors for good below its limit, and viscous friction beside it.

        f = f_c z / z_b + f_v θ̇,   |z| ≤ z_b (1 + (r − 1) exp(−(θ̇/v_s)²))

    with a bristle bent by z; z_b is how far a motor gives way before it slips, r the static friction as a multiple of
    the sliding one f_c, and v_s the speed over which it falls to that (Stribeck).
    """

    beside: ClassVar[tuple[Field, ...]] = (
        Field("static_friction", (), "1", "as a multiple of coulomb_friction, that of a motor that slides"),
        Field("stribeck_speed", (), "rad/s", "over which static friction falls to that"),
        Field("break_away", (), "rad", "by which a motor gives way before it slips"),
    )
    promised: ClassVar[type] = StickingNumbers
    stores: ClassVar[bool] = True
    acts: bool = True
    coulomb: ArrayLike = field(default=0.0, compare=False)
    viscous: ArrayLike = field(default=0.0, compare=False)
    static_friction: float = field(default=1.0, compare=False)
    stribeck_speed: float = field(default=0.01, compare=False)
    break_away: float = field(default=1e-4, compare=False)

    def state(self, n: int) -> Layout:
        """Return how far the bristles are bent."""
        return Layout((Field("friction_bristles", (n,), "rad", "by which the motors' friction gives way"),))

    def rate(self, free: Mobility) -> float:
        """Return how fast a motor swings on its bristle."""
        return float(np.sqrt(np.max(np.asarray(self.coulomb) / self.break_away * free.motors)))

    def act(self, at: Touch, s: Any, m: StickingNumbers) -> Effect:
        """Return the friction torque."""
        v, n = at.x.dtheta, at.x.q.numel()
        z = at.own.friction_bristles
        limit = m.break_away * (1 + (m.static_friction - 1) * cs.exp(-((v / m.stribeck_speed) ** 2)))
        bent = [slipping(z[i], v[i], limit[i]) for i in range(n)]
        stiffness = m.coulomb_friction / m.break_away
        slips = cs.vertcat(*(b.lost for b in bent))
        return nothing(n)._replace(
            motor=-stiffness * z - m.viscous_friction * v,
            lost=cs.dot(stiffness, slips) + cs.dot(m.viscous_friction * v, v),
            stored=cs.dot(stiffness * z, z) / 2,
            rate=v - cs.vertcat(*(b.slip for b in bent)),
        )


def friction(dtheta: cs.SX, coulomb: cs.SX, viscous: cs.SX, width: cs.SX) -> cs.SX:
    """Return the smooth friction torque against θ̇ (n,) N m; it never gives power: each entry has the sign of θ̇."""
    return coulomb * cs.tanh(dtheta / width) + viscous * dtheta
