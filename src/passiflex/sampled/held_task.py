"""Two rates: the outer loop runs once in so many periods, and its torque is held for the inner loop in between."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, final

import casadi as cs

from passiflex.layout import Field, Layout
from passiflex.sampled.inner_loop import InnerNumbers
from passiflex.sampled.rest import Remembered, Rest


class Due(NamedTuple):
    """Whether the outer loop runs in this period, and how long ago it was due [s], this time included."""

    now: cs.SX
    age: cs.SX


@final
@dataclass(frozen=True)
class HeldTask:
    """τ_u of (12) and (32) from a slower clock, as of a task at 200 Hz above joints at 1 kHz.

    The outer loop is due every `task_periods` periods, counted from the first one; if the law does not run then, as
    soon as it does. The tank, its valve and the governor go on in every period: what they decide of the task comes
    into force when that runs.
    """

    def state(self, n: int) -> Layout:
        """Return the torque that is held, and its age."""
        return Layout(
            (
                Field("task_torque", (n,), "N m", "τ_u that is held", kept=False, acts=True),
                Field("task_age", (), "s", "since the outer loop was due", kept=False),
            )
        )

    def start(self, at: Rest) -> Remembered:
        """Return the torque that the shaped springs hold."""
        return self.state(at.q.size).zeros() | {"task_torque": at.running * at.tau_a}

    def due(self, first: cs.SX, elapsed: cs.SX, s: Any, i: InnerNumbers) -> Due:
        """Return whether the outer loop is due, `elapsed` seconds after the last period that ran."""
        cycle, age = i.task_periods * i.period, s.task_age + elapsed
        passed = cs.floor((age + i.period / 2) / cycle)  # on the grid also where a period was missed
        return Due(cs.logic_or(first, passed > 0), cs.if_else(first, 0, age - passed * cycle))
