"""Reference motions: one primitive with run-time coefficients, so that no motion needs a new build.

    p_d(s) = Σₖ cₖ sᵏ + a sin ωs + b (1 − cos ωs),   R_d(s) = exp([Σₖ uₖ sᵏ]) R₀

covers a set-point, a ramp, a minimum-jerk move with a turn, a piece of a spline, a circle, a sinusoid and a steady
rotation. s is the reference's own clock: it runs with the time, and slower when the tank is near its floor.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from passiflex.control.rotation_vector import angular_velocity, turned
from passiflex.control.signals import Reference
from passiflex.layout import Field, Layout
from passiflex.robots.arm import EndEffectorPose

DEGREE = 5


class MotionNumbers(Protocol):
    """The coefficients of a motion in symbols, as `MOTION` says."""

    polynomial: cs.SX
    horizon: cs.SX
    sine: cs.SX
    cosine: cs.SX
    frequency: cs.SX
    rotation: cs.SX
    turn: cs.SX


MOTION = Layout(
    (
        Field("polynomial", (3, DEGREE + 1), "m/s^k", "c_k, column k multiplies s^k"),
        Field("horizon", (), "s", "from here on both polynomials keep their values"),
        Field("sine", (3,), "m", "a"),
        Field("cosine", (3,), "m", "b"),
        Field("frequency", (), "rad/s", "ω"),
        Field("rotation", (3, 3), "1", "R₀"),
        Field("turn", (3, DEGREE + 1), "rad/s^k", "u_k, in world axes; column k multiplies s^k"),
    ),
    MotionNumbers,
)

ENDLESS = 1e9
"""Horizon [s] of a motion that never ends."""
MINIMUM_JERK = (0.0, 0.0, 0.0, 10.0, -15.0, 6.0)
LINEAR = (0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
"""Share of a way in powers of the share of its time."""

Motion = Mapping[str, NDArray[np.float64]]


class Pose(NamedTuple):
    """A pose in numbers: position (3,) m, rotation matrix (3, 3)."""

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]


def reference_at(clock: cs.SX, rate: cs.SX, c: MotionNumbers) -> Reference:
    """Return the reference at the clock s, which runs at `rate` = ṡ, for a view c of `MOTION`."""
    s, moving = cs.fmin(clock, c.horizon), clock < c.horizon
    powers = cs.vertcat(*(s**k for k in range(DEGREE + 1)))
    slopes = moving * cs.vertcat(0, *(k * s ** (k - 1) for k in range(1, DEGREE + 1)))
    w = c.frequency
    sin, cos = cs.sin(w * clock), cs.cos(w * clock)
    position = c.polynomial @ powers + c.sine * sin + c.cosine * (1 - cos)
    velocity = c.polynomial @ slopes + w * (c.sine * cos + c.cosine * sin)
    u = c.turn @ powers
    twist = cs.vertcat(velocity, angular_velocity(u, c.turn @ slopes))
    return Reference(EndEffectorPose(position, turned(u) @ c.rotation), twist * rate)


def hold(pose: Pose) -> dict[str, NDArray[np.float64]]:
    """Return the motion that stays at `pose`."""
    polynomial = np.zeros((3, DEGREE + 1))
    polynomial[:, 0] = pose.position
    return {
        "polynomial": polynomial,
        "horizon": np.asarray(ENDLESS),
        "sine": np.zeros(3),
        "cosine": np.zeros(3),
        "frequency": np.zeros(()),
        "rotation": np.asarray(pose.rotation, dtype=float),
        "turn": np.zeros((3, DEGREE + 1)),
    }


def minimum_jerk(
    pose: Pose, by: ArrayLike, duration: float, turn: ArrayLike = (0.0, 0.0, 0.0)
) -> dict[str, NDArray[np.float64]]:
    """Return the move by `by` (3,) m within `duration` s, at rest with zero acceleration at both ends.

    It turns by the rotation vector `turn` (3,) rad in world axes, about an axis that stays.
    """
    return along(pose, by, turn, duration, MINIMUM_JERK)


def along(
    pose: Pose, by: ArrayLike, turn: ArrayLike, duration: float, shape: ArrayLike
) -> dict[str, NDArray[np.float64]]:
    """Return the straight line by `by` and the geodesic turn by `turn`, Σ shape_k (s / duration)ᵏ of the way at s."""
    motion = hold(pose)
    way = np.asarray(shape) / duration ** np.arange(DEGREE + 1)
    motion["horizon"] = np.asarray(duration)
    motion["polynomial"] = motion["polynomial"] + np.asarray(by, dtype=float)[:, None] * way
    motion["turn"] = motion["turn"] + np.asarray(turn, dtype=float)[:, None] * way
    return motion


def circle(
    pose: Pose, first: ArrayLike, second: ArrayLike, radius: float, period: float
) -> dict[str, NDArray[np.float64]]:
    """Return c + R (first · sin ωs + second · (1 − cos ωs)), starting at c = pose, ω = 2π / period."""
    motion = hold(pose)
    motion["sine"], motion["cosine"] = radius * np.asarray(first), radius * np.asarray(second)
    motion["frequency"] = np.asarray(2 * np.pi / period)
    return motion


def pose_at(motion: Motion, clock: float) -> Pose:
    """Return the pose of a motion at the clock s, in numbers."""
    powers = min(clock, float(motion["horizon"])) ** np.arange(DEGREE + 1)
    w = float(motion["frequency"])
    position = (
        motion["polynomial"] @ powers
        + motion["sine"] * np.sin(w * clock)
        + motion["cosine"] * (1 - np.cos(w * clock))
    )
    turn = motion["turn"] @ powers
    return Pose(
        position,
        Rotation.from_rotvec(turn).as_matrix() @ motion["rotation"] if turn.any() else motion["rotation"],
    )


def shifted(motion: Motion, start: Pose) -> dict[str, NDArray[np.float64]]:
    """Return the same motion, moved so that it begins at `start`."""
    begin = pose_at(motion, 0.0)
    moved = {k: np.array(v) for k, v in motion.items()}
    moved["polynomial"][:, 0] += start.position - begin.position
    first = moved["turn"][:, 0]
    moved["rotation"] = (
        Rotation.from_rotvec(-first).as_matrix() @ start.rotation if first.any() else start.rotation
    )
    return moved


def rebased(motion: Motion, old: Pose, new: Pose) -> Motion:
    """Return a motion that began somewhere seen from `old`, seen from `new`: displacements are in world axes."""
    begin = pose_at(motion, 0.0)
    turned = begin.rotation @ old.rotation.T @ new.rotation
    return shifted(motion, Pose(begin.position + new.position - old.position, turned))


def moved(pose: Pose, by: ArrayLike, turn: ArrayLike) -> Pose:
    """Return a pose displaced by `by` (3,) m and turned by a rotation vector (3,) rad, both in world axes."""
    turned = Rotation.from_rotvec(np.asarray(turn, dtype=float)).as_matrix() @ pose.rotation
    return Pose(pose.position + np.asarray(by, dtype=float), turned)


def between(start: Pose, end: Pose, share: float) -> Pose:
    """Return the pose at `share` (0..1) of the straight line and the shortest turn from start to end."""
    turn = Rotation.from_matrix(end.rotation @ start.rotation.T).as_rotvec()
    return Pose(
        start.position + share * (end.position - start.position),
        Rotation.from_rotvec(share * turn).as_matrix() @ start.rotation,
    )
