"""What motors make of a command: torque and torque-rate limits."""

from __future__ import annotations

import casadi as cs

from passiflex.layout import Field, Layout

UNLIMITED_TORQUE = 1e12
"""A limit [N m, N m/s] that stands for none."""


def limit_layout(n: int) -> Layout:
    """Return the parameters of the limits."""
    return Layout(
        (
            Field("torque_limit", (n,), "N m", "largest motor torque"),
            Field("torque_rate_limit", (n,), "N m/s", "fastest change of the motor torque"),
        )
    )


def limited(command: cs.SX, last: cs.SX, torque_limit: cs.SX, rate_limit: cs.SX, elapsed: cs.SX) -> cs.SX:
    """Return the torque that the motors give: as near to the command as rate and limit allow, joint by joint."""
    step = rate_limit * elapsed
    reached = cs.fmin(cs.fmax(command, last - step), last + step)
    reached = cs.if_else(rate_limit < UNLIMITED_TORQUE, reached, command)
    return cs.fmin(cs.fmax(reached, -torque_limit), torque_limit)
