"""A loop at rest: what each part of it remembers then is its own to say, beside its state."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Remembered = dict[str, Any]
"""Field of a part's state → its value."""


class Rest(NamedTuple):
    """A robot that stands still, and the law that holds it.

    Attributes
    ----------
    running: 1 if the law has run for long, 0 before its first period, when nothing has been read.
    q, theta: Where links and motors stand (n,) [rad or m].
    tau_a: Through the joints, as it is (n,) [N m].
    weight: Of the links, by the law's model (n,) [N m].
    command: What holds the motors (n,) [N m].
    stiffness: K of the joints, by the law's model (n,) [N m/rad].
    position, rotation: x̂_d, where the Cartesian spring is slack.
    cartesian_stiffness: K_x in force.
    level: Of the tank [J].
    """

    running: float
    q: Array
    theta: Array
    tau_a: Array
    weight: Array
    command: Array
    stiffness: Array
    position: Array
    rotation: Array
    cartesian_stiffness: Array
    level: float
