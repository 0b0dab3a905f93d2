"""The ends of the joints' ranges."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, final

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.elements.element import AbstractElement, Effect, Mobility, Port, Touch, nothing
from passiflex.elements.normal import HuntCrossley, Pressed
from passiflex.errors import ValueRangeError
from passiflex.layout import Field, Layout, Signal

NO_END = 1e9
"""Of a joint that may go as far as it will [rad, m]."""
ROUND_OFF = 1e-9
"""By which a joint that starts at its stop may be beyond it [rad, m]."""


class StopNumbers(Protocol):
    """The ends in symbols, as `EndStops.parameters` says."""

    lower_stop: cs.SX
    upper_stop: cs.SX
    stop_stiffness: cs.SX
    stop_dissipation: cs.SX


@final
@dataclass(frozen=True)
class EndStops(AbstractElement):
    """A stop at each end of each joint, that presses the link back by the law of Hunt and Crossley."""

    meaning: ClassVar[str] = "lost in the end stops"
    port: ClassVar[Port] = "links"
    stores: ClassVar[bool] = True
    acts: bool = True
    lower: ArrayLike = field(default=-NO_END, compare=False)
    upper: ArrayLike = field(default=NO_END, compare=False)
    stiffness: ArrayLike = field(default=0.0, compare=False)
    dissipation: float = field(default=0.0, compare=False)

    @property
    def name(self) -> str:
        """Return what a run calls them."""
        return "end_stops"

    @property
    def structure(self) -> Hashable:
        """Return whether they act: their numbers are parameters."""
        return type(self), self.acts

    def parameters(self, n: int) -> Layout:
        """Return where they are and how hard."""
        return Layout(
            (
                Field("lower_stop", (n,), "rad", "below which a link is pressed back"),
                Field("upper_stop", (n,), "rad", "above which it is"),
                Field("stop_stiffness", (n,), "N m/rad", "of the stops"),
                Field("stop_dissipation", (), "s/rad", "of the stops"),
            ),
            StopNumbers,
        )

    def numbers(self, n: int) -> Mapping[str, ArrayLike]:
        """Return their values."""
        return {
            "lower_stop": np.clip(np.broadcast_to(self.lower, n), -NO_END, NO_END),
            "upper_stop": np.clip(np.broadcast_to(self.upper, n), -NO_END, NO_END),
            "stop_stiffness": np.broadcast_to(self.stiffness, n),
            "stop_dissipation": self.dissipation,
        }

    def require_between(self, q: NDArray[np.float64]) -> None:
        """Raise ValueRangeError for joints (n,) that start beyond their stops."""
        lower, upper = (np.broadcast_to(np.asarray(end, float), q.shape) for end in (self.lower, self.upper))
        beyond = np.maximum(lower - q, q - upper)
        joint = int(np.argmax(beyond))
        if beyond[joint] > ROUND_OFF:
            raise ValueRangeError(
                f"joint {joint + 1} starts beyond its end stop",
                got=f"{q[joint]:.4g} rad",
                needs=f"{lower[joint]:.4g} to {upper[joint]:.4g} rad",
                try_="another posture, or stops further out",
            )

    def rate(self, free: Mobility) -> float:
        """Return how fast a link swings on its stop."""
        return float(np.sqrt(np.max(np.asarray(self.stiffness) * free.links)))

    def act(self, at: Touch, s: Any, m: StopNumbers) -> Effect:
        """Return the torque on the links."""
        pressed = self._pressed(at, m)
        none = nothing(at.x.q.numel())
        return none._replace(
            link=self._torque(pressed),
            lost=cs.sum1(sum((p.lost for _, p in pressed), none.link)),
            stored=cs.sum1(sum((p.stored for _, p in pressed), none.link)),
        )

    def seen(self, at: Touch, s: Any, m: StopNumbers) -> tuple[Signal, ...]:
        """Return the torque on the links."""
        torque = Field(f"{self.name}_torque", (at.x.q.numel(),), "N m", "of the end stops on the links")
        return (Signal(torque, self._torque(self._pressed(at, m))),)

    def _pressed(self, at: Touch, m: StopNumbers) -> list[tuple[int, Pressed]]:
        """Return how each end presses the links, with the direction in which it does."""
        q, dq = at.x.q, at.x.dq
        ends = ((1, m.lower_stop - q), (-1, q - m.upper_stop))
        return [
            (way, HuntCrossley().press(cs.fmax(depth, 0), -way * dq, m.stop_stiffness, m.stop_dissipation))
            for way, depth in ends
        ]

    def _torque(self, pressed: list[tuple[int, Pressed]]) -> cs.SX:
        (_, lower), (_, upper) = pressed
        return lower.force - upper.force
