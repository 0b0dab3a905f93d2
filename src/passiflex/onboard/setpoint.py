"""What is asked of a controller on a robot: where to be, how stiff, with what force. Checked when it is made."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from passiflex.errors import SizeError, ValueRangeError

Array = NDArray[np.float64]

ROUND = 1e-6
"""By how much a matrix may miss symmetry or rotation, as share of its largest entry: of numbers that were printed."""

NEARLY = 1e-3
"""By how much a rotation may be none before it is refused; what is less is mended."""
SIZES = (3, 6)
STIFFEST = 1e9
"""Largest entry of a gain [N/m, N s/m, N m/rad, N m s/rad]: what is more is a mistake."""
EYE = np.eye(3)


@dataclass(frozen=True, eq=False)
class Setpoint:
    """One setpoint; what is left out stays as it was, velocity, acceleration and wrench are 0.

    Attributes
    ----------
    position: Of the end effector in world axes (3,) m.
    rotation: Its axes as columns (3, 3), or a quaternion x, y, z, w.
    velocity, acceleration: Of the reference, linear part first (6,).
    stiffness: K_x, symmetric and not negative, (k, k), or its diagonal (k,); k is 3 or 6.
    damping: D_x, likewise.
    wrench: That the end effector is to exert (6,) N and N m, behind the tank's valve.
    posture: Toward which the self-motion is drawn (n,) rad.

    Raises
    ------
    SizeError, ValueRangeError
        For numbers of another shape, that are not finite, or no such matrices.
    """

    position: ArrayLike | None = None
    rotation: ArrayLike | None = None
    velocity: ArrayLike | None = None
    acceleration: ArrayLike | None = None
    stiffness: ArrayLike | None = None
    damping: ArrayLike | None = None
    wrench: ArrayLike | None = None
    posture: ArrayLike | None = None

    def __post_init__(self) -> None:
        """Check the numbers, and keep them as arrays."""
        for name in ("position", "velocity", "acceleration", "wrench", "posture"):
            self._keep(name, _numbers(name, getattr(self, name)))
        for name, size in (("position", 3), ("velocity", 6), ("acceleration", 6), ("wrench", 6)):
            value = getattr(self, name)
            if value is not None and value.shape != (size,):
                raise SizeError(f"{name} of a setpoint", got=value.shape, needs=f"shape ({size},)")
        self._keep("rotation", _rotation(_numbers("rotation", self.rotation)))
        for name in ("stiffness", "damping"):
            self._keep(name, _gain(name, _numbers(name, getattr(self, name))))

    def _keep(self, name: str, value: Array | None) -> None:
        object.__setattr__(self, name, value)


def _numbers(name: str, value: ArrayLike | None) -> Array | None:
    if value is None:
        return None
    try:
        numbers = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueRangeError(f"{name} of a setpoint", got=repr(value), needs="numbers") from error
    if not np.isfinite(numbers).all():
        raise ValueRangeError(f"{name} of a setpoint", got=numbers.tolist(), needs="finite numbers")
    return numbers


def _rotation(value: Array | None) -> Array | None:
    """Return the nearest rotation of a matrix that almost is one, or that of a quaternion."""
    if value is None:
        return None
    if value.shape == (4,) and np.abs(value).max() <= 1 + NEARLY:
        length = math.sqrt(value @ value)
        if abs(length - 1) > NEARLY:
            raise ValueRangeError(
                "rotation of a setpoint", got=f"a quaternion of length {length:.4g}", needs="length 1"
            )
        return np.asarray(Rotation.from_quat(value).as_matrix())
    if value.shape == (4,):
        raise ValueRangeError("rotation of a setpoint", got=value.tolist(), needs="a quaternion of length 1")
    if value.shape != (3, 3):
        raise SizeError("rotation of a setpoint", got=value.shape, needs="(3, 3), or a quaternion x, y, z, w")
    small = np.abs(value).max() <= 1 + NEARLY  # what is not would overflow
    (a, b, c), (d, e, f), (g, h, i) = value.tolist()
    right_handed = small and a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0
    off = value.T @ value - EYE if small else EYE
    if np.abs(off).max() > NEARLY or not right_handed:
        raise ValueRangeError("rotation of a setpoint", got=value.tolist(), needs="orthonormal, right-handed")
    once = value - value @ off / 2  # toward the polar factor, each time with the square of what is missing
    return np.asarray(once - once @ (once.T @ once - EYE) / 2)


def _gain(name: str, value: Array | None) -> Array | None:
    """Return a gain as a matrix."""
    if value is None:
        return None
    if value.size and np.abs(value).max() > STIFFEST:
        raise ValueRangeError(f"{name} of a setpoint", got=value.tolist(), needs=f"at most {STIFFEST:g}")
    if value.ndim == 1 and len(value) in SIZES and (value >= 0).all():
        return np.diag(value)
    matrix = np.diag(value) if value.ndim == 1 else value
    if matrix.shape not in ((3, 3), (6, 6)):
        raise SizeError(f"{name} of a setpoint", got=value.shape, needs="(3,), (6,), (3, 3) or (6, 6)")
    size = np.abs(matrix).max()
    if np.abs(matrix - matrix.T).max() > ROUND * size:
        raise ValueRangeError(f"{name} of a setpoint", got=value.tolist(), needs="a symmetric matrix")
    even = (matrix + matrix.T) / 2
    try:  # a tenth of the time of the eigenvalues, which are needed for the words only
        np.linalg.cholesky(even + 2 * ROUND * (size or 1) * np.eye(len(even)))
    except np.linalg.LinAlgError:
        least = float(np.linalg.eigvalsh(even)[0])
        raise ValueRangeError(
            f"{name} of a setpoint", got=f"least eigenvalue {least:.4g}", needs="none below 0"
        ) from None
    return np.asarray(even)
