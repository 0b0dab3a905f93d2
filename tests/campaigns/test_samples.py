"""Samples: complete scenarios with the drawn values in them and nothing else changed, and values of one's own."""

from importlib import resources

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from passiflex.campaigns import Campaign, draws, parse_campaign, sample_scenario, with_values
from passiflex.campaigns.draws import scenario_seed
from passiflex.campaigns.samples import values_of_row
from passiflex.errors import ScenarioError, SizeError, ValueRangeError
from passiflex.simulation import load_scenario, parse_scenario

FIG1 = load_scenario(str(resources.files("passiflex") / "studies" / "scenarios" / "fig1_sampled.yaml"))
CAMPAIGN = Campaign(
    name="uncertain",
    scenario=FIG1,
    samples=200,
    seed=7,
    parameters={
        "deviations.joint_stiffness": {"distribution": "uniform", "low": -0.5, "high": 0.5, "per": "joint"},
        "law.shaped_inertia.ratio.6": {"distribution": "uniform", "low": 0.05, "high": 0.1},
        "law.stiffness.translation": {"distribution": "uniform", "low": "10 N/m", "high": "60 N/m"},
        "control.delay": {"distribution": "choice", "values": ["0 ms", "1 ms"]},
        "control.inner_loop": {"distribution": "choice", "values": ["plain", "matched"]},
        "control.allow_unstable": {"distribution": "choice", "values": [True, False]},
        "forces.1.force.3": {"distribution": "normal", "mean": 0, "deviation": 2},
        "motors.coulomb_friction.2": {"distribution": "uniform", "low": 0, "high": 1},
        "motors.coulomb_friction.5": {"distribution": "uniform", "low": 0, "high": 1},
        "actions.follow_velocity": {"distribution": "uniform", "low": 0, "high": 1},
    },
)


@pytest.mark.parametrize("index", [0, 17, 199])
def test_a_sample_has_its_values_in_place(index):
    s = sample_scenario(CAMPAIGN, index)
    row = draws(CAMPAIGN, [index])[0].tolist()
    assert s.name == f"uncertain_{index}"
    assert s.seed == scenario_seed(CAMPAIGN, index)
    assert s.deviations.joint_stiffness == tuple(row[:7])
    own = FIG1.law.shaped_inertia.ratio
    assert s.law.shaped_inertia.ratio == (*own[:5], row[7], *own[6:])
    np.testing.assert_array_equal(s.law.stiffness.translation, row[8] * np.eye(3))
    assert (s.control.delay, s.control.inner_loop) == (row[9], ("plain", "matched")[int(row[10])])
    assert s.control.allow_unstable is (row[11] == 0.0)
    assert s.forces[0].force == (0.0, 4.0, row[12])
    assert s.motors.coulomb_friction == (0.0, row[13], 0.0, 0.0, row[14], 0.0, 0.0)
    assert s.actions.follow_velocity == row[15]


def test_nothing_else_is_changed():
    untouched = Campaign(name="same", scenario=FIG1, samples=1)
    s = sample_scenario(untouched, 0)
    assert s.model_copy(update={"name": FIG1.name, "seed": FIG1.seed}) == FIG1


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 199))
def test_a_sample_is_a_file_of_its_own(index):
    s = sample_scenario(CAMPAIGN, index)
    assert parse_scenario(s.to_yaml()) == s


def test_a_sample_is_the_same_from_the_text_of_the_campaign():
    again = parse_campaign(CAMPAIGN.to_yaml())
    assert [sample_scenario(again, i) for i in (3, 150)] == [sample_scenario(CAMPAIGN, i) for i in (3, 150)]


def test_samples_do_not_touch_the_campaign():
    before = CAMPAIGN.to_yaml()
    first = sample_scenario(CAMPAIGN, 1)
    sample_scenario(CAMPAIGN, 2)
    assert sample_scenario(CAMPAIGN, 1) == first
    assert CAMPAIGN.to_yaml() == before
    assert CAMPAIGN.scenario == FIG1


def test_an_index_is_that_of_a_sample():
    with pytest.raises(ValueRangeError, match="needs a list of whole numbers from 0 to 199"):
        sample_scenario(CAMPAIGN, 200)


def test_a_row_has_one_number_for_each_column():
    with pytest.raises(SizeError, match=r"got \(3,\); needs \(16,\)"):
        values_of_row(CAMPAIGN, np.zeros(3))


def test_a_row_gives_the_scenario_of_its_sample():
    (row,) = draws(CAMPAIGN, [5])
    sample = sample_scenario(CAMPAIGN, 5)
    found = with_values(CAMPAIGN, values_of_row(CAMPAIGN, row))
    assert found.model_copy(update={"name": sample.name, "seed": sample.seed}) == sample
    assert (found.name, found.seed) == (FIG1.name, FIG1.seed)


@pytest.mark.parametrize("subject", [FIG1, CAMPAIGN], ids=["scenario", "campaign"])
def test_values_of_ones_own(subject):
    values = {
        "posture.2": "45 deg",
        "control.delay": 0.0005,
        "deviations.motor_inertia": np.full(7, -0.1),
        "control.external_torque": "measured",
    }
    s = with_values(subject, values)
    assert s.posture == (0.0, np.pi / 4, *FIG1.posture[2:])
    assert s.control.delay == 0.0005
    assert s.deviations.motor_inertia == (-0.1,) * 7
    assert s.control.external_torque == "measured"
    assert with_values(subject, {}) == FIG1


def test_what_is_said_about_values_that_do_not_fit():
    with pytest.raises(ScenarioError) as error:
        with_values(FIG1, {"posture.9": 1, "contorl.delay": 0})
    assert error.value.mistakes == [
        "posture.9: posture has entries 1 to 7; got '9'",
        "contorl.delay: unknown name 'contorl'; try 'control'",
    ]
    with pytest.raises(ScenarioError) as error:
        with_values(FIG1, {"control.delay": "1 kg", "noise.torque_variance": -1})
    assert error.value.mistakes == [
        "control.delay: expected s, one number, ≥ 0; got '1 kg' (kg)",
        "noise.torque_variance: expected (N m)^2, one number, ≥ 0; got -1 (too small)",
    ]


def test_a_draw_between_possible_ends_that_is_impossible_is_said_when_it_is_drawn():
    ends = {
        "distribution": "uniform",
        "low": 500,
        "high": 1500,
    }  # of them and their middle 1 ms is a multiple
    base = FIG1.model_copy(update={"noise": None, "output_interval": 0.002})
    c = Campaign(name="c", scenario=base, samples=3, parameters={"control.rate": ends})
    with pytest.raises(ScenarioError, match="output_interval: needs a whole multiple of the period"):
        sample_scenario(c, 0)
