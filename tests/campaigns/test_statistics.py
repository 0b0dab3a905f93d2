"""The statistics of rows against closed forms: tables, coverage by simulation, linear models, and odd rows."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from scipy.stats import kruskal, spearmanr

from campaigns.small_campaigns import SAMPLED, STIFFNESS, campaign, choice, uniform
from passiflex.campaigns import columns, draws
from passiflex.campaigns.draws import words
from passiflex.campaigns.importance import Index, first_order, holm, rank_correlation, rank_kruskal
from passiflex.campaigns.intervals import quantile_of, share_of
from passiflex.campaigns.page import page
from passiflex.campaigns.statistics import Statistics, statistics
from passiflex.cli.campaign_tables import statistics_tables
from passiflex.errors import NameUnknownError, ValueRangeError

DAMPING, LOOP, RATE = "law.damping.translation", "control.inner_loop", "control.rate"
PARAMETERS = {
    STIFFNESS: uniform(-0.2, 0.2, per="joint"),
    DAMPING: uniform(15, 30),
    LOOP: choice("plain", "matched"),
}


def made(count: int, **parts: Any) -> tuple[Any, pa.Table]:
    """Return a campaign and rows of it, whose metrics are given; as functions of the draws, or as they are."""
    changes = {"parameters": PARAMETERS, "samples": max(count, 1)} | parts.pop("changes", {})
    of = campaign(**changes)
    drawn = draws(of, range(count))
    known = words(of)
    data: dict[str, Any] = {"sample": list(range(count))}
    for name, values in zip(columns(of), drawn.T, strict=True):
        data[name] = [known[name][int(v)] for v in values] if name in known else values
    data |= {"verdict": ["passive"] * count, "failure": [""] * count}
    data |= {name: part(drawn) if callable(part) else part for name, part in parts.items()}
    return of, pa.table(data)


def association(found: Statistics, metric: str, column: str) -> Any:
    (one,) = (a for a in found.associations if (a.metric, a.column) == (metric, column))
    return one


@pytest.mark.parametrize(
    ("count", "of", "low", "high"),
    [(0, 10, 0.0, 0.3085), (10, 10, 0.6915, 1.0), (5, 10, 0.1871, 0.8129), (1, 20, 0.0013, 0.2487)],
)
def test_the_interval_of_a_share_is_that_of_the_tables(count: int, of: int, low: float, high: float) -> None:
    """Clopper–Pearson at 95 %, as printed; of none it is 1 − (α/2)^(1/n)."""
    share = share_of("some", count, of, 0.95)
    assert (share.low, share.high) == pytest.approx((low, high), abs=5e-5)
    assert share.share == count / of


def test_of_no_samples_every_share_is_possible() -> None:
    share = share_of("some", 0, 0, 0.95)
    assert math.isnan(share.share)
    assert (share.low, share.high) == (0, 1)


@pytest.mark.parametrize("truth", [0.02, 0.5, 0.9])
def test_the_interval_of_a_share_covers_the_truth(truth: float) -> None:
    counts = np.random.default_rng(1).binomial(40, truth, 400)
    by_count = {c: share_of("some", int(c), 40, 0.9) for c in set(counts)}
    covered = np.mean([by_count[c].low <= truth <= by_count[c].high for c in counts])
    assert covered >= 0.9 - 3 * math.sqrt(0.09 / 400)


@pytest.mark.parametrize("probability", [0.05, 0.5, 0.75])
def test_the_interval_of_a_quantile_covers_the_true_one_whatever_the_distribution(probability: float) -> None:
    rng = np.random.default_rng(2)
    true = -math.log(1 - probability)
    found = [quantile_of(np.sort(rng.exponential(size=60)), probability, 0.9) for _ in range(400)]
    covered = np.mean([q.low <= true <= q.high for q in found])
    assert covered >= 0.9 - 3 * math.sqrt(0.09 / 400)
    assert covered < 0.99  # not by being needlessly wide


def test_the_interval_of_the_median_is_that_of_the_sign_test() -> None:
    """Of ten values x_(2) … x_(9) holds the median with 97.9 %, x_(3) … x_(8) with 89.1 % only."""
    q = quantile_of(np.arange(1.0, 11.0), 0.5, 0.95)
    assert (q.low, q.value, q.high) == (2, 5.5, 9)


def test_too_few_values_leave_an_end_open() -> None:
    q = quantile_of(np.arange(5.0), 0.05, 0.95)
    assert q.low == -math.inf
    assert q.high == 1  # x_(2): P(B ≥ 2) = 0.0226 for B ~ binomial(5, 0.05), P(B ≥ 1) is too much
    assert quantile_of(np.arange(20.0), 0.95, 0.95).high == math.inf


def test_ties_and_a_single_value_have_quantiles() -> None:
    tied = quantile_of(np.ones(50), 0.25, 0.95)
    assert (tied.low, tied.value, tied.high) == (1, 1, 1)
    one = quantile_of(np.array([7.0]), 0.5, 0.95)
    assert (one.low, one.value, one.high) == (-math.inf, 7, math.inf)


def test_rank_correlation_is_scipys_with_ties_too() -> None:
    rng = np.random.default_rng(3)
    x, y = rng.integers(0, 6, 50).astype(float), rng.normal(size=50).round(1)
    assert rank_correlation(x, y) == pytest.approx(tuple(spearmanr(x, y)), rel=1e-12)
    assert rank_correlation(np.arange(9.0), -(np.arange(9.0) ** 3)) == (-1, 0)


def test_what_never_settles_ranks_last() -> None:
    x = np.arange(8.0)
    y = np.array([1, 2, 3, 4, 5, 6, math.inf, math.inf])
    assert rank_correlation(x, y) == rank_correlation(x, np.minimum(y, 99))
    groups = x % 2
    expected = kruskal(np.minimum(y, 99)[groups == 0], np.minimum(y, 99)[groups == 1])
    assert rank_kruskal(groups, y)[1] == pytest.approx(expected.pvalue)


def test_for_two_words_the_strength_is_the_rank_correlation() -> None:
    rng = np.random.default_rng(4)
    x, y = rng.integers(0, 2, 60).astype(float), rng.normal(size=60)
    assert rank_kruskal(x, y)[0] == pytest.approx(abs(rank_correlation(x, y)[0]), rel=1e-12)


@pytest.mark.parametrize("test", [rank_correlation, rank_kruskal])
def test_what_is_constant_has_no_correlation(test: Any) -> None:
    x, one = np.arange(10.0) % 3, np.ones(10)
    assert np.isnan([*test(x, one), *test(one, x), *test(x[:3], x[:3])]).all()


def test_holms_correction() -> None:
    """0.01 × 3, 0.04 × 1 but no less than the one before, 0.02 × 2; what was not tested does not count."""
    assert holm(np.array([0.01, 0.04, math.nan, 0.02])) == pytest.approx(
        [0.03, 0.04, math.nan, 0.04], nan_ok=True
    )
    assert holm(np.array([0.9, 0.8])) == pytest.approx([1, 1])


def indices(weights: tuple[float, ...], count: int, seed: int, level: float = 0.95) -> list[Index | None]:
    rng = np.random.default_rng(seed)
    x = rng.random((count, len(weights)))
    return [first_order(column, x @ np.array(weights), level, seed) for column in x.T]


def test_the_indices_of_a_linear_model() -> None:
    """Of Σ w x they are w²/Σ w², but for 1/bins² of them that equal counts within a bin hide, and noise."""
    weights = (3.0, 2.0, 1.0, 0.0)
    for index, weight in zip(indices(weights, 4096, 5, 0.999), weights, strict=True):
        assert index is not None
        assert index.value == pytest.approx(weight**2 / 14, abs=0.03)
        assert index.low <= weight**2 / 14 <= index.high
        assert index.high - index.low < 0.1


def test_the_intervals_of_indices_cover_the_truth_and_their_mean_is_not_off() -> None:
    found = np.array([indices((2.0, 1.0, 0.0), 200, seed) for seed in range(60)], dtype=float)
    truth = np.array([0.8, 0.2, 0.0])
    covered = (found[..., 1] <= truth) & (truth <= found[..., 2])
    assert (covered.mean(axis=0) >= 0.95 - 3 * math.sqrt(0.0475 / 60)).all()
    assert found[..., 0].mean(axis=0) == pytest.approx(truth, abs=0.02)


def test_the_index_of_a_choice_is_exact_where_nothing_else_varies() -> None:
    x = np.arange(64.0) % 2
    assert first_order(x, 3 * x, 0.95, 0) == Index(1, 1, 1)


def test_an_index_needs_samples_that_vary() -> None:
    x = np.arange(40.0)
    assert first_order(x[:31], x[:31], 0.95, 0) is None
    assert first_order(x, np.ones(40), 0.95, 0) is None
    assert first_order(np.ones(40), x, 0.95, 0) is None


def test_the_parameters_that_matter_are_found_with_sign_and_joint() -> None:
    """margin = 2 D − 100 k₂ with D over 15, k₂ over 0.4: w² as 900 : 1600 of the variance."""
    of, rows = made(400, margin=lambda d: 2 * d[:, 2] - 100 * d[:, 1])
    found = statistics(of, rows)
    second, damping = association(found, "margin", f"{STIFFNESS}.2"), association(found, "margin", DAMPING)
    assert (second.parameter, second.joint, second.test) == (STIFFNESS, 2, "spearman")
    assert (damping.parameter, damping.joint) == (DAMPING, None)
    assert second.strength < -0.6
    assert damping.strength > 0.4
    assert max(second.adjusted, damping.adjusted) < 1e-6
    assert second.first_order.value == pytest.approx(0.64, abs=0.08)
    assert damping.first_order.value == pytest.approx(0.36, abs=0.08)
    for other in (association(found, "margin", f"{STIFFNESS}.1"), association(found, "margin", LOOP)):
        assert other.adjusted > 0.05
        assert other.first_order.low < 0.02


def test_words_are_compared_and_not_ordered() -> None:
    of, rows = made(100, margin=lambda d: d[:, 3] + 0.1 * d[:, 0])
    loop = association(statistics(of, rows), "margin", LOOP)
    assert loop.test == "kruskal"
    assert loop.strength == pytest.approx(math.sqrt(0.75), abs=0.02)  # two groups wholly apart
    assert loop.first_order.value > 0.95


def test_shares_leave_out_what_was_refused() -> None:
    verdicts = ["passive"] * 5 + ["violated"] * 2 + ["inconclusive"] + ["refused"] * 2
    settling = [1.0] * 4 + [math.inf] * 4 + [math.nan] * 2
    fell = [math.nan] * 7 + [0.3] + [math.nan] * 2
    of, rows = made(10, verdict=verdicts, settling_time=settling, fell_back_at=fell)
    found = statistics(of, rows)
    counted = {s.name: (s.count, s.of) for s in found.shares}
    assert counted == {
        "refused": (2, 10), "passive": (5, 8), "violated": (2, 8), "inconclusive": (1, 8),
        "settled": (4, 8), "fell_back": (1, 8),
    }  # fmt: skip
    assert found.share("settled").share == 0.5
    assert "2 refused, in no other number" in found.conditions
    with pytest.raises(NameUnknownError, match="share"):
        found.share("setled")


def test_without_a_step_nothing_settles_and_without_a_tank_column_nothing_falls_back() -> None:
    of, rows = made(4, settling_time=[math.nan] * 4, changes={"scenario": SAMPLED | {"reference": None}})
    assert [s.name for s in statistics(of, rows).shares] == ["refused", "passive", "violated", "inconclusive"]


def test_what_is_not_finite_is_counted_and_left_out_of_the_quantiles() -> None:
    of, rows = made(5, settling_time=[3.0, math.inf, 1.0, 2.0, math.nan])
    (spread,) = statistics(of, rows).spreads
    assert (spread.metric, spread.unit, spread.finite, spread.not_finite) == ("settling_time", "s", 3, 2)
    assert spread.quantiles[2].value == 2


def test_the_worst_samples_are_at_the_bad_end_and_diverged_ones_before_all() -> None:
    of, rows = made(
        6,
        margin=[3.0, 1.0, 2.0, 1.0, math.nan, 9.0],
        overshoot=[0.1, 0.5, 0.2, 0.3, 0.4, math.nan],
        failure=[""] * 5 + ["left the finite numbers"],
    )
    found = statistics(of, rows, worst=4)
    assert (found.by, [w.sample for w in found.worst]) == ("margin", [5, 1, 3, 2])
    drawn = draws(of, [1])[0]
    assert found.worst[1].draws == {
        STIFFNESS: tuple(drawn[:2]), DAMPING: drawn[2], LOOP: ("plain", "matched")[int(drawn[3])],
    }  # fmt: skip
    assert [w.sample for w in statistics(of, rows, by="overshoot", worst=2).worst] == [5, 1]


@pytest.mark.parametrize("changes", [{"metrics": ["margn"]}, {"by": "overshoot"}])
def test_a_metric_that_was_not_kept_is_refused(changes: dict[str, Any]) -> None:
    of, rows = made(4, margin=[1.0, 2, 3, 4])
    with pytest.raises(NameUnknownError, match="metric that was kept"):
        statistics(of, rows, **changes)


@pytest.mark.parametrize("level", [0.0, 1.0, 95.0, math.nan])
def test_a_level_that_is_none_is_refused(level: float) -> None:
    with pytest.raises(ValueRangeError, match="level"):
        statistics(*made(4, margin=[1.0, 2, 3, 4]), level=level)


def odd(which: str) -> tuple[Any, pa.Table]:
    if which == "no samples":
        return made(0)[0], pa.table({"sample": pa.array([], pa.int64())})
    if which == "one sample":
        return made(1, margin=[1.0])
    if which == "all refused":
        return made(3, margin=[math.nan] * 3, verdict=["refused"] * 3)
    if which == "nothing varies":
        return made(40, margin=[1.0] * 40, overshoot=[None] * 40)
    if which == "no parameters":
        return made(40, margin=list(range(40)), changes={"parameters": {}})
    return made(
        40,
        margin=lambda d: d[:, 0],
        changes={"parameters": {STIFFNESS: uniform(-0.2, 0.2), RATE: choice(200)}},
    )


ODD = ("no samples", "one sample", "all refused", "nothing varies", "no parameters", "a constant parameter")


@pytest.mark.parametrize("which", ODD)
def test_odd_rows_have_statistics_tables_json_and_a_page(which: str) -> None:
    of, rows = odd(which)
    found = statistics(of, rows)
    assert found.samples == rows.num_rows
    assert all(math.isnan(a.strength) for a in found.associations if a.column != STIFFNESS)
    assert all(table.row_count for table in statistics_tables(found) if which != "no samples")
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["samples"] == found.samples
    assert page(of, rows, found).shares == found.shares


def test_the_same_rows_give_the_same_statistics() -> None:
    of, rows = made(64, margin=lambda d: d[:, 0], overshoot=lambda d: d[:, 1])
    both = statistics(of, rows)
    assert both == statistics(of, rows)
    alone = statistics(of, rows, metrics=["overshoot"])
    assert alone.associations == tuple(a for a in both.associations if a.metric == "overshoot")
