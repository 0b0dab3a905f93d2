"""What a controller on a robot watches: setpoints that stay away, sensors that freeze or say no number, its own stop.

All end alike. The stiffness K_x that is asked for is scaled by σ, which goes to 0 within `soften` seconds, and comes
back within `soft_start`: the arm yields, damped, its weight carried as before. The tank pays for σ K_x as for others.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as cs

from passiflex.layout import Field, Layout

AT_ONCE = 1e-9
"""Durations below it are none [s]."""


def watch_layout() -> Layout:
    """Return the numbers of the watch."""
    return Layout(
        (
            Field("stale_after", (), "s", "without a setpoint, after which the reference stands still"),
            Field("soften_after", (), "s", "without a setpoint, after which the stiffness goes"),
            Field("frozen_after", (), "s", "of readings equal to the last bit, after which it goes"),
            Field(
                "silent_after", (), "s", "without a finite reading, after which it goes, and the torque too"
            ),
            Field("soften", (), "s", "in which the stiffness goes"),
            Field("soft_start", (), "s", "in which it comes"),
        )
    )


def watch_state(said: int) -> Layout:
    """Return what is remembered, of a robot that says so many numbers."""
    return Layout(
        (
            Field("scale", (), "1", "σ, share of the stiffness that is asked for"),
            Field("setpoint_age", (), "s", "since the last setpoint"),
            Field("frozen_time", (), "s", "in which the readings were equal"),
            Field("silent_time", (), "s", "in which none was finite"),
            Field("last_said", (said,), "1", "the readings of the last period", kept=False),
        )
    )


class Watched(NamedTuple):
    """What the watch decides in a period.

    Attributes
    ----------
    scale: σ.
    fresh: 1 while the reference may move.
    age: Of the setpoint [s].
    state: Flat.
    """

    scale: cs.SX
    fresh: cs.SX
    age: cs.SX
    state: cs.SX


def watched(said: cs.SX, elapsed: cs.SX, ok: cs.SX, told: Any, s: Any, g: Any, says: cs.SX) -> Watched:
    """Return what the watch decides.

    Parameters
    ----------
    said: The readings, flat, without the time; `says` is 1 for those that the robot says.
    ok: 1 if they are finite.
    told: `fresh`, 1 if there is a new setpoint, and `run`, 1 unless the arm is to be stopped.
    """
    changed = cs.sum1(cs.if_else(says > 0, cs.fabs(said - s.last_said), 0))
    age = cs.if_else(told.fresh > 0, 0, s.setpoint_age + elapsed)
    frozen = cs.if_else(cs.logic_and(ok > 0, changed <= 0), s.frozen_time + elapsed, 0)
    silent = cs.if_else(ok > 0, 0, s.silent_time + elapsed)
    well = cs.logic_and(told.run > 0, age < g.soften_after)
    well = cs.logic_and(well, cs.logic_and(frozen < g.frozen_after, silent < g.silent_after))

    def over(duration: cs.SX) -> cs.SX:
        return cs.if_else(duration > AT_ONCE, elapsed / cs.fmax(duration, AT_ONCE), 1)

    scale = cs.if_else(well, cs.fmin(s.scale + over(g.soft_start), 1), cs.fmax(s.scale - over(g.soften), 0))
    state = watch_state(said.numel()).stack(
        {
            "scale": scale,
            "setpoint_age": age,
            "frozen_time": frozen,
            "silent_time": silent,
            "last_said": cs.if_else(ok > 0, said, s.last_said),
        }
    )
    return Watched(scale, age < g.stale_after, age, state)
