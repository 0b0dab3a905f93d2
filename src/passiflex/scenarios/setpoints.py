"""A table of set-points as they come: poses, and gains, row by row, at their times or by way of a stream."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, model_validator

from passiflex.scenarios.reference import KINDS, AbstractReferenceEvent
from passiflex.scenarios.setpoint_rows import SetpointRows, setpoint_rows
from passiflex.scenarios.spans import Instant
from passiflex.scenarios.table_rows import in_file, with_rows
from passiflex.texts.quantity import Quantity, shown
from passiflex.texts.section import Mistakes, Section
from passiflex.texts.text_file import UnreadableError

if TYPE_CHECKING:  # who reads a scenario needs no CasADi
    from passiflex.control.motion import Motion, Pose

Array = NDArray[np.float64]
OF_STREAM = 3
"""Which random stream of a run's seed draws lateness and losses; those before are the noise's and the clock's."""


class Stream(Section):
    """How the rows of a table come to the controller: as messages, which are late and get lost."""

    rate: Annotated[float, Quantity("Hz", above=0)] | None = Field(
        default=None,
        description="messages per second, each with the row that is the last by then, Hz; a message for each row if "
        "left out",
    )
    delay: Instant = Field(default=0.0, description="each message comes this much later, s")
    jitter: Instant = Field(default=0.0, description="and by up to this much more, uniformly, s")
    lost: Annotated[float, Quantity("1", least=0, most=0.99)] = Field(
        default=0.0, description="share of messages that never come, at random"
    )


class GainRow(NamedTuple):
    """Gains that are told from `start` on, and in force from `end` on [s]; None for what stays."""

    start: float
    end: float
    stiffness: Array | None
    damping: Array | None


def _flag(written: Any) -> bool:
    if not isinstance(written, bool):
        raise ValueError(f"expected true or false; got {shown(written)}")
    return written


class Table(AbstractReferenceEvent):
    """The reference, and K_x and D_x with it, go by the rows of a table."""

    at: Instant = Field(default=0.0, description="when t = 0 of the table is, s")
    kind: Literal["table"] = Field(description=KINDS)
    table: str = Field(
        default="", description="path of a CSV file; its rows are read at once and kept in `rows`"
    )
    rows: str = Field(description="text of the table, packed if it is long; in place of `table`")
    source: str = Field(default="", description="where the rows came from")
    between: Literal["held", "linear", "minimum_jerk", "smooth"] = Field(
        default="linear",
        description="from row to row: held, linear (straight, and by the shortest turn), minimum_jerk (with a rest at "
        "each), smooth (without one; gains go as with minimum_jerk)",
    )
    relative: Annotated[bool, BeforeValidator(_flag)] = Field(
        default=False,
        description="x,y,z and turns are from where the reference is when the table begins, in world axes; in place "
        "of the world",
    )
    axes: Literal["world", "tool"] = Field(
        default="world",
        description="of the gains: as in the law, or all in the axes of the reference, that turn with it",
    )
    stream: Stream | None = Field(
        default=None,
        description="the rows come as messages, late and not all of them; as they are if left out",
    )

    @model_validator(mode="before")
    @classmethod
    def _read(cls, written: Any) -> Any:
        if not isinstance(written, dict):
            return written
        return with_rows(written)

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        try:
            rows = self.numbers
        except (ValueError, UnreadableError) as error:
            raise Mistakes((("table",), self.where(str(error)))) from None
        if (rows.velocity is not None or rows.spin is not None) and (self.between != "smooth" or self.stream):
            raise Mistakes(
                (
                    ("between",),
                    "a velocity, vx..vz or wx..wz, is passed with between: smooth, not in a stream; got "
                    + ("a stream" if self.stream else self.between),
                )
            )
        if self.between == "smooth" and self.stream:
            raise Mistakes(
                (("between",), "a stream does not know the next row; needs held, linear or minimum_jerk")
            )
        return self

    def where(self, mistake: str) -> str:
        """Return a mistake of the rows with the name of their file."""
        return in_file(self.source, mistake)

    @property
    def numbers(self) -> SetpointRows:
        """Return the rows in numbers."""
        return setpoint_rows(self.rows)

    @property
    def turns(self) -> bool:
        """Return whether it has an orientation."""
        return self.numbers.turn is not None

    @property
    def in_tool(self) -> bool:
        """Return whether its gains are in the axes of the reference throughout."""
        return self.axes == "tool"

    @property
    def changes_gains(self) -> bool:
        """Return whether it has stiffness or damping."""
        return self.numbers.stiffness is not None or self.numbers.damping is not None

    def build(self, now: Pose) -> Motion:
        """Return the first of its motions."""
        return self.motions(now)[0][1]

    def motions(self, now: Pose, seed: int = 0) -> Sequence[tuple[float, Motion]]:
        """Return the motion that begins with each row, or with each message that comes."""
        from passiflex.control.legs import legs
        from passiflex.control.motion import hold

        rows = self.numbers
        if rows.position is None and rows.turn is None:
            return [(self.at, hold(now))]
        position, rotation = self._poses(rows, now)
        if self.stream is None:
            found = legs(rows.time, position, rotation, self.between, *self._rates(rows))
            return [
                *self._before(rows.time[0], now),
                *zip((self.at + rows.time).tolist(), found, strict=True),
            ]
        return self._streamed(now, position, rotation, seed)

    def gains(self, seed: int = 0) -> list[GainRow]:
        """Return the gains that are told, in the order of time."""
        rows = self.numbers
        if not self.changes_gains:
            return []
        which, time = self._told(seed)
        ends = time
        if self.between != "held":
            ends = time + self._span if self.stream else time
            time = time if self.stream else np.append(time[:1], time[:-1])
        K, D = rows.stiffness, rows.damping
        return [
            GainRow(start, end, None if K is None else K[i], None if D is None else D[i])
            for i, start, end in zip(which, time.tolist(), ends.tolist(), strict=True)
        ]

    def words(self) -> str:
        """Return whose rows it follows."""
        return f"table {self.source}".strip()

    @property
    def _span(self) -> float:
        """Return how long it takes from one message of a stream to the next [s]."""
        assert self.stream is not None
        time = self.numbers.time
        if self.stream.rate is not None:
            return 1 / self.stream.rate
        return float(np.median(np.diff(time))) if len(time) > 1 else 0.0

    def _told(self, seed: int) -> tuple[NDArray[np.int64], Array]:
        """Return which rows are told, and when [s]: of messages that overtake each other, the later one counts."""
        time, s = self.numbers.time, self.stream
        if s is None:
            return np.arange(len(time)), self.at + time
        sent, which = time, np.arange(len(time))
        if s.rate is not None:
            count = int(np.floor((time[-1] - time[0]) * s.rate + 1e-9)) + 1
            sent = time[0] + np.arange(count) / s.rate
            which = np.searchsorted(time, sent + 1e-9, side="right") - 1
        chance = np.random.default_rng(np.random.SeedSequence(seed).spawn(OF_STREAM + 1)[OF_STREAM])
        late, kept = chance.random(len(sent)), chance.random(len(sent)) >= s.lost
        comes = (self.at + sent + s.delay + s.jitter * late)[kept]
        which = which[kept]
        newest = np.minimum.accumulate(comes[::-1])[::-1] >= comes  # no later message was there before
        return which[newest], comes[newest]

    def _streamed(
        self, now: Pose, position: Array, rotation: Array, seed: int
    ) -> Sequence[tuple[float, Motion]]:
        """Return a motion for each message, from where the reference is when it comes."""
        from scipy.spatial.transform import Rotation

        from passiflex.control.legs import SHAPES
        from passiflex.control.motion import Pose, along, hold, pose_at

        found: list[tuple[float, Motion]] = [(self.at, hold(now))]
        which, time = self._told(seed)
        for i, comes in zip(which, time.tolist(), strict=True):
            goal = Pose(position[i], rotation[i])
            if self.between == "held":
                motion = hold(goal)
            else:
                began, last = found[-1]
                here = pose_at(last, comes - began)
                turn = Rotation.from_matrix(goal.rotation @ here.rotation.T).as_rotvec()
                motion = along(here, goal.position - here.position, turn, self._span, SHAPES[self.between])
            if comes > found[-1][0]:
                found.append((comes, motion))
            else:
                found[-1] = (comes, motion)
        return found

    def _before(self, first: float, now: Pose) -> list[tuple[float, Motion]]:
        """Return what the reference does until the first row: it stays where it is."""
        from passiflex.control.motion import hold

        return [(self.at, hold(now))] if first > 0 else []

    def _poses(self, rows: SetpointRows, now: Pose) -> tuple[Array, Array]:
        """Return the poses of the rows in the world, (N, 3) m and (N, 3, 3)."""
        from scipy.spatial.transform import Rotation

        count = len(rows.time)
        position = np.broadcast_to(now.position, (count, 3))
        if rows.position is not None:
            position = rows.position + now.position if self.relative else rows.position
        rotation = np.broadcast_to(now.rotation, (count, 3, 3))
        if rows.turn is not None:
            turned = Rotation.from_quat(rows.turn).as_matrix()
            rotation = turned @ now.rotation if self.relative else turned
        return position, rotation

    def _rates(self, rows: SetpointRows) -> tuple[Array | None, Array | None]:
        return rows.velocity, rows.spin


def as_events(written: Any) -> Any:
    """Return what was written for a reference as a list of events: a table alone stands for a list of one."""
    if isinstance(written, Mapping) and ("table" in written or "rows" in written):
        return [{"kind": "table", **written}]
    return [written] if isinstance(written, AbstractReferenceEvent) else written
