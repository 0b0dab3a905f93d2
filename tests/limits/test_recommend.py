"""Gains with a margin: they hold on robots that nobody tried before, make little noise, and fit into a scenario."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
import yaml

import passiflex
from passiflex.errors import NameUnknownError, PassiflexError, SizeError, ValueRangeError
from passiflex.limits import Recommendation, recommend
from passiflex.limits.recommend import FLOORS, NOISE_SHARE
from passiflex.limits.recommend_for import recommend_for
from passiflex.limits.robust import FIELDS, Family, Perturbation, perturbations, perturbed
from passiflex.limits.torque_noise import torque_by_noise
from passiflex.limits.workspace import workspace_postures
from passiflex.robots import FlexibleJointRobot
from passiflex.simulation import Problem, parse_scenario, resolve, simulate_problem
from passiflex.simulation.linear_loop import DrivenLoop, LinearLoop
from worlds import merged, world

RATE, DELAY, MARGIN = 1000.0, 1e-3, 0.2
IMPEDANCE: dict[str, Any] = {"task": "position", "stiffness": 200.0, "damping": 40.0}


@lru_cache
def robot() -> FlexibleJointRobot:
    return FlexibleJointRobot.load("planar2r")


@lru_cache
def gains(inner: str = "matched", margin: float = MARGIN) -> Recommendation:
    return recommend(robot(), RATE, DELAY, margin, inner_loop=inner, **IMPEDANCE)


def at(q: np.ndarray, inner: str, **changes: Any) -> Problem:
    """Return the planar arm there, with the gains that were recommended, written as recommended."""
    said = yaml.safe_load(gains(inner).snippet)
    said["law"]["shaped_inertia"]["ratio"] = None  # of the scenario that it replaces
    control = {"insist": True} | said["control"]
    return resolve(
        world(**merged({"posture": q, "law": said["law"], "control": control, "reference": []}, changes))
    )


# The margin


@pytest.mark.parametrize("inner", ["plain", "matched"])
def test_the_gains_hold_on_robots_that_were_not_tried(inner: str) -> None:
    rng = np.random.default_rng(4711)
    for q in gains(inner).postures:
        problem = at(q, inner)
        for i in range(4):
            factors = {name: 1 + rng.uniform(-MARGIN, MARGIN, 2) for name in FIELDS}
            loop = LinearLoop(perturbed(problem, Perturbation(f"{i}", factors, 0)))
            assert loop.radius(delay=DELAY + rng.uniform(-MARGIN, MARGIN) * 1e-3) < 1


@pytest.mark.parametrize("inner", ["plain", "matched"])
def test_the_gains_hold_in_the_nonlinear_simulation_of_the_worst_robot(inner: str) -> None:
    """After a push of 5 N the arm is at rest again, its joints hardly moving."""
    found = gains(inner)
    (case,) = (c for c in perturbations(2, MARGIN) if c.name == found.worst.perturbation)
    forces = [{"from": 0.0, "to": 0.1, "force": [5, 0, 3]}]
    run = simulate_problem(
        perturbed(at(found.postures[found.worst.posture], inner, forces=forces, duration=3), case)
    )
    assert run.failure == ""
    speed = np.abs(run["dq"]).max(axis=1)
    assert speed[-500:].max() < 0.02 * speed.max()


def test_without_the_margin_less_inertia_is_enough() -> None:
    """For the plain loop the margin decides; a tenth less and it does not hold.

    Without one it is the noise, which is loud so near to the border.
    """
    found, bare = gains("plain"), gains("plain", 0.0)
    assert set(found.decided_by) == {"margin"}
    assert set(bare.decided_by) <= {"margin", "noise"}
    assert (bare.shaped_inertia < found.shaped_inertia).all()
    problems = [at(q, "plain") for q in found.postures]
    family = Family.of(problems, perturbations(2, MARGIN))
    own = {"shaped_stiffness": found.shaped_stiffness, "shaped_inertia": found.shaped_inertia}
    assert family.stable(own)
    assert family.worst(own).stable
    lighter = own | {"shaped_inertia": 0.9 * found.shaped_inertia}
    assert not family.stable(lighter)
    assert family.worst(lighter).radius > 1


def test_the_worst_case_is_named() -> None:
    found = gains()
    assert found.worst.stable
    assert 0 <= found.worst.posture < len(found.postures)
    assert found.worst.perturbation in {c.name for c in perturbations(2, MARGIN)}
    case = next(c for c in perturbations(2, MARGIN) if c.name == found.worst.perturbation)
    loop = LinearLoop(perturbed(at(found.postures[found.worst.posture], "matched"), case))
    with_own = {"null_space_damping": np.array(5.0)}
    assert loop.radius(delay=DELAY + case.late * 1e-3, gains=with_own) == pytest.approx(
        found.worst.radius, rel=1e-9
    )


def test_a_margin_is_every_number_up_and_down_and_all_at_once() -> None:
    cases = perturbations(3, 0.1)
    names = [c.name for c in cases]
    assert names[0] == "nothing off"
    for name in FIELDS:
        for sign, factor in (("+", 1.1), ("−", 0.9)):
            case = cases[names.index(f"{name} {sign}10 %")]
            np.testing.assert_allclose(case.factors[name], np.full(3, factor))
            assert (set(case.factors), case.late) == ({name}, 0)
    assert sorted(c.late for c in cases if c.name.startswith("delay")) == [-0.1, 0.1]
    draws = [c for c in cases if c.name.startswith("draw")]
    assert len(draws) >= 3
    for case in draws:
        assert set(case.factors) == set(FIELDS)
        off = np.array([case.factors[name] for name in FIELDS]) - 1
        assert (np.abs(off) <= 0.1).all()
        assert np.ptp(off) > 0.05
        assert abs(case.late) <= 0.1
    assert perturbations(3, 0.1)[-1].late == cases[-1].late
    assert [c.name for c in perturbations(3, 0.0)] == ["nothing off"]


def test_only_the_robot_is_off_and_not_its_model() -> None:
    problem = at(gains().postures[0], "matched")
    case = Perturbation("all", {"link inertia": np.array([1.1, 0.9]), "B": np.array([1.2, 0.8])}, 0.0)
    other = perturbed(problem, case)
    layout = robot().layout
    before, after = (layout.unpack(p.plant) for p in (problem, other))
    np.testing.assert_allclose(after["motor_inertia"], before["motor_inertia"] * [1.2, 0.8])
    np.testing.assert_allclose(after["link_mass"], before["link_mass"] * [1.1, 0.9])
    np.testing.assert_allclose(after["link_inertia"], before["link_inertia"] * np.array([[1.1], [0.9]]))
    np.testing.assert_array_equal(after["link_com"], before["link_com"])
    np.testing.assert_array_equal(other.model, problem.model)
    np.testing.assert_array_equal(other.gains, problem.gains)


# Noise


@pytest.mark.parametrize("inner", ["plain", "matched"])
def test_the_noise_is_that_of_a_simulation(inner: str) -> None:
    """20 s of noise: with 20 000 samples the rms is known to half a percent, and a little more where they correlate."""
    problem = at(gains(inner).postures[0], inner, noise={"torque_variance": 0.2, "hold": 1e-3}, duration=20)
    simulated = simulate_problem(problem)["tau_m"][1000:].std(axis=0)
    expected = torque_by_noise(LinearLoop(problem).driven(), 0.2)
    np.testing.assert_allclose(simulated, expected, rtol=0.03)
    assert (expected <= gains(inner).torque_noise * 1.001).all()


def test_the_noise_stays_below_its_share_of_the_limit() -> None:
    found = gains()
    assert (found.torque_noise <= NOISE_SHARE * robot().torque_limit).all()
    assert (found.inertia_ratio >= FLOORS["matched"]).all()
    for why, ratio, noise, limit in zip(
        found.decided_by, found.inertia_ratio, found.torque_noise, robot().torque_limit, strict=True
    ):
        if why == "noise":
            assert noise > 0.9 * NOISE_SHARE * limit
        else:
            assert (why, ratio) == ("floor", pytest.approx(FLOORS["matched"], rel=0.01))
    loud = recommend(robot(), RATE, DELAY, MARGIN, torque_noise=0.8, **IMPEDANCE)
    assert (loud.shaped_inertia > found.shaped_inertia).all()
    assert set(loud.decided_by) == {"noise"}


def test_the_covariance_of_one_mode_is_known() -> None:
    """z⁺ = a z + g w, τ = c z + d w:  var τ = σ² (c² g² / (1 − a²) + d²)."""
    a, g, c, d = 0.9, 2.0, -1.5, 0.3
    loop = DrivenLoop(*(np.array([[v]]) for v in (a, g, c, d)))
    expected = np.sqrt(0.2 * (c**2 * g**2 / (1 - a**2) + d**2))
    np.testing.assert_allclose(torque_by_noise(loop, 0.2), expected, rtol=1e-12)


@pytest.mark.parametrize("drift", [np.eye(1), np.array([[1.0, 0.01], [0.0, 1.0]])], ids=["rest", "speed"])
def test_a_drift_that_calls_for_no_torque_is_taken_out(drift: np.ndarray) -> None:
    """Beside two modes, coupled into them and turned at random: what the modes do is unchanged."""
    rng = np.random.default_rng(3)
    k, modes = len(drift), np.array([[0.8, 0.3], [-0.3, 0.7]])
    G, C, D = rng.normal(size=(2, 2)), rng.normal(size=(2, 2)), rng.normal(size=(2, 2))
    alone = torque_by_noise(DrivenLoop(modes, G, C, D), 0.5)
    A = np.block([[modes, np.zeros((2, k))], [rng.normal(size=(k, 2)), drift]])
    T = rng.normal(size=(2 + k, 2 + k))
    inverse = np.linalg.inv(T)
    whole = DrivenLoop(
        T @ A @ inverse,
        T @ np.vstack([G, rng.normal(size=(k, 2))]),
        np.hstack([C, np.zeros((2, k))]) @ inverse,
        D,
    )
    np.testing.assert_allclose(torque_by_noise(whole, 0.5), alone, rtol=1e-6)


def test_a_loop_that_grows_makes_noise_without_bound() -> None:
    loop = DrivenLoop(np.array([[1.1]]), *(np.ones((1, 1)) for _ in range(3)))
    assert torque_by_noise(loop, 0.1) == np.inf


# Postures


@pytest.mark.parametrize(("name", "size"), [("iiwa14", 6), ("planar2r", 3)])
def test_the_postures_are_regular_within_the_limits_and_always_the_same(name: str, size: int) -> None:
    arm = FlexibleJointRobot.load(name)
    found = workspace_postures(arm, size)
    assert found.shape == (6, arm.n)
    assert ((found > arm.position_limit[:, 0]) & (found < arm.position_limit[:, 1])).all()
    np.testing.assert_array_equal(found, workspace_postures(arm, size))
    distances = np.linalg.norm(found[:, None] - found[None], axis=2)[np.triu_indices(6, 1)]
    assert distances.min() > 0.2
    for q in found:
        resolve(world(posture=q.tolist(), robot=name))


def test_a_robot_that_cannot_do_the_task_has_none() -> None:
    with pytest.raises(ValueRangeError, match=r"too few regular postures.*try postures of your own"):
        workspace_postures(robot(), 3, count=10_000)


# What it returns


def test_the_snippet_is_part_of_a_scenario_with_these_gains() -> None:
    for inner in ("plain", "matched"):
        found = gains(inner)
        problem = at(found.postures[0], inner)
        assert problem.sampling is not None
        numbers = problem.law.layout.unpack(problem.gains)
        np.testing.assert_allclose(numbers["shaped_inertia"], found.shaped_inertia, rtol=1e-9)
        np.testing.assert_array_equal(numbers["shaped_stiffness"], robot().joint_stiffness)
        assert (problem.sampling.period, problem.sampling.delay) == (1e-3, 1e-3)
        np.testing.assert_allclose(found.inertia_ratio, found.shaped_inertia / robot().motor_inertia)


def test_the_sentence_states_the_margin() -> None:
    found = gains()
    assert found.sentence.startswith(
        "planar2r at 1 kHz with 1 period of delay, inner loop matched: K_e = K and B_e = "
    )
    assert (
        "hold at 6 postures with B, K, D and the links' inertia off by 20 % and the delay by 0.2 periods"
        in found.sentence
    )
    assert f"radius at most {found.worst.radius:.5f}, at posture {found.worst.posture + 1}" in found.sentence
    assert passiflex.recommend is recommend


def test_a_scenario_brings_its_own_task_gains_sensors_and_posture() -> None:
    sensors = {"velocity": "differences", "velocity_filter": 300}
    control = {"inner_loop": "plain", "delay": 1e-3}
    found = recommend_for(world(control=control, sensors=sensors), MARGIN)
    assert found.inner_loop == "plain"
    np.testing.assert_array_equal(found.postures[0], [0.5, 0.8])
    assert len(found.postures) == 7
    assert (found.shaped_inertia > gains("plain").shaped_inertia).all()  # differences are late
    assert recommend_for(world(), MARGIN, "2 kHz", "0.5 ms").delay == 5e-4


def test_postures_of_ones_own_take_the_place_of_the_six() -> None:
    found = recommend("planar2r", "1 kHz", "1 ms", 0.1, postures=[0.5, 0.8], **IMPEDANCE)
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
