"""How what is asked for is approached: a setpoint that jumps, as those of a policy at 10 Hz do, becomes a way.

The pose goes over to it in a straight line and about one axis, K_x and D_x linearly, within `ramp` seconds, as far as
the largest speeds allow. What is between two gains that are symmetric and not negative is so too.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as cs

from passiflex.layout import Field, Layout
from passiflex.onboard.watch import AT_ONCE

SMALL = 1e-12
"""[rad, m] that are no way."""
HALF = 1e-6
"""Sine of an angle below which it is 0 or half a turn, whose axis nobody can tell."""


def approach_layout() -> Layout:
    """Return the numbers of an approach."""
    return Layout(
        (
            Field("ramp", (), "s", "in which a setpoint is approached; 0 for at once"),
            Field("speed", (), "m/s", "largest of the reference"),
            Field("turn_rate", (), "rad/s", "likewise"),
        )
    )


def approach_state(k: int) -> Layout:
    """Return what is remembered, of a task with k directions."""
    return Layout(
        (
            Field("near_position", (3,), "m", "where the reference is on its way", axes=("axis",)),
            Field("near_rotation", (3, 3), "1", "its axes", axes=("axis", "column")),
            Field(
                "near_stiffness",
                (k, k),
                "N/m, N, N m/rad",
                "K_x on its way",
                axes=("task_row", "task_column"),
            ),
            Field("near_damping", (k, k), "N s/m, N s, N m s/rad", "D_x", axes=("task_row", "task_column")),
        )
    )


class Near(NamedTuple):
    """Where the reference is on its way, how fast, and with what gains; and what is remembered, flat."""

    position: cs.SX
    rotation: cs.SX
    velocity: cs.SX
    acceleration: cs.SX
    stiffness: cs.SX
    damping: cs.SX
    state: cs.SX


def approached(told: Any, age: cs.SX, elapsed: cs.SX, s: Any, g: Any) -> Near:
    """Return the reference one period further.

    Parameters
    ----------
    told: The setpoint, by name.
    age: How old it is, less than a period for a new one [s].
    s, g: State and numbers, by name.
    """
    ramps = g.ramp > AT_ONCE
    left = cs.fmax(g.ramp - age, elapsed)
    share = cs.if_else(ramps, cs.fmin(elapsed / left, 1), 1)
    way = told.position - s.near_position
    length = cs.norm_2(way)
    far = cs.fmin(share * length, g.speed * elapsed)
    moved = cs.if_else(length > SMALL, far / cs.fmax(length, SMALL), 1)
    position = _there(moved, told.position, s.near_position + moved * way)
    rotation, spin = _turned(s.near_rotation, told.rotation, share, g.turn_rate * elapsed)
    own = cs.vertcat((position - s.near_position) / elapsed, spin / elapsed)
    stiffness = _there(share, told.stiffness, s.near_stiffness + share * (told.stiffness - s.near_stiffness))
    damping = _there(share, told.damping, s.near_damping + share * (told.damping - s.near_damping))
    state = approach_state(stiffness.shape[0]).stack(
        {
            "near_position": position,
            "near_rotation": rotation,
            "near_stiffness": stiffness,
            "near_damping": damping,
        }
    )
    velocity = cs.if_else(ramps, own, told.velocity)
    acceleration = cs.if_else(ramps, 0, told.acceleration)
    return Near(position, rotation, velocity, acceleration, stiffness, damping, state)


def _there(share: cs.SX, end: cs.SX, between: cs.SX) -> cs.SX:
    """Return what is between, exactly the end in the end."""
    return cs.if_else(share >= 1, end, between)


def _turned(now: cs.SX, goal: cs.SX, share: cs.SX, most: cs.SX) -> tuple[cs.SX, cs.SX]:
    """Return a rotation nearer to its goal, and by what it was turned, as a vector in world axes."""
    R = goal @ now.T
    sine = cs.vertcat(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]) / 2
    size, cosine = cs.norm_2(sine), (cs.trace(R) - 1) / 2
    angle = cs.atan2(size, cosine)
    told = size > HALF
    about = cs.if_else(told, sine / cs.fmax(size, HALF), _half_turn(R))
    far = cs.fmin(share * angle, most)
    turns = cs.logic_or(told, cosine < 0)
    cross = cs.skew(about)
    part = cs.SX.eye(3) + cs.sin(far) * cross + (1 - cs.cos(far)) * (cross @ cross)
    arrived = cs.logic_or(far >= angle, cs.logic_not(turns))
    return cs.if_else(arrived, goal, part @ now), cs.if_else(turns, far * about, 0)


def _half_turn(R: cs.SX) -> cs.SX:
    """Return the axis of half a turn, of which R + 1 = 2 a aᵀ: its longest column."""
    columns = cs.horzsplit((R + R.T) / 2 + cs.SX.eye(3))
    x, y, z = columns
    best = cs.if_else(cs.sumsqr(y) > cs.sumsqr(x), y, x)
    best = cs.if_else(cs.sumsqr(z) > cs.sumsqr(best), z, best)
    return best / cs.fmax(cs.norm_2(best), HALF)
