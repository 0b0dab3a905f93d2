"""Missed periods: the mean square by Kronecker products, the maps by the loop itself, the border by simulation."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from passiflex.errors import UnstableLoopError
from passiflex.simulation import resolve, simulate
from passiflex.stability.judgement import judge
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.missed import _certified, dies_out, gaps, stationary
from passiflex.stability.timing import Timing
from worlds import world

LIGHT: dict[str, Any] = {
    "law": {"shaped_inertia": {"ratio": 0.06}, "gravity": "robot"},
    "control": {"inner_loop": "matched", "external_torque": "none", "delay": 1e-3},
    "sensors": {"velocity": "differences", "velocity_filter": 200},
}


@lru_cache
def loop() -> LinearLoop:
    return LinearLoop(resolve(world(**LIGHT)))


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 4), st.integers(1, 4), st.integers(0, 2**32 - 1), st.floats(0.3, 1.5))
def test_the_certificate_says_what_the_kronecker_product_says(
    n: int, count: int, seed: int, size: float
) -> None:
    rng = np.random.default_rng(seed)
    maps, chances = rng.normal(size=(count, n, n)), rng.uniform(0.1, 1, count)
    chances /= chances.sum()
    whole = sum(p * np.kron(A, A) for p, A in zip(chances, maps, strict=True))
    radius = np.abs(np.linalg.eigvals(whole)).max()
    maps *= np.sqrt(size / radius)  # now the mean square grows by `size`
    if abs(size - 1) > 0.02:
        mean = np.tensordot(chances, maps, 1)
        stable = bool(np.abs(np.linalg.eigvals(mean)).max() < 1) and _certified(maps, chances)
        assert stable == (size < 1)


def test_a_stationary_covariance_is_reproduced_by_its_map() -> None:
    rng = np.random.default_rng(1)
    A = rng.normal(size=(5, 5))
    A *= 0.97 / np.abs(np.linalg.eigvals(A)).max()
    P = stationary(A, np.eye(5))
    np.testing.assert_allclose(P, A @ P @ A.T + np.eye(5), rtol=1e-9)


def test_without_missed_periods_the_map_has_the_loops_own_eigenvalues() -> None:
    maps, chances = gaps(loop(), 0.0)
    assert chances.tolist() == [1.0]
    ours = np.abs(np.linalg.eigvals(maps[0]))
    for value in np.abs(np.linalg.eigvals(loop().matrix())):
        if value > 0.3:  # below are poles of filters that the matched loop does not read
            assert np.abs(ours - value).min() < 1e-6


def test_a_missed_period_is_the_plant_under_the_last_command() -> None:
    """From a push: two periods in which the law does not run, by the matrix exponential under one torque."""
    import scipy.linalg

    here = loop()
    timing = Timing.of(1e-3, 0.0, least=1)
    z = np.zeros(here.flow(timing).shape[0])
    x0, tau = np.random.default_rng(2).normal(size=8), np.array([3.0, -2.0])
    z[:8], z[-2:] = x0, tau
    for _ in range(2):
        z = here.flow(timing) @ here.misses(timing) @ z
    block = np.zeros((10, 10))
    block[:8] = here.plant
    expected = scipy.linalg.expm(2e-3 * block) @ np.concatenate([x0, tau])
    np.testing.assert_allclose(z[:8], expected[:8], rtol=1e-9)
    np.testing.assert_array_equal(z[-2:], tau)


def test_the_border_is_where_simulations_begin_to_grow() -> None:
    """Below it a push dies out for every seed; well above it motion is thrown up again and again."""
    shares = np.linspace(0.05, 0.85, 17)
    held = [dies_out(loop(), float(s)) for s in shares]
    border = int(np.argmin(held))
    assert 0 < border < len(shares)
    assert not any(held[border:])
    below, above = shares[border - 1] - 0.05, min(shares[border] + 0.25, 0.9)
    changes = LIGHT | {
        "reference": [],
        "forces": [{"from": 0, "to": 0.01, "force": [5, 0, 3]}],
        "duration": 3.0,
    }
    speeds = []
    for share in (below, above):
        control = LIGHT["control"] | {"missed": float(share), "allow_unstable": True}
        runs = [simulate(world(**changes | {"control": control, "tank": None, "seed": k})) for k in range(4)]
        speeds.append([np.abs(run["dq"][-1000:]).max() if not run.failure else np.inf for run in runs])
    assert max(speeds[0]) < 1e-3
    assert max(speeds[1]) > 0.05


def test_the_judge_refuses_what_misses_too_much_and_says_how_much_holds() -> None:
    control = LIGHT["control"] | {"missed": 0.85}
    scenario = world(**LIGHT | {"control": control})
    found = judge(resolve(scenario))
    assert not found.stable
    assert found.spectrum.stable
    assert found.missed == 0.85
    with pytest.raises(
        UnstableLoopError, match=r"periods that are missed let a torque act.*\n.*85 % of the"
    ) as error:
        simulate(scenario)
    assert "% of the periods missed (now 85 %)" in str(error.value)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_an_iteration_that_leaves_the_numbers_certifies_nothing() -> None:
    """A remedy that is tried may make the map huge: the answer is no, and no error of an eigenvalue routine."""
    assert not _certified(np.full((2, 3, 3), 1e200), np.array([0.5, 0.5]))
