"""Friction of the motors that sticks, and a brake on those that are too fast."""

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


class StickingNumbers(Protocol):
    """The friction of the motors in symbols, as `StickingFriction.parameters` says."""

    coulomb_friction: cs.SX
    viscous_friction: cs.SX
    static_friction: cs.SX
    stribeck_speed: cs.SX
    break_away: cs.SX


@final
@dataclass(frozen=True)
class StickingFriction(AbstractElement):
    """Dry friction of the motors that holds them for good below its limit, and viscous friction beside it.

        f = f_c z / z_b + f_v θ̇,   |z| ≤ z_b (1 + (r − 1) exp(−(θ̇/v_s)²))

    with a bristle bent by z; z_b is how far a motor gives way before it slips, r the static friction as a multiple of
    the sliding one f_c, and v_s the speed over which it falls to that (Stribeck).
    """

    meaning: ClassVar[str] = "lost in the motors' friction"
    port: ClassVar[Port] = "motors"
    stores: ClassVar[bool] = True
    always: ClassVar[bool] = True
    unknown: ClassVar[str] = "friction of the motors"
    acts: bool = True
    coulomb: ArrayLike = field(default=0.0, compare=False)
    viscous: ArrayLike = field(default=0.0, compare=False)
    static: float = field(default=1.0, compare=False)
    stribeck_speed: float = field(default=0.01, compare=False)
    break_away: float = field(default=1e-4, compare=False)

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
                Field("coulomb_friction", (n,), "N m", "of sliding motors, seen from the link"),
                Field("viscous_friction", (n,), "N m s/rad", "at the motors, seen from the link"),
                Field("static_friction", (), "1", "as a multiple of coulomb_friction"),
                Field("stribeck_speed", (), "rad/s", "over which static friction falls to that"),
                Field("break_away", (), "rad", "by which a motor gives way before it slips"),
            ),
            StickingNumbers,
        )

    def numbers(self, n: int) -> Mapping[str, ArrayLike]:
        """Return its values."""
        return {
            "coulomb_friction": np.broadcast_to(self.coulomb, n),
            "viscous_friction": np.broadcast_to(self.viscous, n),
            "static_friction": self.static,
            "stribeck_speed": self.stribeck_speed,
            "break_away": self.break_away,
        }

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
