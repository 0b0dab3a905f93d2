"""Gains with a margin: they hold on robots that nobody tried before, make little noise, and fit into a scenario."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
import yaml

import passiflex
from passiflex.control.task import AbstractTask, PoseTask, PositionTask
from passiflex.errors import NameUnknownError, PassiflexError, SizeError, ValueRangeError
from passiflex.limits import Recommendation, check, recommend
from passiflex.limits.inertia_search import FLOORS, NOISE_SHARE
from passiflex.limits.margin_box import MarginBox, Member
from passiflex.limits.recommend_for import recommend_for
from passiflex.limits.torque_noise import rms_torque, torque_by_noise
from passiflex.limits.workspace import workspace_postures
from passiflex.problems.problem import SampledProblem
from passiflex.robots import FlexibleJointRobot
from passiflex.simulation import Problem, parse_scenario, resolve, simulate, simulate_problem
from passiflex.stability.driven_loop import DrivenLoop
from passiflex.stability.linear_loop import LinearLoop
from worlds import merged, world

RATE, DELAY, MARGIN = 1000.0, 1e-3, 0.2
IMPEDANCE: dict[str, Any] = {"task": "position", "stiffness": 200.0, "damping": 40.0}


@lru_cache
def robot() -> FlexibleJointRobot:
    return FlexibleJointRobot.load("planar2r")


@lru_cache
def gains(inner: str = "matched", margin: float = MARGIN) -> Recommendation:
    return recommend(robot(), RATE, DELAY, margin, inner_loop=inner, **IMPEDANCE)


def pasted(found: Recommendation, q: np.ndarray, **changes: Any) -> dict[str, Any]:
    """Return a scenario at a posture with the recommended sections in place of its own."""
    data = yaml.safe_load(world(reference=[]).to_yaml())
    return merged(data | yaml.safe_load(found.snippet) | {"posture": q.tolist()}, changes)


def at(q: np.ndarray, inner: str, **changes: Any) -> Problem:
    return resolve(parse_scenario(yaml.safe_dump(pasted(gains(inner), q, **changes))))


# The margin


@pytest.mark.parametrize("inner", ["plain", "matched"])
def test_the_gains_hold_on_robots_that_were_not_tried(inner: str) -> None:
    """500 members of the box with seeds of their own: corners of it, and anywhere in it."""
    found = gains(inner)
    box = MarginBox(tuple(at(q, inner) for q in found.postures), MARGIN)
    radii = [box.radius(m, {}) for i in range(6) for m in box.drawn(i, 84, seed=4711)]
    assert len(radii) > 500
    assert max(radii) < 1
    assert max(radii) <= found.worst.radius


def test_a_corner_at_which_gains_were_once_sold_as_safe_is_refused_or_borne() -> None:
    """The docs' example: B −, K +, D −, links −, late; its old B_e trembles there, the new one does not."""
    found = gains()
    box = MarginBox(tuple(at(q, "matched") for q in found.postures), MARGIN)
    corner = (-1.0,) * 2 + (1.0,) * 2 + (-1.0,) * 2 + (-1.0,) * 2 + (1.0, 0.0, 0.0)
    light = {"shaped_inertia": 0.03 * robot().motor_inertia}
    assert max(box.radius(Member(i, corner), light) for i in range(6)) > 1
    assert max(box.radius(Member(i, corner), {}) for i in range(6)) < 1


def test_the_worst_member_comes_to_rest_in_the_nonlinear_loop() -> None:
    """After a push of 5 N the arm is at rest again, its joints hardly moving."""
    found = gains("plain")
    box = MarginBox(tuple(at(q, "plain") for q in found.postures), MARGIN)
    member = found.worst.member
    names = ("motor_inertia", "joint_stiffness", "joint_damping", "link_inertia")
    deviations = dict(zip(names, (MARGIN * np.array(member.off[:8]).reshape(4, 2)).tolist(), strict=True))
    late = DELAY + MARGIN * member.off[8] * 1e-3
    problem = at(
        box.angles(member),
        "plain",
        forces=[{"from": 0.0, "to": 0.1, "force": [5, 0, 3]}],
        duration=3,
        deviations=deviations,
        control={"delay": late},
    )
    run = simulate_problem(problem)
    assert run.failure == ""
    speed = np.abs(run["dq"]).max(axis=1)
    assert speed[-500:].max() < 0.02 * speed.max()


def test_without_the_margin_less_inertia_is_enough_and_a_sixth_less_than_needed_does_not_hold() -> None:
    found, bare = gains("plain"), gains("plain", 0.0)
    assert set(found.decided_by) == {"margin"}
    assert (bare.shaped_inertia < found.shaped_inertia).all()
    box = MarginBox(tuple(at(q, "plain") for q in found.postures), MARGIN)
    lighter = {"shaped_inertia": 0.85 * found.shaped_inertia}
    assert max(box.search(lighter, i) for i in range(6)).radius > 1


def test_where_nothing_holds_the_largest_margin_is_said() -> None:
    with pytest.raises(
        ValueRangeError, match=r"no B_e holds with this margin; got margin 0.3: .*; try a margin of 0\.\d+ "
    ):
        recommend("planar2r", 200.0, 0.01, 0.3, inner_loop="plain", **IMPEDANCE)


# The better loop


def test_both_inner_loops_are_tried_and_the_lighter_is_named_with_the_reason() -> None:
    found = recommend(robot(), RATE, DELAY, MARGIN, **IMPEDANCE)
    assert found.inner_loop == "matched"
    np.testing.assert_array_equal(found.shaped_inertia, gains("matched").shaped_inertia)
    share = np.exp(np.log(gains("plain").inertia_ratio / found.inertia_ratio).mean())
    said = re.fullmatch(r"the plain inner loop needs at least (\S+) times as much B_e", found.other)
    assert said
    assert 1 <= float(said[1]) <= 1.05 * share
    assert found.other in found.sentence


# Noise


@pytest.mark.parametrize("inner", ["plain", "matched"])
def test_the_noise_is_that_of_a_simulation(inner: str) -> None:
    """20 s of noise: with 20 000 samples the rms is known to half a percent, and a little more where they correlate."""
    problem = at(gains(inner).postures[0], inner, noise={"torque_variance": 0.2, "hold": 1e-3}, duration=20)
    simulated = simulate_problem(problem)["tau_m"][1000:].std(axis=0)
    expected = torque_by_noise(LinearLoop(problem), 0.2)
    np.testing.assert_allclose(simulated, expected, rtol=0.03)
    assert (expected <= gains(inner).torque_noise * 1.001).all()


def test_the_noise_stays_below_its_share_of_the_limit() -> None:
    found = gains()
    assert (found.torque_noise <= NOISE_SHARE * robot().torque_limit).all()
    assert (found.inertia_ratio >= FLOORS["matched"]).all()
    loud = recommend(robot(), RATE, DELAY, MARGIN, torque_noise=0.8, inner_loop="matched", **IMPEDANCE)
    assert (loud.shaped_inertia > found.shaped_inertia).all()
    assert "noise" in loud.decided_by
    assert (loud.torque_noise <= NOISE_SHARE * robot().torque_limit).all()


def test_the_covariance_of_one_mode_is_known() -> None:
    """z⁺ = a z + g w, τ = c z + d w:  var τ = σ² (c² g² / (1 − a²) + d²)."""
    a, g, c, d = 0.9, 2.0, -1.5, 0.3
    loop = DrivenLoop(*(np.array([[v]]) for v in (a, g, c, d)))
    expected = np.sqrt(0.2 * (c**2 * g**2 / (1 - a**2) + d**2))
    np.testing.assert_allclose(rms_torque(loop, 0.2), expected, rtol=1e-12)


@pytest.mark.parametrize("drift", [np.eye(1), np.array([[1.0, 0.01], [0.0, 1.0]])], ids=["rest", "speed"])
def test_a_drift_that_calls_for_no_torque_is_taken_out(drift: np.ndarray) -> None:
    """Beside two modes, coupled into them and turned at random: what the modes do is unchanged."""
    rng = np.random.default_rng(3)
    k, modes = len(drift), np.array([[0.8, 0.3], [-0.3, 0.7]])
    G, C, D = rng.normal(size=(2, 2)), rng.normal(size=(2, 2)), rng.normal(size=(2, 2))
    alone = rms_torque(DrivenLoop(modes, G, C, D), 0.5)
    A = np.block([[modes, np.zeros((2, k))], [rng.normal(size=(k, 2)), drift]])
    T = rng.normal(size=(2 + k, 2 + k))
    inverse = np.linalg.inv(T)
    whole = DrivenLoop(
        T @ A @ inverse,
        T @ np.vstack([G, rng.normal(size=(k, 2))]),
        np.hstack([C, np.zeros((2, k))]) @ inverse,
        D,
    )
    np.testing.assert_allclose(rms_torque(whole, 0.5, np.ones(k)), alone, rtol=1e-6)


def test_a_loop_that_grows_makes_noise_without_bound() -> None:
    loop = LinearLoop(at(gains().postures[0], "matched"))
    assert (
        torque_by_noise(loop, 0.2, gains={"shaped_inertia": 0.001 * robot().motor_inertia}, delay=4e-3)
        == np.inf
    ).all()


# Postures


@pytest.mark.parametrize(("name", "task"), [("iiwa14", PoseTask()), ("planar2r", PositionTask())])
def test_the_postures_are_regular_within_the_limits_and_always_the_same(
    name: str, task: AbstractTask
) -> None:
    arm = FlexibleJointRobot.load(name)
    found = workspace_postures(arm, task)
    assert found.shape == (6, arm.n)
    assert ((found > arm.position_limit[:, 0]) & (found < arm.position_limit[:, 1])).all()
    np.testing.assert_array_equal(found, workspace_postures(arm, task))
    distances = np.linalg.norm(found[:, None] - found[None], axis=2)[np.triu_indices(6, 1)]
    assert distances.min() > 0.2
    for q in found:
        resolve(world(posture=q.tolist(), robot=name))


def test_a_robot_that_cannot_do_the_task_has_none() -> None:
    with pytest.raises(ValueRangeError, match=r"too few regular postures.*try postures of your own"):
        workspace_postures(robot(), PositionTask(), count=10_000)


# What it returns


@pytest.mark.parametrize("inner", ["plain", "matched"])
def test_the_snippet_is_accepted_as_it_is(inner: str) -> None:
    """By `limits` and by `simulate`, with tank, fallback, sensors and output interval, at postures it was made for."""
    found = gains(inner)
    for q in found.postures[:2]:
        scenario = parse_scenario(yaml.safe_dump(pasted(found, q, duration=0.01)))
        assert check(scenario).stable
        assert simulate(scenario).failure == ""
        problem = resolve(scenario)
        numbers = problem.law.layout.unpack(problem.gains)
        np.testing.assert_allclose(numbers["shaped_inertia"], found.shaped_inertia, rtol=1e-9)
        np.testing.assert_array_equal(numbers["shaped_stiffness"], robot().joint_stiffness)
        assert isinstance(problem, SampledProblem)
        assert (problem.period, problem.delay) == (1e-3, 1e-3)
        np.testing.assert_allclose(found.inertia_ratio, found.shaped_inertia / robot().motor_inertia)


def test_a_fallback_that_would_not_hold_is_replaced() -> None:
    """At 125 Hz the matched loop with B_e = B does not hold on the box; what is pasted does."""
    found = recommend(robot(), 125.0, 8e-3, 0.1, inner_loop="matched", **IMPEDANCE)
    data = pasted(found, found.postures[0], duration=0.1, tank={"kind": "port"})
    assert check(parse_scenario(yaml.safe_dump(data))).stable


def test_the_sentence_states_the_margin_and_what_was_searched() -> None:
    found = gains()
    first, second, third, fourth = found.sentence.splitlines()
    assert first.startswith("planar2r at 1 kHz with 1 period of delay: K_e = K and B_e = ")
    assert second == (
        "hold at 6 postures and within 0.3 rad of them with B, K, D and the links' inertia of each joint off by up "
        "to 20 % and the delay by 0.2 periods"
    )
    assert f"radius {found.worst.radius:.5f} at posture {found.worst.member.posture + 1} with B " in third
    assert "of its limit" in fourth
    assert passiflex.recommend is recommend


def test_a_scenario_brings_its_own_task_gains_sensors_and_posture() -> None:
    sensors = {"velocity": "differences", "velocity_filter": 300}
    found = recommend_for(world(control={"delay": 1e-3}, sensors=sensors), MARGIN, inner_loop="plain")
    assert found.inner_loop == "plain"
    np.testing.assert_array_equal(found.postures[0], [0.5, 0.8])
    assert len(found.postures) == 7
    assert np.prod(found.inertia_ratio) > np.prod(gains("plain").inertia_ratio)  # differences are late
    assert yaml.safe_load(found.snippet)["sensors"]["velocity_filter"] == 300
    assert recommend_for(world(), 0.0, "2 kHz", "0.5 ms", inner_loop="plain").delay == 5e-4


def test_postures_of_ones_own_take_the_place_of_the_six() -> None:
    found = recommend("planar2r", "1 kHz", "1 ms", 0.1, postures=[0.5, 0.8], inner_loop="plain", **IMPEDANCE)
    np.testing.assert_array_equal(found.postures, [[0.5, 0.8]])


# Refusals

RIGID = {
    "type": "rigid",
    "task": "position",
    "gravity": "robot",
    "stiffness": {"translation": 60},
    "damping": {"translation": 20},
    "target_inertia": {"damping_ratio": 0.7},
}


@pytest.mark.parametrize(
    ("told", "kind", "message"),
    [
        ({"margin": 1.0}, ValueRangeError, "margin; got 1; needs 0 to below 1, as 0.2 for 20 %"),
        ({"margin": -0.1}, ValueRangeError, "margin; got -0.1"),
        ({"margin": float("nan")}, ValueRangeError, "margin; got nan"),
        ({"rate": "slow"}, ValueRangeError, "rate; got 'slow'"),
        ({"delay": -1e-3}, ValueRangeError, "delay; got -0.001"),
        ({"inner_loop": "match"}, NameUnknownError, "unknown inner loop; got 'match'.*try 'matched'"),
        ({"task": "posee"}, NameUnknownError, "unknown task; got 'posee'.*try 'pose'"),
        ({"robot": "planar"}, NameUnknownError, "try 'planar2r'"),
        ({"torque_noise": -1.0}, ValueRangeError, "torque_noise; got -1"),
        ({"postures": [[0.1, 0.2, 0.3]]}, SizeError, r"postures; got \(1, 3\); needs \(postures, 2\)"),
        (
            {"rate": 30.0, "delay": 0.06, "inner_loop": "plain"},
            ValueRangeError,
            "no B_e holds with this margin",
        ),
    ],
)
def test_what_makes_no_sense_is_refused(
    told: dict[str, Any], kind: type[PassiflexError], message: str
) -> None:
    with pytest.raises(kind, match=message):
        recommend(**{"robot": "planar2r", "rate": RATE, "delay": DELAY} | IMPEDANCE | told)


def test_the_rigid_law_shapes_nothing_that_could_be_recommended() -> None:
    data = {
        "name": "rigid",
        "robot": "iiwa14",
        "posture": [0, 0.6, 0, -1.2, 0, 1, 0],
        "law": RIGID,
        "duration": 0.1,
    }
    with pytest.raises(ValueRangeError, match="the rigid law has no K_e and B_e to recommend"):
        recommend_for(parse_scenario(yaml.safe_dump(data)), MARGIN, 1000.0)
