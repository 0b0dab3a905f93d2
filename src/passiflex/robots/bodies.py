"""Rigid bodies and frames as plain numbers: rotate, move, lump and check them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from passiflex.errors import RobotError

Array = NDArray[np.float64]

PRINTED = 1e-3
"""Share by which moments may miss the triangle inequality, as they do when they are printed with few digits."""
ROUND_OFF = 1e-12
"""A principal moment below this fraction of the largest one counts as zero."""


class Body(NamedTuple):
    """The inertia of one moving link: mass [kg], com (3,) [m] in the link frame, inertia (6,) [kg m²].

    `inertia` holds Ixx, Ixy, Ixz, Iyy, Iyz, Izz at the centre of mass, in link axes.
    """

    mass: float
    com: Array
    inertia: Array


class Placement(NamedTuple):
    """Position and orientation of a frame in the frame of its moving link."""

    xyz: Array
    rotation: Array


HERE = Placement(np.zeros(3), np.eye(3))
for _array in HERE:
    _array.setflags(write=False)


def rotation_of(rpy: Array) -> Array:
    """Return Rz(yaw) Ry(pitch) Rx(roll)."""
    return Rotation.from_euler("xyz", rpy).as_matrix()


def rpy_of(R: Array) -> Array:
    """Return roll, pitch and yaw of R; accurate, though not unique, at a pitch of ±90 degrees too."""
    yaw = np.arctan2(R[1, 0], R[0, 0])
    c, s = np.cos(yaw), np.sin(yaw)
    roll = np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return np.array([roll, np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0])), yaw])


def matrix(six: Array) -> Array:
    """Return the symmetric matrix of Ixx, Ixy, Ixz, Iyy, Iyz, Izz."""
    xx, xy, xz, yy, yz, zz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def components(tensor: Array) -> Array:
    """Return Ixx, Ixy, Ixz, Iyy, Iyz, Izz of a symmetric matrix."""
    return tensor[np.triu_indices(3)]


def turned(body: Body, pose: Placement) -> Body:
    """Return a body, given in the frame at `pose`, in the frame in which `pose` is given."""
    R = pose.rotation
    return Body(body.mass, pose.xyz + R @ body.com, components(R @ matrix(body.inertia) @ R.T))


def lumped(parts: list[Body]) -> Body:
    """Return parts that move together as one body: masses add, inertias by the parallel-axis theorem."""
    mass = sum(part.mass for part in parts)
    if len(parts) == 1 or not mass > 0:
        return parts[0]
    com = sum((part.mass * part.com for part in parts), np.zeros(3)) / mass
    tensor = np.zeros((3, 3))
    for part in parts:
        d = part.com - com
        tensor += matrix(part.inertia) + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return Body(mass, com, components(tensor))


def about_origin(body: Body) -> Array:
    """Return Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the origin of the link's frame, link axes."""
    d = body.com
    return components(matrix(body.inertia) + body.mass * (d @ d * np.eye(3) - np.outer(d, d)))


def from_origin(mass: float, moment: Array, inertia: Array) -> Body:
    """Return a body by its mass, mass times centre of mass, and inertia about the origin as `about_origin` has it."""
    com = moment / mass
    shift = moment @ com * np.eye(3) - np.outer(moment, com)
    return Body(mass, com, components(matrix(inertia) - shift))


def triangle_defect(body: Body, tolerance: float = ROUND_OFF) -> str | None:
    """Return in which way no distribution of mass has the principal moments of a body, None where one can."""
    a, b, c = np.linalg.eigvalsh(matrix(body.inertia))
    return f"{a:.4g} + {b:.4g} < {c:.4g} kg m^2" if a + b < c * (1 - tolerance) else None


def check_body(where: str, body: Body, *, whole: bool) -> None:
    """Refuse a negative mass or inertia, and zero ones too if the body is all that a joint moves."""
    if body.mass < 0 or (whole and not body.mass > 0):
        what = f"the mass of {where} is not positive"
        raise RobotError(what, got=f"{body.mass:g} kg", needs="more than 0 kg")
    moments = np.linalg.eigvalsh(matrix(body.inertia))
    floor = ROUND_OFF * np.abs(moments).max()
    if moments[0] < -floor or (whole and not moments[0] > floor):
        what = f"the inertia of {where} is not positive definite"
        got = f"principal moments {', '.join(f'{m:.4g}' for m in moments)} kg m^2"
        raise RobotError(what, got=got, needs="three positive moments")
