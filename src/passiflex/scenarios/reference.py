"""What the reference does in a scenario: one kind of event for each motion, which builds it."""

from __future__ import annotations

import abc
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from passiflex.scenarios.spans import Instant, Seconds
from passiflex.texts.quantity import Quantity, shown
from passiflex.texts.section import Section

if TYPE_CHECKING:  # who reads a scenario needs no CasADi
    from passiflex.control.motion import Motion, Pose

Vector = tuple[float, ...]
Length = Annotated[Vector, Quantity("m", ((3,),))]
Turn = Annotated[Vector, Quantity("rad", ((3,),))]
ZERO = (0.0, 0.0, 0.0)
KINDS = "step, move, circle or hold"


class AbstractReferenceEvent(Section, abc.ABC):
    """From an instant on, another motion of the reference.

    Whoever only reads a scenario needs no CasADi: it is imported where a motion is built.
    """

    at: Instant = Field(description="when it begins, s")

    @abc.abstractmethod
    def build(self, now: Pose) -> Motion:
        """Return the motion that begins where the reference is now."""

    @abc.abstractmethod
    def words(self) -> str:
        """Return what it is, in a few words."""

    def in_full(self) -> str:
        """Return the same with all its numbers; nothing where there is no more to say."""
        return ""


class Step(AbstractReferenceEvent):
    """The reference jumps."""

    kind: Literal["step"] = Field(description=KINDS)
    by: Length = Field(description="displacement in world axes, m")
    turn: Turn = Field(default=ZERO, description="rotation vector of the turn in world axes, rad")

    def build(self, now: Pose) -> Motion:
        """Return the pose that it jumps to."""
        from passiflex.control.motion import hold, moved

        return hold(moved(now, self.by, self.turn))

    def words(self) -> str:
        """Return how far it jumps."""
        parts = [f"{np.linalg.norm(self.by):g} m"] if any(self.by) else []
        parts += [f"{np.linalg.norm(self.turn):.3g} rad"] if any(self.turn) else []
        return f"step {', '.join(parts)}".strip()

    def in_full(self) -> str:
        """Return where it jumps, and when."""
        return f"step of x_d by {list(self.by)} m at {self.at:g} s"


class Move(AbstractReferenceEvent):
    """The reference moves with minimum jerk."""

    kind: Literal["move"] = Field(description=KINDS)
    by: Length = Field(description="displacement in world axes, m")
    duration: Seconds = Field(description="how long the move takes, s")

    def build(self, now: Pose) -> Motion:
        """Return the move."""
        from passiflex.control.motion import minimum_jerk

        return minimum_jerk(now, self.by, self.duration)

    def words(self) -> str:
        """Return how far it goes."""
        return f"move {np.linalg.norm(self.by):g} m"


def _axes(written: Any) -> tuple[str, str]:
    """Return two different axes, as lower-case letters."""
    axes = [str(a).lower() for a in written] if isinstance(written, list | tuple) else []
    if len(axes) != 2 or not set(axes) <= set("xyz") or axes[0] == axes[1]:
        raise ValueError(f"expected two different axes of x, y, z; got {shown(written)}")
    return axes[0], axes[1]


class Circle(AbstractReferenceEvent):
    """The reference goes round a circle, from where it is and in the direction of the plane's first axis."""

    kind: Literal["circle"] = Field(description=KINDS)
    plane: Annotated[tuple[Literal["x", "y", "z"], Literal["x", "y", "z"]], BeforeValidator(_axes)] = Field(
        description="list of two world axes, as [y, z]: the direction of the start, and towards the centre"
    )
    radius: Annotated[float, Quantity("m", above=0)] = Field(description="radius, m")
    period: Seconds = Field(description="time of one turn, s")

    def build(self, now: Pose) -> Motion:
        """Return the circle."""
        from passiflex.control.motion import circle

        first, second = (np.eye(3)["xyz".index(a)] for a in self.plane)
        return circle(now, first, second, self.radius, self.period)

    def words(self) -> str:
        """Return that it is one."""
        return "circle"

    def in_full(self) -> str:
        """Return which one, and when."""
        plane = "-".join(self.plane)
        return f"circle in {plane} from {self.at:g} s: radius {self.radius:g} m, period {self.period:g} s"


class Hold(AbstractReferenceEvent):
    """The reference stops."""

    kind: Literal["hold"] = Field(description=KINDS)

    def build(self, now: Pose) -> Motion:
        """Return the pose that it stops at."""
        from passiflex.control.motion import hold

        return hold(now)

    def words(self) -> str:
        """Return that it holds."""
        return "hold"


ReferenceEvent = Annotated[Step | Move | Circle | Hold, Field(discriminator="kind")]
