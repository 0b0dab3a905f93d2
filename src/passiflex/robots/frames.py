"""Where the bodies of an arm are: forward kinematics in plain numbers, for many rows of q at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from passiflex.errors import SizeError
from passiflex.robots.bodies import Array, rotation_of
from passiflex.robots.chain import SerialChain


class Frames(NamedTuple):
    """Frames of base, links 1 .. n and end effector: position (N, n + 2, 3) m, rotation (N, n + 2, 3, 3)."""

    position: Array
    rotation: Array


def relative_frames(chain: SerialChain, q: Array) -> Frames:
    """Return each frame in the frame before it; the base, which is the first, in the world.

    The frame of link i is that of link i − 1, moved by (xyz, rpy) of joint i, then turned about or shifted
    along its axis by q_i. The end effector is the tip of the chain in the frame of link n.

    Parameters
    ----------
    q: Joint positions (N, n), rad or m. A row with NaN gives frames with NaN from that joint on.

    Raises
    ------
    SizeError
        If the rows of q do not have n numbers.
    """
    q = np.asarray(q, dtype=float)
    if q.ndim != 2 or q.shape[1] != chain.n:
        raise SizeError(
            "joint positions do not fit the arm", got=q.shape, needs=f"(N, {chain.n}) in rad or m"
        )
    position = np.zeros((len(q), chain.n + 2, 3))
    rotation = np.zeros((len(q), chain.n + 2, 3, 3))
    rotation[:, 0] = np.eye(3)
    for i, joint in enumerate(chain.joints):
        R, shift = rotation_of(joint.rpy), q[:, i, None]
        if joint.kind == "prismatic":
            position[:, i + 1] = joint.xyz + shift * (R @ joint.axis)
            rotation[:, i + 1] = R
        else:
            position[:, i + 1] = joint.xyz
            rotation[:, i + 1] = R @ _turns(joint.axis, q[:, i])
    position[:, -1] = chain.tip_xyz
    rotation[:, -1] = chain.tip_rotation
    return Frames(position, rotation)


def world_frames(chain: SerialChain, q: Array) -> Frames:
    """Return each frame in the world, which is the frame of the base; q as for `relative_frames`."""
    position, rotation = relative_frames(chain, q)
    for i in range(1, chain.n + 2):
        R = rotation[:, i - 1]
        position[:, i] = position[:, i - 1] + np.einsum("nij,nj->ni", R, position[:, i])
        rotation[:, i] = R @ rotation[:, i]
    return Frames(position, rotation)


def _turns(axis: Array, angle: Array) -> Array:
    """Return the rotations (N, 3, 3) by the angles (N,) about a unit axis, by Rodrigues."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    along = np.outer(axis, axis)
    c, s = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
    return c * (np.eye(3) - along) + s * cross + along
