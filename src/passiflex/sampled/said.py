"""What robots say of themselves, each something else, and what a law needs: the one is completed to the other.

A robot says where its links or its motors are, or both; velocities or none; the torque through its joints or none. What
is missing follows from what is there: θ − q = τ/K, velocities are differences behind a low-pass, and a torque that
nobody measures is the one that the motors were told; joints of which only q is known are taken for rigid then.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, final

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.control.signals import Measurement
from passiflex.layout import Field, Layout
from passiflex.sampled.rest import Remembered, Rest
from passiflex.sampled.sayable import POSITIONS, SAYABLE
from passiflex.sampled.sensors import AbstractSensorEffect, Reading, difference, low_pass


class Filled(NamedTuple):
    """The joints' part of a measurement, (n,) each, and what is remembered of it."""

    q: cs.SX
    theta: cs.SX
    dq: cs.SX
    dtheta: cs.SX
    tau_a: cs.SX
    state: cs.SX


class Given(NamedTuple):
    """What is known beside the readings.

    Attributes
    ----------
    stiffness: K of the joints, by the law's model (n,) [N m/rad].
    weight: That the readings contain and the law is not to see (n,) [N m].
    pole: Of the low-pass of differences [rad/s].
    elapsed: Since the last reading [s].
    applied: Torque that the motors were last told (n,) [N m].
    """

    stiffness: cs.SX
    weight: cs.SX
    pole: cs.SX
    elapsed: cs.SX
    applied: cs.SX


def filled(said: Any, says: Mapping[str, cs.SX | float], given: Given, s: Any) -> Filled:
    """Return what a law is told of its joints.

    Parameters
    ----------
    said: Readings by name; `says` is 1 for those that there are.
    s: What is remembered, by name.
    """
    K, weight = given.stiffness, given.weight
    says = {name: cs.SX(says[name]) for name in SAYABLE}
    both, felt = says["q"] * says["theta"], says["tau_a"]
    guessed = cs.if_else(both > 0, K * (said.theta - said.q), given.applied + weight)
    tau_a = cs.if_else(felt > 0, said.tau_a, guessed)
    q = cs.if_else(says["q"] > 0, said.q, said.theta - tau_a / K)
    bent = cs.if_else(felt > 0, tau_a, weight) / K  # a guess that moves with the command would feed itself
    theta = cs.if_else(says["theta"] > 0, said.theta, said.q + bent) - weight / K

    def velocity(name: str, now: cs.SX, last: cs.SX, before: cs.SX) -> tuple[cs.SX, cs.SX]:
        rate = cs.if_else(s.heard > 0, difference(last, now, given.elapsed), 0)
        smooth = low_pass(before, rate, given.pole, given.elapsed)
        return cs.if_else(says[name] > 0, getattr(said, name), smooth), smooth

    dq, smooth_dq = velocity("dq", q, s.heard_q, s.heard_dq)
    dtheta, smooth_dtheta = velocity("dtheta", theta, s.heard_theta, s.heard_dtheta)
    remembered = {
        "heard": 1,
        "heard_q": q,
        "heard_theta": theta,
        "heard_dq": smooth_dq,
        "heard_dtheta": smooth_dtheta,
    }
    return Filled(q, theta, dq, dtheta, tau_a - weight, said_state(K.numel()).stack(remembered))


def said_state(n: int) -> Layout:
    """Return what is remembered of the readings."""
    return Layout(
        (
            Field("heard", (), "1", "0 before the first reading", kept=False),
            Field("heard_q", (n,), "rad", "last q", kept=False, acts=True),
            Field("heard_theta", (n,), "rad", "last θ", kept=False, acts=True),
            Field("heard_dq", (n,), "rad/s", "low-passed difference of q", kept=False, acts=True),
            Field("heard_dtheta", (n,), "rad/s", "low-passed difference of θ", kept=False, acts=True),
        )
    )


@final
@dataclass(frozen=True)
class SaysLess(AbstractSensorEffect):
    """A robot that says less than all: its law is told what follows from the rest.

    Attributes
    ----------
    names: Of what it says, of `SAYABLE`; q or theta among them.
    stiffness: K of the joints, by the law's model [N m/rad].
    pole: Of the low-pass of differences [rad/s].
    """

    names: tuple[str, ...]
    stiffness: tuple[float, ...]
    pole: float

    @property
    def guesses(self) -> bool:
        """Return whether the joints' torque is guessed."""
        return "tau_a" not in self.names and not set(self.names) >= POSITIONS

    def state(self, n: int) -> Layout:
        """Return what it remembers."""
        return said_state(n)

    def start(self, at: Rest) -> Remembered:
        """Return the positions that it finds at rest."""
        K: NDArray[np.float64] = np.array(self.stiffness)
        tau_a = at.tau_a if "tau_a" in self.names or not self.guesses else at.command
        q = at.q if "q" in self.names else at.theta - tau_a / K
        theta = at.theta if "theta" in self.names else at.q + (tau_a / K if "tau_a" in self.names else 0)
        found: dict[str, Any] = {"heard": 1.0, "heard_q": q, "heard_theta": theta}
        return self.state(at.q.size).zeros() | {name: at.running * value for name, value in found.items()}

    def read(self, y: Measurement, elapsed: cs.SX, s: Any) -> Reading:
        """Return the completed measurement."""
        says = {name: float(name in self.names) for name in SAYABLE}
        K, n = cs.SX(list(self.stiffness)), len(self.stiffness)
        given = Given(K, cs.SX.zeros(n), cs.SX(self.pole), elapsed, s.applied_torque)
        told = filled(y, says, given, s)
        return Reading(y._replace(**{name: getattr(told, name) for name in SAYABLE}), told.state)
