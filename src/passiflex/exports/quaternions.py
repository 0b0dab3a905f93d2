"""Rotations as unit quaternions that keep their side: q and −q are the same rotation, but not the same curve."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from passiflex.robots.bodies import Array


def quaternions(rotations: Array, beside: Array | None = None) -> Array:
    """Return the quaternions (N, 4), as x y z w, of rotations (N, 3, 3), each on the side of the one before.

    Parameters
    ----------
    beside: A quaternion on whose side the first one is; that with w ≥ 0 if None.
    """
    turns = Rotation.from_matrix(rotations).as_quat(canonical=True)
    first = turns[:1] if beside is None else np.reshape(beside, (1, 4))
    before = np.concatenate([first, turns[:-1]])
    across = np.einsum("ij,ij->i", before, turns) < 0
    return np.asarray(turns * np.where(np.cumsum(across) % 2, -1.0, 1.0)[:, None], dtype=float)
