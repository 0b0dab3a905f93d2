"""The columns of a table of set-points: what each means, which go together, and what a row must hold."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.texts.number_table import NumberTable
from passiflex.texts.timed_table import columns, timed_table

Array = NDArray[np.float64]

POSITION = ("x", "y", "z")
QUATERNION = ("qx", "qy", "qz", "qw")
TURN = ("rx", "ry", "rz")
VELOCITY = ("vx", "vy", "vz")
SPIN = ("wx", "wy", "wz")
AXES = ("x", "y", "z", "rx", "ry", "rz")
UNIT_LENGTH = 1e-3
"""How far from 1 the length of a quaternion may be: what three digits leave."""
SYMMETRIC = 1e-9
"""Share of the largest entry by which a matrix and its transpose may differ: what ten digits leave."""


def gain_names(letter: str, size: int, *, in_full: bool = False) -> tuple[str, ...]:
    """Return the columns of K_x (`k`) or D_x (`d`) for a task of this size, of their diagonals or in full."""
    return _full(letter, size) if in_full else _diagonal(letter, size)


def _diagonal(letter: str, size: int) -> tuple[str, ...]:
    return tuple(f"{letter}{axis}" for axis in AXES[:size])


def _full(letter: str, size: int) -> tuple[str, ...]:
    return tuple(f"{letter}{i}{j}" for i in range(1, size + 1) for j in range(1, size + 1))


KNOWN = (
    *("t", *POSITION, *QUATERNION, *TURN, *VELOCITY, *SPIN),
    *_diagonal("k", 6),
    *_diagonal("d", 6),
    *_full("k", 6),
    *_full("d", 6),
)


class SetpointRows(NamedTuple):
    """The rows of a table in numbers; None for what it does not say.

    Attributes
    ----------
    time: (N,) s, increasing.
    position, turn: (N, 3) m, and quaternions (N, 4), scalar last, of length one.
    velocity, spin: (N, 3) m/s, rad/s.
    stiffness, damping: (N, k, k).
    lines: Where each row stands in the text (N,).
    """

    time: Array
    position: Array | None
    turn: Array | None
    velocity: Array | None
    spin: Array | None
    stiffness: Array | None
    damping: Array | None
    lines: NDArray[np.int64]


@lru_cache(maxsize=8)
def setpoint_rows(text: str) -> SetpointRows:
    """Return the rows of a table's text, packed or not.

    Raises
    ------
    ValueError
        With line and remedy, for a table that has mistakes.
    UnreadableError
        For packed rows that are damaged.
    """
    table = timed_table(text, KNOWN, "t, x,y,z, qx..qw, rx..rz, kx.., dx..")
    time = columns(table, ("t",))
    assert time is not None
    quaternion, turn = columns(table, QUATERNION), columns(table, TURN)
    if quaternion is not None and turn is not None:
        raise ValueError("has both qx..qw and rx..rz: an orientation is given in one way; remove one")
    if quaternion is not None:
        turn = _unit(quaternion, table.lines)
    elif turn is not None:
        turn = _quaternions(turn)
    rows = SetpointRows(
        time[:, 0],
        columns(table, POSITION),
        turn,
        columns(table, VELOCITY),
        columns(table, SPIN),
        _gains(table, "k"),
        _gains(table, "d"),
        table.lines,
    )
    if all(column is None for column in rows[1:-1]):
        raise ValueError("has a column t only; needs x,y,z, an orientation or gains beside it")
    for rate, name, of, what in (
        (rows.velocity, "vx,vy,vz", rows.position, "x,y,z"),
        (rows.spin, "wx,wy,wz", rows.turn, "an orientation, qx..qw or rx..rz"),
    ):
        if rate is not None and of is None:
            raise ValueError(f"has {name} without {what}; add it, or remove {name}")
    return rows


def gain_mistake(rows: SetpointRows, size: int, free: tuple[int, ...]) -> str:
    """Return what of the gains does not fit a task of this size, free in these axes; nothing if all does."""
    for name, gains in (("k", rows.stiffness), ("d", rows.damping)):
        if gains is None:
            continue
        if gains.shape[1] != size:
            needs = ",".join(_diagonal(name, size)) + f", or {name}11..{name}{size}{size}"
            return f"has gains of {gains.shape[1]} directions; the task has {size}: needs {needs}"
        what = {"k": "K_x", "d": "D_x"}[name]
        size_of = np.abs(gains).max(axis=(1, 2))
        worst = np.abs(gains - gains.transpose(0, 2, 1)).max(axis=(1, 2))
        if (bad := np.flatnonzero(worst > SYMMETRIC * size_of)).size:
            return (
                f"line {rows.lines[bad[0]]}: {what} is not symmetric, by {worst[bad[0]]:.3g}; "
                f"needs {name}12 = {name}21 and so on"
            )
        held = [i for i in range(size) if i not in free]
        slack = gains[:, list(free)].any(axis=(1, 2)) if free else np.zeros(len(gains), dtype=bool)
        if slack.any():
            return (
                f"line {rows.lines[slack.argmax()]}: {what} is not 0 in a direction that law.stiffness leaves "
                "free; write 0 there"
            )
        least = np.linalg.eigvalsh(gains[:, held][:, :, held])[:, 0]
        if (bad := np.flatnonzero(~(least > 0))).size:
            return (
                f"line {rows.lines[bad[0]]}: {what} is not positive definite, smallest eigenvalue "
                f"{least[bad[0]]:.6g}; needs > 0 in every direction that law.stiffness holds"
            )
    return ""


def _unit(quaternion: Array, lines: NDArray[np.int64]) -> Array:
    length = np.linalg.norm(quaternion, axis=1)
    if (bad := np.flatnonzero(np.abs(length - 1) > UNIT_LENGTH)).size:
        raise ValueError(
            f"line {lines[bad[0]]}: the quaternion qx,qy,qz,qw has the length {length[bad[0]]:.4g}; divide it by "
            "its length, or use rx,ry,rz"
        )
    return np.asarray(quaternion / length[:, None])


def _quaternions(turn: Array) -> Array:
    """Return the quaternions (N, 4) of rotation vectors (N, 3)."""
    half = np.linalg.norm(turn, axis=1, keepdims=True) / 2
    return np.hstack([turn / 2 * np.sinc(half / np.pi), np.cos(half)])


def _gains(table: NumberTable, letter: str) -> Array | None:
    """Return the matrices (N, k, k) of one kind, from their diagonals or in full."""
    pattern = re.compile(rf"{letter}(?:r?[xyz]|\d\d)")
    there = [name for name in table.names if pattern.fullmatch(name)]
    if not there:
        return None
    in_full = [name for name in there if name[-1].isdigit()]
    if in_full and len(in_full) < len(there):
        raise ValueError(f"has both {there[0]} and {in_full[0]}: a matrix is given in one way; remove one")
    if in_full:
        size = 6 if any(set(name[1:]) & set("456") for name in in_full) else 3
        numbers = columns(table, _full(letter, size))
        assert numbers is not None
        return numbers.reshape(-1, size, size)
    size = 6 if any(name[1] == "r" for name in there) else 3
    numbers = columns(table, _diagonal(letter, size))
    assert numbers is not None
    return numbers[:, :, None] * np.eye(size)
