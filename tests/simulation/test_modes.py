"""Modes of maps that are put together from known ones: what grows, what trembles, and what only drifts."""

from __future__ import annotations

import numpy as np
import pytest

from passiflex.stability.modes import Modes, coupled, projector

T = 1e-3
TASK = np.array([[1.0, 1.0, 0.0]])
"""One wish of three joints: two self-motions."""


def turned(values: list[complex], vectors: list[list[float]], seed: int = 0) -> np.ndarray:
    """Return a real map with these modes; each vector begins with its q (3,), the rest is random."""
    rng = np.random.default_rng(seed)
    columns, blocks = [], []
    for value, q in zip(values, vectors, strict=True):
        for _ in range(2 if value.imag else 1):
            columns.append(np.concatenate([q, rng.normal(size=5)]))
        a, b = value.real, value.imag
        blocks.append(np.array([[a, b], [-b, a]]) if b else np.array([[a]]))
    size = sum(len(b) for b in blocks)
    D, at = np.zeros((size, size)), 0
    for block in blocks:
        D[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    V = np.array(columns).T
    V = np.hstack([V, rng.normal(size=(8, 8 - size))]) if size < 8 else V
    whole = np.zeros((8, 8))
    whole[:size, :size] = D
    return V @ whole @ np.linalg.inv(V)


HIDDEN, SEEN = [1.0, -1.0, 0.3], [1.0, 0.5, 0.0]


@pytest.mark.parametrize("growth", [0.0, 0.08, 0.5])
def test_a_self_motion_that_nothing_holds_drifts_whatever_its_slow_growth(growth: float) -> None:
    modes = Modes.of(turned([np.exp(growth * T), 0.9], [HIDDEN, SEEN]), T, TASK)
    found = modes.dominant(3, np.ones(6))
    assert found.stable
    assert found.radius == pytest.approx(0.9)
    assert found.drifting == 1
    assert found.drift == pytest.approx(growth, abs=1e-6)


def test_a_motion_of_the_task_that_grows_as_slowly_is_an_instability() -> None:
    matrix = turned([np.exp(0.08 * T), 0.9], [SEEN, HIDDEN])
    assert Modes.radius_of(matrix, T, TASK) == pytest.approx(np.exp(0.08 * T), rel=1e-9)
    assert not Modes.of(matrix, T, TASK).dominant(3, np.ones(6)).stable


def test_a_self_motion_that_grows_fast_or_flutters_is_an_instability() -> None:
    for value in (np.exp(5 * T), np.exp((0.5 + 40j) * T)):
        matrix = turned([value, 0.9], [HIDDEN, SEEN])
        assert Modes.radius_of(matrix, T, TASK) == pytest.approx(abs(value), rel=1e-9)


def test_an_arm_without_self_motions_has_no_drift() -> None:
    matrix = turned([1.0, 0.9], [HIDDEN, SEEN])
    assert Modes.radius_of(matrix, T, np.eye(3)) == pytest.approx(1.0)


@pytest.mark.parametrize(("seen", "drifts"), [(3e-5, True), (0.05, False)])
def test_next_to_a_stretched_elbow_there_is_a_self_motion(seen: float, drifts: bool) -> None:
    """Joint 3 moves the task by a share of what joint 1 does: 1.5e-4 rad from the singularity that is 3e-5."""
    matrix = turned([np.exp(0.002 * T), 0.9], [[0.0, 0.0, 1.0], [1.0, 0.5, 0.0]])
    modes = Modes.of(matrix, T, np.diag([1.1, 0.7, seen]))
    assert modes.dominant(3, np.ones(6)).stable is drifts


def test_a_double_eigenvalue_is_drift_twice() -> None:
    """Where nothing damps: position and velocity of the self-motion, a Jordan block that round-off tears apart."""
    rng = np.random.default_rng(2)
    V = rng.normal(size=(8, 8))
    V[:3, 0] = V[:3, 1] = HIDDEN
    D = np.diag([1.0, 1.0, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3])
    D[0, 1] = T
    matrix = V @ D @ np.linalg.inv(V)
    assert Modes.of(matrix, T, TASK).drifting.sum() == 2
    assert Modes.radius_of(matrix, T, TASK) == pytest.approx(0.8, rel=1e-9)


def test_what_trembles_counts_as_if_it_were_to_die_out_faster() -> None:
    """20 Hz and 1 Hz: the slow one only matters if it does not die out."""
    fast, slow = np.exp((-3 + 126j) * T), np.exp((-0.1 + 6j) * T)
    matrix = turned([fast, slow], [SEEN, SEEN], seed=1)
    assert Modes.trembling_of(matrix, T, np.eye(3), 0.0) == pytest.approx(abs(fast), rel=1e-9)
    assert Modes.trembling_of(matrix, T, np.eye(3), 2.0) < 1 < Modes.trembling_of(matrix, T, np.eye(3), 4.0)
    growing = turned([fast, np.exp((0.1 + 6j) * T)], [SEEN, SEEN], seed=1)
    assert Modes.trembling_of(growing, T, np.eye(3), 0.0) > 1


def test_coordinates_that_nobody_reads_are_taken_out_with_their_own_eigenvalue() -> None:
    matrix = np.array(
        [[0.5, 0.2, 0.0, 0.0], [0.1, 0.6, 0.0, 0.0], [1.0, 0.0, 0.3, 0.0], [0.0, 0.0, 2.0, 0.0]]
    )
    kept, alone = coupled(matrix)
    assert kept.tolist() == [0, 1]
    assert sorted(alone) == [0.0, 0.3]
    values = np.concatenate([np.linalg.eigvals(matrix[:2, :2]), alone])
    np.testing.assert_allclose(sorted(values), sorted(np.linalg.eigvals(matrix)), atol=1e-12)


def test_the_projector_takes_out_what_it_is_told_and_nothing_near_it() -> None:
    rng = np.random.default_rng(5)
    V, values = rng.normal(size=(6, 6)), np.array([1.0, 1.0, 1 - 1e-5, 0.5, -0.4, 0.2])
    D = np.diag(values)
    D[0, 1] = 0.01
    A = V @ D @ np.linalg.inv(V)
    P = projector(A, np.ones(2))
    np.testing.assert_allclose(P @ P, P, atol=1e-8)
    np.testing.assert_allclose(A @ P, P @ A, atol=1e-7)
    rest = np.linalg.eigvals(A @ (np.eye(6) - P))
    np.testing.assert_allclose(np.sort(np.abs(rest)), [0, 0, 0.2, 0.4, 0.5, 1 - 1e-5], atol=1e-7)
