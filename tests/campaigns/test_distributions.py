"""Distributions: quantile functions against SciPy's, supports, and what is said about wrong ones."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy import stats

from passiflex.campaigns.distributions import RARE, Choice, LogUniform, Normal, Uniform

U = np.concatenate([[1e-12, 1e-9], np.linspace(0.001, 0.999, 97), [1 - 1e-9, 1 - 1e-12]])
number = st.floats(-1e6, 1e6)
share = st.floats(2.0**-54, 1 - 2.0**-54)


@pytest.mark.parametrize(
    ("distribution", "oracle"),
    [
        (Uniform(low=-0.5, high=2.0), stats.uniform(-0.5, 2.5)),
        (LogUniform(low=0.01, high=10.0), stats.loguniform(0.01, 10.0)),
        (Normal(mean=1.0, deviation=0.2), stats.norm(1.0, 0.2)),
        (Normal(mean=1.0, deviation=0.2, low=0.7, high=1.1), stats.truncnorm(-1.5, 0.5, 1.0, 0.2)),
        (Normal(mean=0.0, deviation=1.0, low=-0.5), stats.truncnorm(-0.5, np.inf)),
        (Normal(mean=0.0, deviation=2.0, high=0.0), stats.truncnorm(-np.inf, 0.0, 0.0, 2.0)),
    ],
    ids=["uniform", "log_uniform", "normal", "truncated", "cut below", "cut above"],
)
def test_the_quantile_is_the_inverse_of_the_distribution_function(distribution, oracle):
    # At the upper end the quantile's slope is large: the distribution function is compared there, by its complement.
    np.testing.assert_allclose(distribution.quantile(U[:-2]), oracle.ppf(U[:-2]), rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(oracle.sf(distribution.quantile(U)), 1 - U, rtol=2e-4, atol=1e-15)
    np.testing.assert_allclose(distribution.support, oracle.support(), rtol=1e-15)


def test_both_tails_of_a_normal_are_equally_exact():
    u = np.array([1e-3, 2.0**-30, 2.0**-50])  # exact, and so is 1 - u of the last two
    normal = Normal(mean=0.0, deviation=1.0, low=-9.0, high=9.0)
    np.testing.assert_allclose(normal.quantile(u), -normal.quantile(1 - u), rtol=1e-12)


def intervals():
    two = st.tuples(number, number).map(sorted).filter(lambda pair: pair[1] - pair[0] > 1e-6)
    uniform = two.map(lambda p: Uniform(low=p[0], high=p[1]))
    positive = st.tuples(st.floats(1e-9, 1e9), st.floats(1.001, 1e6))
    log_uniform = positive.map(lambda p: LogUniform(low=p[0], high=p[0] * p[1]))
    truncated = st.builds(
        lambda p, where, deviation: Normal(
            mean=p[0] + where * (p[1] - p[0]), deviation=deviation, low=p[0], high=p[1]
        ),
        two,
        st.floats(0.001, 0.999),
        st.floats(1e-3, 1e3),
    )
    return st.one_of(uniform, log_uniform, truncated)


@given(intervals(), st.lists(share, min_size=2, max_size=8))
def test_a_quantile_is_in_the_support_and_grows(distribution, u):
    values = distribution.quantile(sorted(u))
    low, high = distribution.support
    assert np.all((values >= low) & (values <= high))
    scale = max(abs(low), abs(high), 1.0)
    assert np.all(np.diff(values) >= -1e-12 * scale)


@given(st.lists(st.floats(0.01, 100.0), min_size=1, max_size=6), share)
def test_a_choice_gives_the_value_whose_share_u_falls_in(weights, u):
    choice = Choice(values=tuple(range(len(weights))), weights=tuple(weights))
    ends = np.cumsum(weights) / np.sum(weights)
    (i,) = choice.quantile([u]).astype(int)
    assert u <= ends[i] + 1e-12
    assert i == 0 or u >= ends[i - 1] - 1e-12


def test_quantiles_keep_the_shape():
    for distribution in (Uniform(low=0, high=1), Normal(mean=0, deviation=1), Choice(values=(1.0, 2.0))):
        assert distribution.quantile(np.full((2, 3), 0.3)).shape == (2, 3)
        assert distribution.quantile(0.3).shape == ()


def test_words_and_flags_are_indices_and_numbers_are_themselves():
    words = Choice(values=("plain", "matched", "other"))
    assert words.quantile([0.1, 0.5, 0.9]).tolist() == [0.0, 1.0, 2.0]
    assert (words.value(1.0), words.support) == ("matched", (0.0, 2.0))
    flags = Choice(values=(True, False))
    assert [flags.value(x) for x in flags.quantile([0.2, 0.7]).tolist()] == [True, False]
    numbers = Choice(values=(3, 0.5, 1), weights=(1, 1, 2))
    assert numbers.quantile([0.1, 0.3, 0.8]).tolist() == [3.0, 0.5, 1.0]
    assert (numbers.value(0.5), numbers.support) == (0.5, (0.5, 3.0))


def test_ends_name_the_entry_that_sets_them():
    assert Uniform(low=1, high=2).ends() == ((("low",), 1.0), (("high",), 2.0))
    assert Choice(values=("a", "b")).ends() == ((("values", 0), "a"), (("values", 1), "b"))
    below, above = Normal(mean=1, deviation=2, high=5).ends()
    assert above == (("high",), 5.0)
    assert below[0] == ()
    total = stats.norm.cdf(2.0)
    assert stats.norm.cdf((below[1] - 1) / 2) == pytest.approx(RARE * total)


@pytest.mark.parametrize(
    ("kind", "settings", "place", "message"),
    [
        (Uniform, {"low": 2, "high": 1}, "high", "needs more than low = 2; got 1"),
        (Uniform, {"low": 1, "high": 1}, "high", "needs more than low = 1; got 1"),
        (
            LogUniform,
            {"low": 0, "high": 1},
            "low",
            "log_uniform needs numbers > 0; try uniform, or a small low; got 0",
        ),
        (LogUniform, {"low": 2, "high": 1}, "high", "needs more than low = 2; got 1"),
        (Normal, {"mean": 0, "deviation": 0}, "deviation", "needs a number > 0; got 0"),
        (
            Normal,
            {"mean": 0, "deviation": 1, "low": 1, "high": -1},
            "high",
            "needs more than low = 1; got -1",
        ),
        (Normal, {"mean": 0, "deviation": 1, "low": 1}, "mean", "needs to lie between low and high; got 0"),
        (
            Choice,
            {"values": [1, 2], "weights": [1]},
            "weights",
            "needs 2 numbers, one for each value; got 1",
        ),
        (Choice, {"values": [1, 2], "weights": [1, 0]}, "weights.1", "needs a number > 0; got 0"),
        (Choice, {"values": [1, "a"]}, "values", "needs all numbers, or all words; got [1.0, 'a']"),
        (Choice, {"values": [1, 2, 1.0]}, "values.2", "is there twice; remove one, or give it a weight"),
    ],
)
def test_what_is_said_about_a_wrong_distribution(kind, settings, place, message):
    with pytest.raises(ValidationError) as error:
        kind(**settings)
    (found,) = error.value.errors()
    assert str(found["ctx"]["error"]) == f"{place}.{message}"


@pytest.mark.parametrize("wrong", [math.nan, True, "3 kg", [1]])
def test_an_end_is_a_finite_number(wrong):
    with pytest.raises(ValidationError, match="one number"):
        Uniform(low=wrong, high=10)


def test_a_choice_has_values():
    with pytest.raises(ValidationError, match="needs one value at least"):
        Choice(values=())
    with pytest.raises(ValidationError, match="expected a number, a word, or true or false"):
        Choice(values=([1],))
