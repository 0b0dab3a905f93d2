"""Draws: distributed as asked for, and the same whichever samples are drawn, in which order, and of how many."""

import sys
import warnings
from importlib import resources

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from passiflex.campaigns import Campaign, columns, draws
from passiflex.campaigns.draws import scenario_seed, words
from passiflex.errors import ValueRangeError
from passiflex.simulation import load_scenario

FIG1 = load_scenario(str(resources.files("passiflex") / "studies" / "scenarios" / "fig1_sampled.yaml"))
PARAMETERS = {
    "model_errors.joint_stiffness": {"distribution": "uniform", "low": "-50 %", "high": "50 %"},
    "model_errors.motor_inertia": {
        "distribution": "normal",
        "mean": 0,
        "deviation": 0.2,
        "low": -0.3,
        "high": 0.6,
    },
    "noise.torque_variance": {"distribution": "log_uniform", "low": 0.01, "high": 1},
    "control.delay": {"distribution": "choice", "values": ["0 ms", "1 ms", "2 ms"], "weights": [1, 3, 4]},
    "control.inner_loop": {"distribution": "choice", "values": ["plain", "matched"]},
    "motors.coulomb_friction": {"distribution": "uniform", "low": 0, "high": 1, "per": "joint"},
}
SAMPLINGS = ("random", "latin_hypercube", "sobol")


def campaign(**changes) -> Campaign:
    given = {"name": "c", "scenario": FIG1, "samples": 1024, "seed": 7, "parameters": PARAMETERS}
    return Campaign(**(given | changes))


CAMPAIGNS = {sampling: campaign(sampling=sampling) for sampling in SAMPLINGS}
ALL = {sampling: draws(c, range(c.samples)) for sampling, c in CAMPAIGNS.items()}


def test_columns_are_the_paths_and_one_for_each_joint():
    assert columns(CAMPAIGNS["random"]) == (
        *list(PARAMETERS)[:-1],
        *(f"motors.coulomb_friction.{i}" for i in range(1, 8)),
    )
    assert words(CAMPAIGNS["random"]) == {"control.inner_loop": ("plain", "matched")}


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_draws_are_distributed_as_asked_for(sampling):
    x = ALL[sampling].T
    for values, oracle in (
        (x[0], stats.uniform(-0.5, 1.0)),
        (x[1], stats.truncnorm(-1.5, 3.0, 0.0, 0.2)),
        (x[2], stats.loguniform(0.01, 1.0)),
        *((friction, stats.uniform()) for friction in x[5:]),
    ):
        assert stats.kstest(values, oracle.cdf).pvalue > 0.01
    for values, expected, shares in (
        (x[3], [0.0, 0.001, 0.002], [1 / 8, 3 / 8, 1 / 2]),
        (x[4], [0.0, 1.0], [1 / 2, 1 / 2]),
    ):
        found, counts = np.unique(values, return_counts=True)
        np.testing.assert_array_equal(found, expected)
        assert stats.chisquare(counts, len(values) * np.array(shares)).pvalue > 0.01


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_columns_are_independent(sampling):
    ranks = stats.spearmanr(np.delete(ALL[sampling], (3, 4), axis=1)).statistic
    off = ranks[~np.eye(len(ranks), dtype=bool)]
    assert np.abs(off).max() < 4 / np.sqrt(1024)  # four standard deviations of independent ranks


@pytest.mark.parametrize("sampling", SAMPLINGS)
@settings(max_examples=25, deadline=None)
@given(indices=st.lists(st.integers(0, 1023), max_size=5))
def test_a_draw_does_not_depend_on_what_else_is_drawn(sampling, indices):
    np.testing.assert_array_equal(draws(CAMPAIGNS[sampling], indices), ALL[sampling][indices])


@pytest.mark.parametrize("sampling", ["random", "sobol"])
@pytest.mark.parametrize("samples", [1, 100, 3000])
def test_another_number_of_samples_keeps_the_first_ones(sampling, samples):
    other = campaign(sampling=sampling, samples=samples)
    shared = min(samples, 1024)
    np.testing.assert_array_equal(draws(other, range(shared)), ALL[sampling][:shared])


def test_parameters_listed_later_do_not_change_random_draws():
    fewer = campaign(parameters=dict(list(PARAMETERS.items())[:3]))
    np.testing.assert_array_equal(draws(fewer, range(50)), ALL["random"][:50, :3])


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_another_seed_gives_other_draws(sampling):
    other = draws(campaign(sampling=sampling, seed=8), range(50))
    assert not np.any(np.all(other == ALL[sampling][:50], axis=1))


@pytest.mark.parametrize("samples", [1, 7, 100])
def test_a_latin_hypercube_has_one_draw_in_each_part(samples):
    c = campaign(sampling="latin_hypercube", samples=samples)
    x = draws(c, range(samples))
    for u in (x[:, 0] + 0.5, np.log10(x[:, 2]) / 2 + 1, *x[:, 5:].T):
        np.testing.assert_array_equal(np.sort(np.floor(u * samples)), np.arange(samples))


def test_a_power_of_two_of_sobol_points_has_one_draw_in_each_part():
    for count in (16, 256, 1024):
        parts = np.floor((ALL["sobol"][:count, 0] + 0.5) * count)
        np.testing.assert_array_equal(np.sort(parts), np.arange(count))


def test_no_number_of_sobol_points_warns():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for indices in ([0], [0, 1], [1], [2, 5], range(7), [700]):
            assert draws(CAMPAIGNS["sobol"], indices).shape == (len(indices), 12)


def test_seeds_are_different_reproducible_and_independent_of_the_parameters():
    seeds = [scenario_seed(CAMPAIGNS["random"], i) for i in range(500)]
    assert len(set(seeds)) == 500
    assert all(0 <= s < 2**53 and float(s) == s for s in seeds)
    for other in (campaign(parameters={}), campaign(samples=600), *CAMPAIGNS.values()):
        assert [scenario_seed(other, i) for i in range(500)] == seeds
    assert stats.kstest(np.array(seeds) / 2**53, "uniform").pvalue > 0.01
    assert scenario_seed(campaign(seed=8), 0) != seeds[0]


def test_a_campaign_without_parameters_has_no_columns():
    for sampling in SAMPLINGS:
        assert draws(campaign(parameters={}, sampling=sampling), [3, 1]).shape == (2, 0)


@pytest.mark.parametrize("wrong", [[-1], [1024], [0.5], [[1]], [True]])
def test_an_index_is_that_of_a_sample(wrong):
    with pytest.raises(ValueRangeError, match="needs a list of whole numbers from 0 to 1023"):
        draws(CAMPAIGNS["random"], wrong)


def test_a_latin_hypercube_that_workers_cannot_hold_is_refused_for_any_sample():
    c = campaign(sampling="latin_hypercube", samples=10**6)
    with pytest.raises(
        ValueRangeError, match=r"got 1000000 samples of 12 columns; needs at most 10000000 .*; try .* sobol"
    ):
        draws(c, [0])
    assert draws(campaign(sampling="sobol", samples=10**6), [10**6 - 1]).shape == (1, 12)


def test_a_latin_hypercube_may_have_as_many_numbers_as_workers_can_hold(monkeypatch):
    monkeypatch.setattr(sys.modules[columns.__module__], "LARGEST_HYPERCUBE", 12 * 50)
    assert draws(campaign(sampling="latin_hypercube", samples=50), [0]).shape == (1, 12)
    with pytest.raises(ValueRangeError, match="got 51 samples of 12 columns"):
        draws(campaign(sampling="latin_hypercube", samples=51), [0])
