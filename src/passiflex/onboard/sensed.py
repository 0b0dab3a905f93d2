"""What a robot says in one period, as Python has it."""

from __future__ import annotations

from typing import NamedTuple

from numpy.typing import ArrayLike


class Sensed(NamedTuple):
    """What a robot says in one period; what it does not say is None.

    Attributes
    ----------
    q: Link positions (n,) rad; q or theta there must be.
    theta: Motor positions, seen from the link (n,) rad.
    dq, dtheta: Their velocities (n,) rad/s.
    tau_a: Torque through the joints, positive on the links (n,) N m.
    F_e: Wrench on the end effector in world axes, force first (6,) N and N m.
    applied: Torque that the motors were really given in the period before (n,) N m.
    """

    q: ArrayLike | None = None
    theta: ArrayLike | None = None
    dq: ArrayLike | None = None
    dtheta: ArrayLike | None = None
    tau_a: ArrayLike | None = None
    F_e: ArrayLike | None = None
    applied: ArrayLike | None = None
