"""A path of the reference through points that are passed at given times."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, Self

from pydantic import Field, field_validator, model_validator

from passiflex.scenarios.reference import KINDS, ZERO, AbstractReferenceEvent, Length, Turn
from passiflex.scenarios.spans import Seconds
from passiflex.texts.section import Mistakes, Section

if TYPE_CHECKING:  # who reads a scenario needs no CasADi
    from passiflex.control.motion import Motion, Pose

Between = Literal["smooth", "linear", "minimum_jerk"]


class ViaPoint(Section):
    """A point of a path: from the point before by a displacement and a turn."""

    after: Seconds = Field(description="time since the point before, s")
    by: Length = Field(default=ZERO, description="displacement from the point before in world axes, m")
    turn: Turn = Field(
        default=ZERO,
        description="rotation vector of the turn from the point before in world axes, rad; at most half a turn",
    )

    @model_validator(mode="after")
    def _shortest(self) -> Self:
        if (size := sum(x * x for x in self.turn) ** 0.5) > HALF_TURN:
            raise Mistakes(
                (("turn",), f"is {size:.4g} rad; needs at most half a turn from point to point: add a point")
            )
        return self


HALF_TURN = 3.1415927


class ViaPath(AbstractReferenceEvent):
    """The reference passes points, from where it is."""

    kind: Literal["path"] = Field(description=KINDS)
    points: tuple[ViaPoint, ...] = Field(description="the points, in the order of time")
    between: Between = Field(
        default="smooth",
        description="smooth: through the points without a rest, with least jerk; minimum_jerk: with a rest at each; "
        "linear: straight on",
    )

    @field_validator("points")
    @classmethod
    def _any(cls, points: tuple[ViaPoint, ...]) -> tuple[ViaPoint, ...]:
        if not points:
            raise ValueError("needs at least one point, as {after: 1 s, by: [0, 0, 0.1]}")
        return points

    def build(self, now: Pose) -> Motion:
        """Return the first of its motions."""
        return self.motions(now)[0][1]

    def motions(self, now: Pose, seed: int = 0) -> Sequence[tuple[float, Motion]]:
        """Return a motion from each point to the next."""
        import numpy as np

        from passiflex.control.legs import legs
        from passiflex.control.motion import moved

        poses, times = [now], [self.at]
        for point in self.points:
            poses.append(moved(poses[-1], point.by, point.turn))
            times.append(times[-1] + point.after)
        time = np.array(times)
        found = legs(
            time, np.array([p.position for p in poses]), np.array([p.rotation for p in poses]), self.between
        )
        return list(zip(times, found, strict=True))

    def words(self) -> str:
        """Return how many points it passes."""
        return f"path of {len(self.points)} point{'s' * (len(self.points) > 1)}"

    @property
    def turns(self) -> bool:
        """Return whether it turns."""
        return any(any(p.turn) for p in self.points)
