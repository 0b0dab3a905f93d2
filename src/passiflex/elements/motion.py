"""How what touches a robot moves: along the motions of a reference, by a clock of its own."""

from __future__ import annotations

from typing import Any

import casadi as cs
import numpy as np

from passiflex.control.motion import MOTION, Motion, Pose, hold, reference_at
from passiflex.layout import Field, Layout, View

_PLACES = ("polynomial", "horizon", "sine", "cosine", "frequency")
POSITION = Layout(
    (
        Field("began", (), "s", "when its motion began", kept=False),
        *(f._replace(kept=False) for f in MOTION if f.name in _PLACES),
    )
)
"""What of a motion concerns positions, and when it began."""


def motion_of(motion: Motion, began: float) -> dict[str, Any]:
    """Return the numbers of `POSITION` for a motion that began at a time [s]."""
    return {"began": began, **{name: motion[name] for name in _PLACES}}


def place_at(clock: cs.SX, c: Any) -> tuple[cs.SX, cs.SX]:
    """Return where a motion is at a time [s], and its velocity, for a view c of `POSITION`."""
    still = {name: cs.SX(np.asarray(value)) for name, value in hold(Pose(np.zeros(3), np.eye(3))).items()}
    reference = reference_at(clock - c.began, cs.SX(1), View(**still | vars(c)))
    return reference.pose.position, reference.velocity[:3]
