"""A drag against the motion of the end effector."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, final

import casadi as cs

from passiflex.elements.element import AbstractElement, Effect, Touch, nothing
from passiflex.layout import Field, Layout

DRAG_WIDTH = 1e-3
"""Speed over which a drag's dry part changes its sign [m/s]."""


class DragNumbers(Protocol):
    """How much it drags, in symbols, as `Drag.inputs` says."""

    viscous_drag: cs.SX
    dry_drag: cs.SX


@final
@dataclass(frozen=True)
class Drag(AbstractElement):
    """A drag against the linear motion of the end effector: viscous, and dry as μ v / |v|."""

    meaning: ClassVar[str] = "lost in the drag at the end effector"
    acts: bool = True

    def inputs(self) -> Layout:
        """Return how much it drags."""
        return Layout(
            (
                Field("viscous_drag", (), "N s/m", "of the end effector's linear motion", kept=False),
                Field("dry_drag", (), "N", "of the end effector's linear motion", kept=False),
            ),
            DragNumbers,
        )

    def act(self, at: Touch, s: DragNumbers, m: Any) -> Effect:
        """Return the force, which has the same form in any axes."""
        v = at.velocity
        drag = (s.viscous_drag + s.dry_drag / cs.sqrt(cs.dot(v, v) + DRAG_WIDTH**2)) * v
        return nothing(at.x.q.numel())._replace(force=-drag, lost=cs.dot(drag, v))
