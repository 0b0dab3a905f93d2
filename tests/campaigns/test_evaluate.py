"""Rows of samples: what each says of its run, and that it depends on nothing but its sample."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from campaigns.small_campaigns import (
    CONTINUOUS,
    PARAMETERS,
    SAMPLED,
    STIFFNESS,
    UNSTABLE,
    campaign,
    choice,
    equal,
    same_rows,
    uniform,
)
from passiflex.campaigns import Campaign, columns, draws, sample_scenario
from passiflex.campaigns import evaluate as module
from passiflex.campaigns.evaluate import (
    REFUSED,
    TEXTS,
    evaluate_problems,
    evaluate_samples,
    kept_measures,
    require_response,
    run_sample,
)
from passiflex.errors import NameUnknownError, ValueRangeError
from passiflex.metrics.measures import MEASURES, OF_CONTACT, measures
from passiflex.metrics.steps import step_window
from passiflex.simulation import resolve
from worlds import merged

LATE = {
    "control.delay": choice(0.28, 0.005),
    "control.jitter": choice(0.03, 0),
    STIFFNESS: uniform(-0.2, 0.2),
}
"""Both at their worst are 62 periods, of which a command may be late by 60 at most; each alone is possible."""
CAMPAIGNS: dict[str, Campaign] = {
    "sampled": campaign(),
    "continuous": campaign(CONTINUOUS, samples=3),
    "unstable": campaign(merged(UNSTABLE, {"control": {"allow_unstable": True}}), samples=3),
    "words": campaign(
        parameters={
            "control.external_torque": choice("none", "true"),
            "control.allow_unstable": choice(True, False),
        }
    ),
    "rates": campaign(parameters={"control.rate": choice(200, 400), "duration": uniform(0.45, 0.7)}),
    "response": campaign(keep={"response": 0.05}),
}


UNTOUCHED = tuple(name for name in MEASURES if name not in OF_CONTACT)
WALL: dict[str, Any] = {
    "forces": [{"from": 0.1, "to": 0.6, "force": [4, 0, 0]}],
    "environment": [
        {"kind": "plane", "point": [0.002, 0, 0], "normal": [-1, 0, 0], "relative": True, "stiffness": 1e3}
    ],
}


def rows(of: Campaign, samples: Any = None) -> list[dict[str, Any]]:
    return evaluate_samples(of.to_yaml(), range(of.samples) if samples is None else samples)


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_a_row_has_the_measures_of_the_run_of_its_sample(name: str) -> None:
    """To the last bit, also where other samples ran beside it in lanes."""
    c = CAMPAIGNS[name]
    for i, row in enumerate(rows(c)):
        scenario = sample_scenario(c, i)
        expected = measures(resolve(scenario), step_window(scenario), run_sample(c, i))
        assert row["sample"] == i
        assert all(equal(row[key], value) for key, value in expected.items())


@pytest.mark.parametrize("name", ["sampled", "continuous", "rates"])
def test_a_row_has_the_draws(name: str) -> None:
    c = CAMPAIGNS[name]
    table = draws(c, range(c.samples))
    for row, drawn in zip(rows(c), table, strict=True):
        assert [row[column] for column in columns(c)] == drawn.tolist()
        assert list(row) == ["sample", *columns(c), *TEXTS, *UNTOUCHED]


def test_words_are_words() -> None:
    c = CAMPAIGNS["words"]
    found = rows(c)
    assert {row["control.external_torque"] for row in found} == {"none", "true"}
    assert {row["control.allow_unstable"] for row in found} <= {"true", "false"}
    for i, row in enumerate(found):
        control = sample_scenario(c, i).control
        assert control is not None
        assert row["control.external_torque"] == control.external_torque
        assert row["control.allow_unstable"] == str(control.allow_unstable).lower()


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_a_row_does_not_depend_on_the_others(name: str) -> None:
    c = CAMPAIGNS[name]
    together, last = rows(c), c.samples - 1
    assert same_rows([rows(c, [i])[0] for i in range(c.samples)], together)
    assert same_rows(rows(c, [last, 0, 1]), [together[i] for i in (last, 0, 1)])
    assert same_rows(rows(c, range(1, c.samples)), together[1:])


def test_samples_differ() -> None:
    """Else all of this would be easy."""
    found = rows(CAMPAIGNS["sampled"])
    assert len({row["margin"] for row in found}) == len({row["tracking_rms"] for row in found}) == len(found)


def test_no_samples_no_rows() -> None:
    assert rows(campaign(), []) == []


def impossible(**changes: Any) -> Campaign:
    return campaign(parameters=LATE, samples=12, seed=1, **changes)


def test_a_sample_that_no_scenario_can_be_is_refused_and_disturbs_no_other() -> None:
    c = impossible(keep={"response": 0.05})
    found = rows(c)
    bad = [i for i, row in enumerate(found) if row["control.delay"] == 0.28 and row["control.jitter"] == 0.03]
    assert 0 < len(bad) < len(found)
    assert [i for i, row in enumerate(found) if row["verdict"] == REFUSED] == bad
    good = [i for i in range(c.samples) if i not in bad]
    assert same_rows([found[i] for i in good], rows(c, good))
    for i in bad:
        row = found[i]
        assert list(row) == list(found[good[0]])
        assert "60 periods" in row["failure"]
        assert row["decided_by"] == ""
        assert all(math.isnan(row[name]) for name in UNTOUCHED)
        assert len(row["displacement_x"]) == len(found[good[0]]["displacement_x"])
        assert np.isnan(row["displacement_z"]).all()


@pytest.mark.parametrize("keep", [{}, {"response": 0.05}, {"metrics": ["margin"]}])
@pytest.mark.parametrize(
    ("parameter", "values", "why"),
    [
        ("posture.1", (0.5, 9.0), "joint 1 of 'planar2r' is outside its limits"),
        ("deviations.motor_inertia", (0.0, -1 + 1e-12), "too fast to be simulated"),
    ],
)
def test_a_robot_that_cannot_be_run_is_refused(
    parameter: str, values: tuple[float, float], why: str, keep: dict[str, Any]
) -> None:
    """Whether it is the start that is impossible, or only the integration."""
    c = campaign(parameters={parameter: choice(*values), STIFFNESS: uniform(-0.2, 0.2)}, keep=keep)
    found = rows(c)
    bad = [row for row in found if row[parameter] == values[1]]
    good = [row for row in found if row[parameter] == values[0]]
    assert bad
    assert good
    assert {row["verdict"] for row in bad} == {REFUSED}
    assert all(why in row["failure"] for row in bad)
    assert all(list(row) == list(found[0]) for row in found)
    assert same_rows(rows(c, [row["sample"] for row in good]), good)
    assert {row["verdict"] for row in good} == {"passive"}


def test_a_wrong_installation_is_no_property_of_a_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    """What would refuse every sample must be heard."""
    monkeypatch.setenv("PASSIFLEX_COMPILER", "no such compiler")
    module._campaign.cache_clear()
    with pytest.raises(NameUnknownError, match="PASSIFLEX_COMPILER"):
        rows(campaign(merged(SAMPLED, {"law": {"gravity": "static"}})))


@pytest.mark.parametrize("name", ["sampled", "continuous"])
def test_only_the_metrics_that_are_kept(name: str) -> None:
    """In the order asked for, after what every row has."""
    c = CAMPAIGNS[name]
    wanted = ("torque_share", "margin")
    some = c.model_copy(update={"keep": c.keep.model_copy(update={"metrics": wanted})})
    assert kept_measures(some) == wanted
    found = rows(some)
    assert list(found[0]) == ["sample", *columns(c), *TEXTS, *wanted]
    whole = rows(c)
    assert same_rows(found, [{key: row[key] for key in found[0]} for row in whole])


def test_all_metrics_are_kept_if_none_is_named() -> None:
    """Those of contact where there is a surface to touch."""
    assert kept_measures(campaign()) == UNTOUCHED
    assert kept_measures(campaign(merged(SAMPLED, WALL))) == tuple(MEASURES)


def test_the_place_and_the_stiffness_of_a_wall_are_drawn_and_what_it_felt_is_kept() -> None:
    """By a run of the sample alone, to the last bit."""
    drawn = {
        "environment.1.stiffness": {"distribution": "log_uniform", "low": 1e2, "high": 1e4},
        "environment.1.point.1": uniform(0.001, 0.004),
    }
    c = campaign(merged(SAMPLED, WALL), parameters=drawn)
    found = rows(c)
    assert any(row["contact_force_peak"] > 0.1 for row in found)
    for i, row in enumerate(found):
        (wall,) = sample_scenario(c, i).environment
        assert wall.stiffness == row["environment.1.stiffness"]  # type: ignore[union-attr]
        assert wall.point[0] == row["environment.1.point.1"]  # type: ignore[union-attr]
        force = np.linalg.norm(run_sample(c, i)["plane_force"], axis=1)
        assert row["contact_force_peak"] == force.max()


def test_a_measure_of_contact_that_is_asked_for_without_a_surface_is_missing() -> None:
    (row, *_) = rows(campaign(keep={"metrics": ["margin", "contact_energy"]}))
    assert math.isnan(row["contact_energy"])


@pytest.mark.parametrize("keep", [{"metrics": ["margin", "torque_pek"]}, {"by": "torque_pek", "worst": 1}])
def test_an_unknown_metric_is_refused_with_the_nearest(keep: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match=r"unknown word 'torque_pek'; try 'torque_peak'"):
        campaign(keep=keep)


@pytest.mark.parametrize("scenario", [SAMPLED, CONTINUOUS])
@pytest.mark.parametrize("duration", [0.6, 0.63])
def test_the_response_that_is_kept(scenario: dict[str, Any], duration: float) -> None:
    """Every 0.05 s from 0 on, whether or not the last row falls on the end."""
    c = campaign({**scenario, "duration": duration}, keep={"response": 0.05}, samples=2)
    for i, row in enumerate(rows(c)):
        run = run_sample(c, i)
        for axis, name in enumerate(("displacement_x", "displacement_y", "displacement_z")):
            instants = [np.flatnonzero(np.abs(run.time - 0.05 * k) < 1e-9)[0] for k in range(13)]
            expected = [float(run["position"][at, axis] - run["position"][0, axis]) for at in instants]
            assert equal(row[name], expected)


def test_the_response_of_a_run_that_ended_early() -> None:
    """Not a number from there on, and as long as all."""
    wild = merged(
        UNSTABLE,
        {
            "control": {"allow_unstable": True},
            "tank": {"kind": "paper"},
            "law": {"shaped_stiffness": {"ratio": 10}},
        },
    )
    c = campaign(wild, keep={"response": 0.01}, samples=2)
    for row in rows(c):
        assert "finite" in row["failure"]
        known = round(row["end_time"] / 0.01) + 1
        values = np.array(row["displacement_z"])
        assert values.size == 61
        assert 1 < known < 61
        assert np.isfinite(values[:known]).all()
        assert np.isnan(values[known:]).all()


def test_the_response_of_samples_of_other_durations() -> None:
    """As long as that of the scenario: what is beyond is cut off, what is missing is no number."""
    c = campaign(parameters={"duration": uniform(0.45, 0.75)}, keep={"response": 0.05})
    for row in rows(c):
        known = int(row["duration"] / 0.05 + 1e-9) + 1
        assert len(row["displacement_x"]) == 13
        assert np.isfinite(row["displacement_x"]).sum() == min(known, 13)


@pytest.mark.parametrize(("interval", "fits"), [(0.01, True), (0.07, True), (0.015, False), (0.005, False)])
def test_the_interval_of_the_response_fits_the_rows(interval: float, fits: bool) -> None:
    c = campaign(keep={"response": interval})
    if fits:
        require_response(c)
        return
    with pytest.raises(ValueRangeError, match=r"keep\.response; got .* needs a whole multiple .* 0\.01 s"):
        require_response(c)


def test_a_response_needs_the_same_instants_in_all_samples() -> None:
    parameters = {"output_interval": choice(0.005, 0.01)}
    require_response(campaign(parameters=parameters))
    with pytest.raises(ValueRangeError, match=r"keep\.response; got output_interval among the parameters"):
        require_response(campaign(parameters=parameters, keep={"response": 0.05}))


def test_problems_of_both_kinds_side_by_side() -> None:
    """Sampled ones run in lanes, those in continuous time one by one; each comes back in its place."""
    mixed = [campaign(CONTINUOUS), campaign(), campaign(CONTINUOUS), campaign()]
    scenarios = [sample_scenario(c, i) for i, c in enumerate(mixed)]
    found = evaluate_problems([resolve(s) for s in scenarios], scenarios)
    for i, (c, got) in enumerate(zip(mixed, found, strict=True)):
        (row,) = rows(c, [i])
        assert all(equal(got[key], row[key]) for key in got)
    assert [math.isnan(got["governed_share"]) for got in found] == [True, False, True, False]


def test_a_choice_cannot_mix_both_kinds() -> None:
    """A parameter sets an entry, and `control` is a section: a campaign is of one kind."""
    with pytest.raises(ValueError, match="mapping"):
        campaign(parameters={"control": choice(None, {"rate": 200})})


def test_the_seed_of_the_campaign_is_in_the_rows() -> None:
    c = campaign(parameters=PARAMETERS)
    other = campaign(parameters=PARAMETERS, seed=4)
    assert all(a["margin"] != b["margin"] for a, b in zip(rows(c), rows(other), strict=True))
