"""A plain wall: a plane with a spring and a damper along its normal; native as an element, in MuJoCo as a contact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, final

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from passiflex.elements import AbstractElement, Effect, Touch, nothing
from passiflex.engines.contact import Contact, contact_of
from passiflex.layout import Field, Layout


@final
@dataclass(frozen=True)
class Wall(AbstractElement):
    """Below height z: f = max(0, K depth + B rate); with friction in MuJoCo only."""

    meaning: ClassVar[str] = "lost in the wall"
    stores: ClassVar[bool] = True
    acts: bool = True
    stiffness: float = field(default=1e4, compare=False)
    damping: float = field(default=100.0, compare=False)
    height: float = field(default=0.0, compare=False)
    friction: float = 0.0
    roundness: float = 0.02
    shape: str = "plane"
    sizes: tuple[float, ...] = (1.0, 1.0, 0.1)
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def parameters(self, n: int) -> Layout:
        """Return what it is made of."""
        names = ("stiffness", "damping", "height")
        return Layout(tuple(Field(f"wall_{name}", (), "1", "of the wall") for name in names))

    def numbers(self, n: int) -> Mapping[str, ArrayLike]:
        """Return their values."""
        return {f"wall_{name}": getattr(self, name) for name in ("stiffness", "damping", "height")}

    def act(self, at: Touch, s: Any, m: Any) -> Effect:
        """Return the push along the normal."""
        depth = m.wall_height + self.roundness - at.position[2]
        rate = -(at.rotation @ at.velocity)[2]
        inside = depth > 0
        push = cs.if_else(inside, cs.fmax(m.wall_stiffness * depth + m.wall_damping * rate, 0), 0)
        stored = cs.if_else(inside, m.wall_stiffness * depth**2 / 2, 0)
        force = cs.vertcat(0, 0, push)
        none = nothing(at.x.q.numel())
        lost = cs.if_else(inside, (push - m.wall_stiffness * depth) * rate, 0)
        return none._replace(force=at.rotation.T @ force, lost=lost, stored=stored)


@contact_of.register
def _(element: Wall, numbers: Mapping[str, Any]) -> Contact:
    return Contact(
        element.shape,
        element.sizes,
        np.array([*element.centre[:2], element.centre[2] + float(numbers["wall_height"])]),
        np.eye(3),
        float(numbers["wall_stiffness"]),
        float(numbers["wall_damping"]),
        0.0,
        element.friction,
        np.zeros((1, 3)),
        element.roundness,
    )
