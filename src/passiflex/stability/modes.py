"""The modes of a sampled loop: how fast each grows or dies, which joint moves in it, and which of them only drift."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

HELD = 1e-6
"""A self-motion whose eigenvalue is further below 1 than this dies out: something holds or damps it."""
DRIFT_RATE = 1.0
"""[1/s] A self-motion that changes more slowly than this drifts; a faster one is a mode like any other."""
DRIFT_SHARE = 0.1
"""Largest motion of the task, as a share of what the joints could make of it, in a self-motion."""
UNSEEN = 1e-3
"""Singular value of the task's Jacobian below which a motion is one of the arm in itself, as at a stretched elbow."""
TREMBLING = 5.0
"""[Hz] A motion that is faster is no task's: it trembles."""
SHIFT = 1e-9
"""By which inverse iteration misses an eigenvalue, so that there is something to invert."""
SAME = 1e-6
"""Two eigenvalues closer than this are one."""
ROUND_OFF = 1e-14
"""An entry of a matrix below this is none."""


class Spectrum(NamedTuple):
    """The slowest to decay, or fastest to grow, of the loop's modes.

    Attributes
    ----------
    radius: Largest |eigenvalue| over one period, drift left out; stable below 1.
    frequency: Of that mode [Hz].
    joint: Number of the joint that moves most in it, from 1.
    decay: Its decay rate [1/s], negative if it grows.
    drifting: Number of self-motions that nothing holds; those that nothing damps count twice.
    drift: Growth rate of the fastest of them [1/s]; 0 up to round-off where they just go on.
    undamped: Whether one of them goes on when pushed, as nothing damps it.
    link_share: Share of the links in the kinetic energy of the mode; the motors have the rest.
    """

    radius: float
    frequency: float
    joint: int
    decay: float
    drifting: int
    drift: float = 0.0
    undamped: bool = False
    link_share: float = 0.0

    @property
    def stable(self) -> bool:
        """Return whether every mode decays; drift is no instability."""
        return self.radius < 1


@dataclass(frozen=True, eq=False)
class Modes:
    """Eigenvalues (N,) of a period's map, its eigenvectors (N, N), which of them drift (N,), and how many may."""

    values: NDArray[Any]
    vectors: NDArray[Any]
    drifting: Flags
    period: float
    free: int

    @classmethod
    def of(cls, matrix: Array, period: float, task_jacobian: Array) -> Modes:
        """Return the modes of a map whose first coordinates are q."""
        values, vectors = np.linalg.eig(matrix)
        drifting = self_motion(values, vectors, period, task_jacobian)
        return cls(values, vectors, drifting, period, self_motions(task_jacobian))

    @staticmethod
    def radius_of(matrix: Array, period: float, task_jacobian: Array) -> float:
        """Return the largest |eigenvalue| that is no drift; vectors are made only of what may drift."""
        return float(np.abs(lasting(matrix, period, task_jacobian)).max(initial=0.0))

    @staticmethod
    def stable_of(matrix: Array, period: float, task_jacobian: Array) -> bool:
        """Return whether `radius_of` is below 1; drift is looked for only where nothing else has decided."""
        kept, alone = coupled(matrix)
        tight = matrix[np.ix_(kept, kept)]
        values = np.linalg.eigvals(tight)
        out = values[~(np.abs(values) < 1)]
        if (~(np.abs(alone) < 1)).any() or (~lingers(out, period)).any():
            return False
        return bool(drift_of(tight, out, period, task_jacobian).all())

    @staticmethod
    def trembling_of(matrix: Array, period: float, task_jacobian: Array, settling: float) -> float:
        """Return the largest |eigenvalue| of what trembles, or of a slower motion that does not die out.

        Below 1 whatever trembles dies out at a rate of `settling` [1/s] or faster, and the rest dies out.
        """
        values = lasting(matrix, period, task_jacobian)
        sizes, fast = np.abs(values), trembles(values, period)
        slow = float(sizes[~fast].max(initial=0.0))
        quick = float(sizes[fast].max(initial=0.0)) * math.exp(settling * period)
        return max(slow, quick) if slow >= 1 else quick

    def dominant(self, n: int, inertia: Array, within: Sequence[Array] = ()) -> Spectrum:
        """Return the mode that matters; `inertia` (2n,) is that of links and motors.

        `within` are the maps that make up this one, by which a motion is seen that is faster than half a turn in it.
        """
        kept = np.flatnonzero(~self.drifting)
        worst = kept[np.argmax(np.abs(self.values[kept]))]
        modulus, vector = abs(self.values[worst]), np.abs(self.vectors[: 2 * n, worst])
        angle = float(np.angle(self.values[worst]))
        if (
            len(within) > 1
        ):  # of the angles that the eigenvalue allows, the one that the mode is seen to turn by
            turns = (_turned(self.vectors[:, worst], within, 2 * n) - angle) / (2 * math.pi)
            angle += 2 * math.pi * round(turns)
        energy = inertia * vector**2  # its speeds are the rate of the mode times these
        drift = np.log(np.maximum(np.abs(self.values[self.drifting]), HELD)) / self.period
        return Spectrum(
            radius=float(modulus),
            frequency=abs(angle) / (2 * math.pi * self.period),
            joint=int(np.argmax(vector[:n] + vector[n:])) + 1,
            decay=-math.log(max(modulus, 1e-300)) / self.period,
            drifting=int(self.drifting.sum()),
            drift=float(drift.max(initial=0.0)),
            undamped=int(self.drifting.sum()) > self.free,
            link_share=float(energy[:n].sum() / max(energy.sum(), 1e-300)),
        )


def _turned(vector: NDArray[Any], maps: Sequence[Array], positions: int) -> float:
    """Return about the angle by which the positions of a mode turn in all, map by map."""
    angle = 0.0
    for each in maps:
        after = each @ vector
        angle += float(np.angle(np.vdot(vector[:positions], after[:positions])))
        vector = after
    return angle


def lasting(matrix: Array, period: float, task_jacobian: Array) -> NDArray[Any]:
    """Return the eigenvalues of a map that are no drift."""
    kept, alone = coupled(matrix)
    tight = matrix[np.ix_(kept, kept)]
    values = np.linalg.eigvals(tight)
    return np.concatenate([values[~drift_of(tight, values, period, task_jacobian)], alone])


def trembles(values: NDArray[Any], period: float) -> Flags:
    """Return which eigenvalues are of motions faster than `TREMBLING`."""
    return np.asarray(np.abs(np.angle(values)) > 2 * math.pi * TREMBLING * period)


def drift_of(matrix: Array, values: NDArray[Any], period: float, task_jacobian: Array) -> Flags:
    """Return which eigenvalues of a map are drift, with the vectors of those alone that may be."""
    flags = np.zeros(values.size, dtype=bool)
    slow = np.flatnonzero(lingers(values, period)) if _redundant(task_jacobian) else np.zeros(0, dtype=int)
    if slow.size:
        vectors = np.stack([_vector(matrix, values[i]) for i in slow], axis=1)
        flags[slow] = self_motion(values[slow], vectors, period, task_jacobian)
    return flags


def projector(matrix: Array, values: NDArray[Any]) -> Array:
    """Return the spectral projector (N, N) on some eigenvalues of a map: by an ordered Schur form."""

    def chosen(re: float, im: float) -> bool:
        return bool(np.abs(values - complex(re, im)).min() < SAME)

    T, Z, k = scipy.linalg.schur(matrix, output="real", sort=chosen, check_finite=False)
    # T (I Y; 0 I) = (I Y; 0 I) diag(T₁₁, T₂₂) if T₁₁ Y − Y T₂₂ = −T₁₂.
    Y = scipy.linalg.solve_sylvester(T[:k, :k], -T[k:, k:], -T[:k, k:])
    return np.asarray(Z[:, :k] @ np.hstack([np.eye(k), -Y]) @ Z.T)


def self_motion(values: NDArray[Any], vectors: NDArray[Any], period: float, task_jacobian: Array) -> Flags:
    """Return which modes are self-motions that nothing holds: slow, not dying out, and without motion of the task.

    The end effector does not see them, so that no impedance can hold them. Where an arm has no self-motion there
    is none; next to a singularity it has.
    """
    n = task_jacobian.shape[1]
    flags = np.zeros(values.size, dtype=bool)
    if not _redundant(task_jacobian):
        return flags
    reach = np.linalg.norm(task_jacobian, 2)
    slow = np.flatnonzero(lingers(values, period))
    q = vectors[:n, slow]
    share = np.linalg.norm(task_jacobian @ q, axis=0) / np.maximum(reach * np.linalg.norm(q, axis=0), 1e-300)
    flags[slow] = share < DRIFT_SHARE
    return flags


def lingers(values: NDArray[Any], period: float) -> Flags:
    """Return which eigenvalues are of motions that last and hardly move: drift, or what looks like it."""
    rate = np.abs(np.log(np.where(values == 0, 1e-300, values).astype(complex))) / period
    return (np.abs(values) > 1 - HELD) & (rate < DRIFT_RATE)


def _vector(matrix: Array, value: complex) -> NDArray[Any]:
    """Return an eigenvector of this eigenvalue by inverse iteration."""
    near = value + 1j * SHIFT if value.imag else value.real + SHIFT
    shifted = scipy.linalg.lu_factor(matrix - near * np.eye(len(matrix)), check_finite=False)
    vector = np.ones(len(matrix), dtype=np.result_type(near))
    for _ in range(3):
        vector = scipy.linalg.lu_solve(shifted, vector, check_finite=False)
        vector /= np.linalg.norm(vector)
    return vector


def _redundant(task_jacobian: Array) -> bool:
    wishes, n = task_jacobian.shape
    return wishes < n or self_motions(task_jacobian) > 0


def self_motions(task_jacobian: Array) -> int:
    """Return how many motions of the joints the task does not see."""
    return task_jacobian.shape[1] - int(np.linalg.matrix_rank(task_jacobian, tol=UNSEEN))


class Coupled(NamedTuple):
    """Which coordinates of a map are coupled, and the eigenvalues of those that stand alone."""

    kept: NDArray[np.intp]
    alone: Array


def coupled(matrix: Array) -> Coupled:
    """Return the coordinates that others read and write; one that none does has its own entry as eigenvalue."""
    linked = np.abs(matrix) >= ROUND_OFF
    np.fill_diagonal(linked, False)
    coupled = np.ones(len(matrix), dtype=bool)
    while True:
        single = coupled & ~(linked.any(axis=0) & linked.any(axis=1))
        if not single.any():
            return Coupled(np.flatnonzero(coupled), np.diag(matrix)[~coupled])
        coupled &= ~single
        linked[single], linked[:, single] = False, False
