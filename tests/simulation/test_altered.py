"""An altered problem is the one that its own configuration describes: nothing of the old one is left over."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml

from passiflex.control.motion import pose_at
from passiflex.control.posture import posture
from passiflex.errors import NameUnknownError, PassiflexError, SizeError, ValueRangeError
from passiflex.problems.altered import MOST_PERIODS, altered, at_rate
from passiflex.problems.problem import SampledProblem
from passiflex.sampled.matched_loop import MatchedInnerLoop
from passiflex.simulation import Problem, parse_scenario, resolve
from worlds import PLAIN, world

FALLBACK = {"shaped_inertia": {"ratio": 2}, "damping": {"translation": 70}}
CONTROL = {"delay": 1e-3, "inner_loop": "matched", "external_torque": "none", "fallback": FALLBACK}
REFERENCE = [
    {"at": 0.1, "kind": "step", "by": [0, 0, 0.05]},
    {"at": 0.2, "kind": "move", "by": [0.02, 0, 0], "duration": 0.1},
    {"at": 0.4, "kind": "circle", "plane": ["x", "z"], "radius": 0.02, "period": 1},
]


def problem(**changes: Any) -> Problem:
    noise = {"torque_variance": 0.1, "hold": 1e-3}
    base = {"law": {"gravity": "static"}, "control": CONTROL, "noise": noise, "reference": REFERENCE}
    return resolve(world(**base | changes))


def require_same(one: Problem, other: Problem) -> None:
    """Compare every number; those that are worked out by another way, up to rounding."""
    assert isinstance(one, SampledProblem)
    assert isinstance(other, SampledProblem)
    for name in ("gains", "plant", "model", "q", "theta"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-12, atol=1e-12)
    for name in ("numbers", "plant", "held"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-12)
    for name in ("period", "delay", "jitter", "missed", "allow_unstable"):
        assert getattr(one, name) == getattr(other, name)
    assert one.controller.inner == other.controller.inner
    assert (one.noise, one.output_interval, one.duration) == (
        other.noise,
        other.output_interval,
        other.duration,
    )
    np.testing.assert_allclose(one.home.position, other.home.position, atol=1e-12)
    np.testing.assert_allclose(one.home.rotation, other.home.rotation, atol=1e-12)
    for ours, theirs in zip(one.events, other.events, strict=True):
        assert ours.time == theirs.time
        np.testing.assert_array_equal(ours.F_e, theirs.F_e)
        for clock in (0.0, 0.07, 0.3):
            if ours.motion is not None and theirs.motion is not None:
                here, there = pose_at(ours.motion, clock), pose_at(theirs.motion, clock)
                np.testing.assert_allclose(here.position, there.position, atol=1e-12)
                np.testing.assert_allclose(here.rotation, there.rotation, atol=1e-12)


CHANGES: dict[str, dict[str, Any]] = {
    "nothing": {},
    "rate": {"rate": 2500.0},
    "delay": {"delay": 3.2e-3},
    "rate and delay": {"rate": 500.0, "delay": 0.0},
    "shaping": {"gains": {"shaped_stiffness": [8e3, 4e3], "shaped_inertia": [0.2, 0.1]}},
    "impedance": {"gains": {"stiffness": 90 * np.eye(3), "damping": 11 * np.eye(3)}},
    "scalars": {"gains": {"null_space_damping": 3.0, "regularisation": 1e-4}, "rate": 4000.0},
}


@pytest.mark.parametrize("change", CHANGES)
def test_an_altered_problem_is_what_its_configuration_says(change: str) -> None:
    changed = altered(problem(), **CHANGES[change])
    require_same(changed, resolve(parse_scenario(changed.text)))


def test_what_is_given_is_in_force_and_the_rest_stays() -> None:
    before = problem()
    after = altered(before, rate=2000.0, delay=1.5e-3, gains={"stiffness": 90 * np.eye(3)})
    assert isinstance(before, SampledProblem)
    assert isinstance(after, SampledProblem)
    assert (after.period, after.delay) == (5e-4, 1.5e-3)
    assert after.controller.inner == MatchedInnerLoop(3)
    assert before.controller.inner == MatchedInnerLoop(1)
    parts = after.loop.parameters
    assert parts.unpack("inner", after.numbers)["period"] == 5e-4
    ours, theirs = (p.law.layout.unpack(p.gains) for p in (after, before))
    np.testing.assert_array_equal(ours["stiffness"], 90 * np.eye(3))
    for name in ("damping", "shaped_stiffness", "shaped_inertia"):
        np.testing.assert_array_equal(ours[name], theirs[name])


def test_a_changed_plant_rests_under_its_own_weight_and_the_law_knows_nothing_of_it() -> None:
    before = problem()
    robot = before.law.robot
    heavy = {"link_mass": 1.5 * robot.layout.unpack(before.plant)["link_mass"], "joint_stiffness": [4e3, 3e3]}
    after = altered(before, plant=heavy)
    assert isinstance(after, SampledProblem)
    numbers = robot.layout.unpack(after.plant)
    weight = posture(robot, after.q, numbers).gravity_torque
    np.testing.assert_allclose(after.held, weight, rtol=1e-12)
    np.testing.assert_allclose(numbers["joint_stiffness"] * (after.theta - after.q), weight, rtol=1e-9)
    np.testing.assert_array_equal(after.model, before.model)
    assert "planar2r, changed in memory" in after.text


def test_a_scenario_in_continuous_time_becomes_a_sampled_one() -> None:
    continuous = parse_scenario(
        yaml.safe_dump({k: v for k, v in yaml.safe_load(PLAIN).items() if k not in ("control", "tank")})
    )
    sampled = at_rate(continuous, 400.0, 1e-3)
    assert sampled.control is not None
    assert (sampled.control.rate, sampled.control.delay, sampled.control.inner_loop) == (400.0, 1e-3, "plain")
    assert sampled.output_interval == pytest.approx(2.5e-3)
    assert resolve(sampled) is not None
    with pytest.raises(ValueRangeError, match="'planar' has no control rate; needs `control"):
        at_rate(continuous)


def test_at_rate_says_what_altered_does() -> None:
    scenario = world(control=CONTROL, reference=REFERENCE)
    require_same(altered(resolve(scenario), rate=800.0, delay=5e-3), resolve(at_rate(scenario, 800.0, 5e-3)))
    assert at_rate(scenario) == scenario


@pytest.mark.parametrize("periods", [1, 3])
@pytest.mark.parametrize("change", [{"rate": 2300.0}, {"rate": 400.0, "delay": 0.0}, {"delay": 2e-3}, {}])
def test_noise_is_held_for_as_many_periods_as_before(periods: int, change: dict[str, float]) -> None:
    before = problem(noise={"torque_variance": 0.1, "hold": periods * 1e-3})
    after = altered(before, **change)
    assert isinstance(after, SampledProblem)
    assert after.noise is not None
    assert after.noise.hold == periods * after.period
    require_same(after, resolve(parse_scenario(after.text)))
    require_same(after, resolve(at_rate(parse_scenario(before.text), **change)))


def test_noise_of_a_scenario_in_continuous_time_is_drawn_in_each_period() -> None:
    noise = {"torque_variance": 0.1, "hold": 1e-3}
    sampled = at_rate(world(control=None, tank=None, noise=noise), 400.0)
    assert sampled.noise is not None
    assert sampled.noise.hold == 2.5e-3


@pytest.mark.parametrize(
    ("change", "kind", "message"),
    [
        ({"rate": 0.0}, ValueRangeError, r"control rate; got 0 Hz; needs above 0, at most 1e\+06 Hz"),
        ({"rate": 2e6}, ValueRangeError, r"control rate; got 2e\+06 Hz"),
        ({"rate": float("nan")}, ValueRangeError, "control rate; got nan Hz"),
        (
            {"delay": -1e-3},
            ValueRangeError,
            "delay of a command; got -0.001 s; needs 0 to 20 periods, 0.02 s",
        ),
        ({"delay": 0.1}, ValueRangeError, "delay of a command; got 0.1 s"),
        ({"gains": {"stifness": 1.0}}, NameUnknownError, "unknown gain; got 'stifness'.*try 'stiffness'"),
        ({"gains": {"stiffness": 60.0}}, SizeError, "'stiffness' has the wrong shape"),
        ({"plant": {"link_mas": 1.0}}, NameUnknownError, "'link_mas'.*try 'link_mass'"),
    ],
)
def test_what_makes_no_sense_is_refused(
    change: dict[str, Any], kind: type[PassiflexError], message: str
) -> None:
    with pytest.raises(kind, match=message):
        altered(problem(), **change)


def test_the_longest_delay_is_one_that_the_loop_can_hold() -> None:
    longest = altered(resolve(world()), delay=MOST_PERIODS * 1e-3)
    assert isinstance(longest, SampledProblem)
    assert longest.delay == MOST_PERIODS * 1e-3


def test_a_problem_in_continuous_time_cannot_be_altered() -> None:
    with pytest.raises(ValueRangeError, match="no control rate"):
        altered(resolve(world(control=None, tank=None)), rate=1e3)
