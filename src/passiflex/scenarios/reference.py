"""What the reference does in a scenario: one kind of event for each motion, which builds it."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from passiflex.scenarios.spans import Instant, Seconds
from passiflex.texts.quantity import Quantity, shown
from passiflex.texts.section import Mistakes, Section

if TYPE_CHECKING:  # who reads a scenario needs no CasADi
    from passiflex.control.motion import Motion, Pose

Vector = tuple[float, ...]
Length = Annotated[Vector, Quantity("m", ((3,),))]
Turn = Annotated[Vector, Quantity("rad", ((3,),))]
ZERO = (0.0, 0.0, 0.0)
KINDS = "step, move, circle, hold, path or table"


class AbstractReferenceEvent(Section, abc.ABC):
    """From an instant on, another motion of the reference.

    Whoever only reads a scenario needs no CasADi: it is imported where a motion is built.
    """

    at: Instant = Field(description="when it begins, s")

    @abc.abstractmethod
    def build(self, now: Pose) -> Motion:
        """Return the motion that begins where the reference is now."""

    def motions(self, now: Pose, seed: int = 0) -> Sequence[tuple[float, Motion]]:
        """Return its motions with their beginnings [s], in the order of time; most events are one.

        Whatever of it is left to chance is drawn by `seed`, that of the scenario.
        """
        return [(self.at, self.build(now))]

    @abc.abstractmethod
    def words(self) -> str:
        """Return what it is, in a few words."""

    def in_full(self) -> str:
        """Return the same with all its numbers; nothing where there is no more to say."""
        return ""


def how_far(by: Vector, turn: Vector) -> str:
    """Return the length of a displacement and the angle of a turn, where they are not 0."""
    parts = [f"{np.linalg.norm(by):g} m"] if any(by) else []
    parts += [f"{np.linalg.norm(turn):.3g} rad"] if any(turn) else []
    return ", ".join(parts)


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
        return f"step {how_far(self.by, self.turn)}".strip()

    def in_full(self) -> str:
        """Return where it jumps, and when."""
        return f"step of x_d by {list(self.by)} m at {self.at:g} s"


class Move(AbstractReferenceEvent):
    """The reference moves with minimum jerk."""

    kind: Literal["move"] = Field(description=KINDS)
    by: Length = Field(default=ZERO, description="displacement in world axes, m")
    turn: Turn = Field(
        default=ZERO, description="rotation vector of the turn in world axes, rad, about an axis that stays"
    )
    duration: Seconds = Field(description="how long the move takes, s")

    @model_validator(mode="after")
    def _somewhere(self) -> Self:
        if not any(self.by) and not any(self.turn):
            raise Mistakes((("by",), "missing; a move needs by, turn or both"))
        return self

    def build(self, now: Pose) -> Motion:
        """Return the move."""
        from passiflex.control.motion import minimum_jerk

        return minimum_jerk(now, self.by, self.duration, self.turn)

    def words(self) -> str:
        """Return how far it goes."""
        return f"move {how_far(self.by, self.turn)}"


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
    turns: Annotated[float, Quantity("1")] = Field(
        default=0.0,
        description="how often the end effector turns about the circle's normal meanwhile; 1: it turns along with "
        "the circle",
    )

    def build(self, now: Pose) -> Motion:
        """Return the circle."""
        from passiflex.control.motion import circle

        first, second = (np.eye(3)["xyz".index(a)] for a in self.plane)
        motion = circle(now, first, second, self.radius, self.period)
        motion["turn"][:, 1] = self.turns * 2 * np.pi / self.period * np.cross(first, second)
        return motion

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
