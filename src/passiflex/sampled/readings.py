"""Which readings of a sampled loop are late or noisy: code is made for those alone; and how books pair them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import casadi as cs

from passiflex.control.signals import Measurement
from passiflex.layout import Field, Layout


class Lateness(NamedTuple):
    """How late each sensor is [s]: q and q̇, θ and θ̇, τ_a, F_e."""

    link: float = 0.0
    motor: float = 0.0
    torque: float = 0.0
    wrench: float = 0.0

    def in_periods(self, period: float) -> Lateness:
        """Return the same in periods; what differs from a whole number by rounding is one."""
        return Lateness(*(_tidy(late / period) for late in self))


ON_TIME = Lateness()


class Paired(NamedTuple):
    """What the books take for readings of one instant, the time since the one before [s], and what is remembered."""

    q: cs.SX
    tau_a: cs.SX
    elapsed: cs.SX
    state: dict[str, Any]


class Delayed(NamedTuple):
    """A value as it was some periods ago, and what is remembered of it."""

    value: cs.SX
    past: cs.SX


@dataclass(frozen=True)
class Readings:
    """For which effects a loop has code.

    Attributes
    ----------
    noisy: Whether q and θ are read with noise.
    link, motor, torque, wrench: How many readings of each are kept back: its delay in periods, rounded up.
    paired: So many of q the books keep until τ_a of the same instant has come; of τ_a, if negative.
    """

    noisy: bool = False
    link: int = 0
    motor: int = 0
    torque: int = 0
    wrench: int = 0
    paired: int = 0

    @classmethod
    def of(cls, periods: Lateness, *, noisy: bool) -> Self:
        """Return the code for sensors that are so many periods late."""
        link, motor, torque, wrench = (math.ceil(late) for late in periods)
        apart = _tidy(periods.torque - periods.link)
        paired = int(math.copysign(math.ceil(abs(apart)), apart))
        return cls(noisy, link, motor, torque, wrench, paired)

    @property
    def late(self) -> int:
        """Return how many periods it takes until q and τ_a of an instant have both been read."""
        return max(self.link, self.torque)

    def sensor_state(self, n: int) -> Layout:
        """Return what sensors that are late keep back, the newest first."""
        kept = {
            "late_q": (self.link, n, "rad", "q, already read"),
            "late_dq": (self.link, n, "rad/s", "q̇, already read"),
            "late_theta": (self.motor, n, "rad", "θ, already read"),
            "late_dtheta": (self.motor, n, "rad/s", "θ̇, already read"),
            "late_tau_a": (self.torque, n, "N m", "τ_a, already read"),
            "late_wrench": (self.wrench, 6, "N, N m", "F_e, already read"),
        }
        return Layout(
            tuple(
                Field(name, (periods, size), unit, meaning, kept=False, acts=True)
                for name, (periods, size, unit, meaning) in kept.items()
                if periods
            )
        )

    def book_state(self, n: int) -> Layout:
        """Return what the books keep back."""
        fields = []
        if self.paired:
            what = ("q", "rad") if self.paired > 0 else ("τ_a", "N m")
            fields.append(
                Field("waiting", (abs(self.paired), n), what[1], f"{what[0]} to be paired", kept=False)
            )
        if self.late:
            fields.append(
                Field("late_elapsed", (self.late,), "s", "between the readings kept back", kept=False)
            )
        return Layout(tuple(fields))

    def pair(self, y: Measurement, elapsed: cs.SX, first: cs.SX, s: Any, e: Any) -> Paired:
        """Return q and τ_a of one instant; `e` has `pairing` and `late`, in periods."""
        q, tau_a, between, state = y.q, y.tau_a, elapsed, dict[str, Any]()
        if self.paired:
            early = q if self.paired > 0 else tau_a
            found = delayed(s.waiting, early, e.pairing, first)
            q, tau_a = (found.value, tau_a) if self.paired > 0 else (q, found.value)
            state["waiting"] = found.past
        if self.late:
            known = cs.if_else(s.late_elapsed > 0, s.late_elapsed, elapsed)
            found = delayed(known, elapsed, e.late, first)
            between, state["late_elapsed"] = found.value, found.past
        return Paired(q, tau_a, between, state)


EXACT = Readings()
"""Neither late nor noisy."""


def delayed(past: cs.SX, now: cs.SX, periods: cs.SX, first: cs.SX) -> Delayed:
    """Return a value so many periods late, linear between two of them; before the `first`, it was what it is.

    `past` (m, k) are the values of the periods before, the newest first; m is `periods`, rounded up.
    """
    m = past.shape[0]
    past = cs.if_else(first, cs.repmat(now.T, m, 1), past)
    newer = past[m - 2, :].T if m > 1 else now
    share = periods - (m - 1)
    return Delayed((1 - share) * newer + share * past[m - 1, :].T, cs.vertcat(now.T, past[: m - 1, :]))


def _tidy(periods: float) -> float:
    return float(round(periods)) if abs(periods - round(periods)) < 1e-6 else periods
