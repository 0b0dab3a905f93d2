"""What the hand holds for a time: a load that is picked up and set down, or a person who takes hold of the arm."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, ClassVar, final

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from passiflex.elements.element import Effect, Mobility, Touch, nothing
from passiflex.elements.labelled import AbstractLabelled
from passiflex.layout import Field, Layout, Signal

LET_GO = 5e-3
"""Time [s] within which a body that is let go comes to rest, and its grip with it."""


@final
@dataclass(frozen=True)
class Held(AbstractLabelled):
    """A point mass m on a grip k, d at a point of the hand, while it is gripped.

        m v̇ = f + m g + F − K u − D v,   f = k s + d ṡ,   ṡ = v_hand − v,   u̇ = v

    s is the stretch of the grip, u how far the mass has come, F what pushes it from beyond, and K, D, of a person, what
    draws the arm back to where it took hold. It is taken up at rest where the hand is; let go, it comes to rest within
    a moment, and keeps the height to which it was lifted. The hand feels −f.

    Attributes
    ----------
    label: What a run calls it.
    anchored: Whether K draws it back; then it goes there once it is let go.
    values: Its numbers, by the names of its parameters.
    """

    meaning: ClassVar[str] = "lost in what was held"
    stores: ClassVar[bool] = True
    supplies: ClassVar[bool] = True
    acts: bool = True
    label: str = "load"
    anchored: bool = False
    values: Mapping[str, ArrayLike] = field(default_factory=dict, compare=False)

    @property
    def structure(self) -> Hashable:
        """Return what its code depends on: its numbers are parameters."""
        return type(self), self.acts, self.label, self.anchored

    def parameters(self, n: int) -> Layout:
        """Return its mass, its grip, and what draws it back."""
        return self._called(
            Field("mass", (), "kg", "of what is held"),
            Field("weight", (3,), "m/s^2", "gravity on it, world axes"),
            Field("grasp", (3,), "m", "where the hand holds it, in the axes of the end effector"),
            Field("grip_stiffness", (), "N/m", "of the grip"),
            Field("grip_damping", (), "N s/m", "of the grip"),
            Field("arm_stiffness", (), "N/m", "toward where it took hold"),
            Field("arm_damping", (), "N s/m", "of the same motion"),
        )

    def numbers(self, n: int) -> Mapping[str, ArrayLike]:
        """Return the values of `parameters`; whatever was not given is 0, and the mass 1."""
        fields = self.parameters(n)
        given = {f"{self.label}_{name}": value for name, value in {"mass": 1.0, **self.values}.items()}
        return fields.zeros() | given

    def inputs(self) -> Layout:
        """Return whether it is gripped, and what pushes it."""
        return self._called(
            Field("gripped", (), "1", "1 while it is", kept=False),
            Field("push", (3,), "N", "from beyond, world axes", kept=False),
        )

    def state(self, n: int) -> Layout:
        """Return the stretch of its grip, how far it has come, and how fast it is."""
        return self._called(
            Field("stretch", (3,), "m", "of the grip, world axes", ("axis",)),
            Field("way", (3,), "m", "that it has come since it was first gripped, world axes", ("axis",)),
            Field("velocity", (3,), "m/s", "of it, world axes", ("axis",)),
        )

    def rate(self, free: Mobility) -> float:
        """Return how fast hand and mass swing on the grip."""
        g = self._own(SimpleNamespace(**self.numbers(0)), self.parameters(0))
        mass, own = float(g.mass), free.at(g.grasp)
        mobility = own + 1 / mass
        grip = np.sqrt(g.grip_stiffness * mobility) + g.grip_damping * mobility
        arm = np.sqrt(g.arm_stiffness / mass) + g.arm_damping / mass
        return float(grip + arm)

    def act(self, at: Touch, s: Any, m: Any) -> Effect:
        """Return what it does to the hand."""
        n = at.x.q.numel()
        g, told, own = self._views(at, s, m)
        lever, apart, pull = self._grip(at, g, own)
        back = g.arm_stiffness * own.way + g.arm_damping * own.velocity
        pushed = pull + g.mass * g.weight + told.push - back
        stored = (
            g.grip_stiffness * cs.sumsqr(own.stretch) / 2
            + g.mass * cs.sumsqr(own.velocity) / 2
            + g.arm_stiffness * cs.sumsqr(own.way) / 2
            - g.mass * cs.dot(g.weight, own.way)
        )
        returning = own.way / LET_GO if self.anchored else cs.SX.zeros(3)
        held = told.gripped > 0
        on_hand = self._on_hand(pull, told)
        resting = g.grip_stiffness * cs.sumsqr(own.stretch) + g.mass * cs.sumsqr(own.velocity)
        resting = resting / LET_GO + g.arm_stiffness * cs.dot(own.way, returning)
        rubbing = g.grip_damping * cs.sumsqr(apart) + g.arm_damping * cs.sumsqr(own.velocity)
        return nothing(n)._replace(
            force=at.rotation.T @ on_hand,
            moment=at.rotation.T @ cs.cross(lever, on_hand),
            lost=cs.if_else(held, rubbing, resting),
            stored=stored,
            supplied=cs.if_else(held, cs.dot(told.push, own.velocity), 0),
            rate=cs.if_else(
                held,
                cs.vertcat(apart, own.velocity, pushed / g.mass),
                -cs.vertcat(own.stretch / LET_GO, returning, own.velocity / LET_GO),
            ),
        )

    def seen(self, at: Touch, s: Any, m: Any) -> tuple[Signal, ...]:
        """Return its force on the hand."""
        g, told, own = self._views(at, s, m)
        *_, pull = self._grip(at, g, own)
        force = Field(f"{self.label}_force", (3,), "N", "on the hand, world axes", axes=("axis",))
        return (Signal(force, self._on_hand(pull, told)),)

    def _views(self, at: Touch, s: Any, m: Any) -> tuple[Any, Any, Any]:
        """Return its parameters, its inputs and its state."""
        n = at.x.q.numel()
        return (
            self._own(m, self.parameters(n)),
            self._own(s, self.inputs()),
            self._own(at.own, self.state(n)),
        )

    def _grip(self, at: Touch, g: Any, own: Any) -> tuple[cs.SX, cs.SX, cs.SX]:
        """Return where the hand holds it, how fast that leaves it, and with what it is pulled; in world axes."""
        lever = at.axes @ g.grasp
        hand = at.rotation @ (at.velocity + cs.cross(at.spin, at.rotation.T @ lever))
        apart = hand - own.velocity
        return lever, apart, g.grip_stiffness * own.stretch + g.grip_damping * apart

    def _on_hand(self, pull: cs.SX, told: Any) -> cs.SX:
        return cs.if_else(told.gripped > 0, -pull, 0)
