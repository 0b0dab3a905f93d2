"""Posture spring, wrenches, tracking and changes of stiffness in a run: what they do, what they cost, who pays."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
import yaml

from passiflex.control.posture import posture
from passiflex.control.tank import smoothstep
from passiflex.simulation import Run, Scenario, parse_scenario, resolve, simulate
from passiflex.studies import shipped_scenario
from worlds import books, merged, ran, same, world

MOTION = ("q", "theta", "dq", "dtheta", "tau_m", "commanded_torque", "held_stiffness", "governed_position")
QUIET: dict[str, Any] = {"noise": None, "sensors": None, "forces": [], "reference": []}


def iiwa(task: str, **changes: Any) -> Scenario:
    """Return the shipped sampled scenario of fig1 or fig2 with changes, and ideal sensors."""
    shipped = yaml.safe_load(shipped_scenario(f"{task}_sampled").to_yaml())
    return parse_scenario(yaml.safe_dump(merged(shipped, QUIET | changes)))


def self_motion(length: float) -> np.ndarray:
    """Return joint angles of the same end-effector pose, this far along the arm's self-motion [rad]."""
    problem = resolve(iiwa("fig1"))
    numbers = problem.law.robot.layout.unpack(problem.plant)

    def direction(q: np.ndarray) -> np.ndarray:
        null = np.linalg.svd(posture(problem.law.robot, q, numbers).jacobian)[2][-1]
        return null * np.sign(null[2])

    q, count = problem.q, 40
    for _ in range(count):
        middle = q + direction(q) * length / count / 2
        q = q + direction(middle) * length / count
    return q


def test_the_posture_spring_moves_the_elbow_and_not_the_hand() -> None:
    """0.2 rad of self-motion: 1 % is left after 4 s. The hand moves 3 mm on the way, as N turns with the arm.

    Without the spring nothing moves at all.
    """
    goal = self_motion(0.2)
    calm = {"duration": 5.0, "output_interval": 0.01}
    pulled = simulate(iiwa("fig1", **calm, actions={"posture_stiffness": 20, "posture": goal.tolist()}))
    left = np.linalg.norm(pulled["q"] - goal, axis=1)
    assert left[0] == pytest.approx(0.2, rel=1e-3)
    assert left[pulled.time > 4].max() < 0.02 * left[0]
    hand = np.linalg.norm(pulled["position"] - pulled["position"][0], axis=1)
    assert hand.max() < 4e-3
    assert hand[-1] < 1e-4
    free = simulate(iiwa("fig1", **calm))
    assert np.ptp(free["q"], axis=0).max() < 1e-9
    assert np.ptp(books(pulled)) < 1e-12


@pytest.mark.parametrize(
    "stiffness", [[20] * 7, [0, 0, 20, 0, 0, 0, 0], [1, 60, 5, 60, 1, 20, 3], [20, 0, 0, 0, 0, 0, 0]]
)
def test_the_posture_spring_rests_at_the_nearest_point(stiffness: list[float]) -> None:
    """A posture that no self-motion reaches: the arm ends where ½ dᵀ K_n d is least along its self-motion.

    Least by a walk along ker J that knows nothing of the law: 0.02 rad is what the walk's steps and the last of the
    motion leave. A spring on the first joint alone is slack from the start, and moves nothing.
    """
    problem = resolve(iiwa("fig1"))
    goal = problem.q + np.radians(30) * np.eye(7)[2]
    actions = {"posture_stiffness": stiffness, "posture": goal.tolist()}
    run = simulate(iiwa("fig1", actions=actions, duration=8.0, output_interval=0.01))
    places = np.array([self_motion(s) for s in np.arange(-0.8, 0.81, 0.04)])
    distance = ((places - goal) ** 2 @ np.array(stiffness)) / 2
    low = int(np.argmin(distance))
    assert 0 < low < len(places) - 1
    a, b, _ = np.polyfit([-1, 0, 1], distance[low - 1 : low + 2], 2)
    nearest = places[low] - b / (2 * a) * (places[low + 1] - places[low])
    np.testing.assert_allclose(run["q"][-1], nearest, rtol=0, atol=0.02)
    if not stiffness[2]:
        assert np.ptp(run["q"], axis=0).max() < 1e-9


FORCE = np.array([6.0, 0.0, -8.0])


def test_a_feedforward_wrench_presses_with_what_was_asked() -> None:
    """Against its own spring only, the arm goes to x_d + K_x⁻¹ F, and stays there with no torque at the joints.

    That is where the same force from outside takes it, but for the joints' deflection by F.
    """
    press = [{"from": 0.1, "to": 9.0, "force": FORCE}]
    run = ran(feedforward=press, reference=[], duration=5.0, output_interval=0.01)
    assert run["valve"].min() == 1
    moved = run["position"][-1] - run["position"][0]
    np.testing.assert_allclose(moved, FORCE / 200, rtol=0, atol=1e-6)
    assert np.abs(run["tau_a"][-1]).max() < 1e-4
    pushed = ran(forces=press, reference=[], duration=5.0, output_interval=0.01)
    np.testing.assert_allclose(
        pushed["position"][-1] - pushed["position"][0], moved, rtol=0, atol=10 * 10 / 5000
    )


def test_following_the_reference_takes_most_of_the_lag_away() -> None:
    """Fig. 2's circle in y and z: 66 mm without, 31 mm with D_x ẋ_d, 4.8 mm with Λ ẍ_d as well."""
    turn = [{"at": 0.5, "kind": "circle", "plane": ["y", "z"], "radius": 0.1, "period": 4.0}]
    lags = []
    for velocity, acceleration in ((0, 0), (1, 0), (1, 1)):
        actions = {"follow_velocity": velocity, "follow_acceleration": acceleration}
        run = simulate(iiwa("fig2", reference=turn, duration=8.5, output_interval=0.01, actions=actions))
        assert run["valve"].min() == run["reference_share"].min() == 1
        error = (run["position"] - run["desired_position"])[run.time > 4.5, 1:]
        lags.append(np.sqrt((error**2).sum(axis=1).mean()))
    assert lags[1] < 0.5 * lags[0]
    assert lags[2] < 0.1 * lags[0]


# Another stiffness in flight

PUSHED: dict[str, Any] = {
    "reference": [],
    "forces": [{"from": 0.0, "to": 9.0, "force": [10, 0, -10]}],
    "duration": 2.4,
    "tank": {"initial": 5},
}
BEFORE = 200.0


def change(stiffness: float, duration: float, damping: float = 70.0) -> dict[str, Any]:
    gains = {"stiffness": {"translation": stiffness}, "damping": {"translation": damping}}
    return {"gains": [{"at": 2.0, "duration": duration, **gains}]}


@lru_cache
def changed(stiffness: float, duration: float) -> Run:
    return ran(**merged(PUSHED, change(stiffness, duration)))


@lru_cache
def deflection(stiffness: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """Return f(φ) − x̂_d (N, 3) and J(φ) (N, 3, n) along a run."""
    run, problem = changed(stiffness, duration), resolve(world())
    numbers = problem.law.robot.layout.unpack(problem.plant)
    seen = [posture(problem.law.robot, phi, numbers) for phi in run["phi"]]
    at = np.array([s.pose.position for s in seen])
    return at - run["governed_position"], np.array([s.jacobian[:3] for s in seen])


@pytest.mark.parametrize(("stiffness", "duration"), [(600, 0.3), (600, 1e-3), (60, 0.3)])
def test_a_change_of_stiffness_costs_what_it_stores(stiffness: float, duration: float) -> None:
    """Σ ½ eᵀ ΔK e at the deflection of each period: taken from the tank, or given back to it."""
    run, (e, _) = changed(stiffness, duration), deflection(stiffness, duration)
    steps = np.diff(run["held_stiffness"], axis=0)
    cost = np.einsum("ki,kij,kj->k", e[1:], steps, e[1:]) / 2
    np.testing.assert_allclose(run["reference_energy"][1:], np.cumsum(cost), rtol=0, atol=1e-12)
    np.testing.assert_allclose(run["granted_energy"][1:], np.cumsum(np.maximum(cost, 0)), rtol=0, atol=1e-12)
    assert np.ptp(books(run)) < 1e-12
    if duration == 1e-3:  # all at once, and nearly from rest: ½ ΔK |F/K|²
        assert run["granted_energy"][-1] == pytest.approx(400 / 2 * 200 / BEFORE**2, rel=5e-3)
    np.testing.assert_array_equal(run["held_stiffness"][-1], stiffness * np.eye(3))


@pytest.mark.parametrize("stiffness", [600, 60])
def test_a_change_of_stiffness_makes_no_bump(stiffness: float) -> None:
    """From one period to the next the torque changes by the change's own B/B_e |Jᵀ ΔK e| at most, and by a hundredth
    of that at its two ends, where a minimum-jerk change has no speed. All at once, it jumps by 27 N m and more.
    """
    still = ran(**PUSHED)
    ordinary = jumps(still)[1900:].max()
    run, (e, J) = changed(stiffness, 0.3), deflection(stiffness, 0.3)
    steps = np.diff(run["held_stiffness"], axis=0)
    own = np.abs(np.einsum("kji,kjl,kl->ki", J[1:], steps, e[1:])).max(axis=1) / 0.3
    late = jumps(run)[1990:]
    assert late.max() <= ordinary + own.max()
    at_ends = np.r_[2000 - 3 : 2000 + 3, 2300 - 3 : 2300 + 3]
    beyond = np.abs(jumps(run)[at_ends] - jumps(run)[at_ends - 6])
    assert beyond.max() < 0.01 * own.max()
    assert jumps(changed(stiffness, 1e-3))[1990:].max() > 27


def jumps(run: Run) -> np.ndarray:
    """Return by how much the command changes from one period to the next, at the joint where that is most [N m]."""
    return np.abs(np.diff(run["commanded_torque"], axis=0)).max(axis=1)


# Who pays

FLOOR, LOW = 0.1, 0.2
CHANGED = {"gains": [{"at": 0.7, "duration": 0.2, "stiffness": {"translation": 400}}]}
EVERYTHING: dict[str, Any] = {
    "law": {"regularisation": 0.1},  # Λ ẍ_d would be without bound where the circle stretches the arm out
    "actions": {
        "posture_stiffness": 20,
        "posture": [0.7, 1.0],
        "follow_velocity": 1,
        "follow_acceleration": 1,
    },
    "feedforward": [{"from": 0.3, "to": 1.0, "force": [5, 0, 5]}],
    "reference": [
        {"at": 0.2, "kind": "step", "by": [0, 0, 0.05]},
        {"at": 0.5, "kind": "circle", "plane": ["x", "z"], "radius": 0.05, "period": 1.0},
    ],
    "motors": {"torque_limit": "robot"},
    "duration": 1.5,
}


def test_with_an_empty_tank_nothing_is_done_for_nothing() -> None:
    """1e-12 J above the floor: β = 0, the reference stays, and so does the arm. With 5 J all of it happens."""
    run = ran(**EVERYTHING, tank={"initial": FLOOR + 1e-12, "floor": FLOOR, "low": LOW})
    assert run["valve"].max() < 1e-20
    assert np.ptp(run["governed_position"], axis=0).max() < 1e-6
    assert np.ptp(run["q"], axis=0).max() < 1e-6
    assert run["lowest_level"][-1] >= FLOOR - 1e-15
    assert run["governed_time"][-1] > 1.2
    rich = ran(**EVERYTHING, tank={"initial": 5})
    assert np.ptp(rich["governed_position"], axis=0).max() > 0.09
    assert np.ptp(rich["q"], axis=0).max() > 0.2


def test_a_stiffness_that_nobody_can_pay_is_held_back() -> None:
    """20 mJ where 1 J is asked for: K̂ rises until they are spent, and the spring never holds more than was paid."""
    tank = {"initial": FLOOR + 0.02, "floor": FLOOR, "low": 0.11, "cap": 0.121}
    run = ran(**merged(PUSHED, change(600, 0.3) | {"tank": tank}))
    assert run["stiffness_share"].min() < 0.1
    reached = run["held_stiffness"][:, 0, 0]
    assert BEFORE + 5 < reached[-1] < 250
    assert (np.diff(reached) >= 0).all()
    assert run["granted_energy"][-1] < 0.05
    assert_never_paid_below(run, FLOOR)


def assert_never_paid_below(run: Run, floor: float) -> None:
    """After a grant the level, less its bound, is never below the floor; only the port can take it there."""
    granting = np.append(False, np.diff(run["granted_energy"]) > 0)
    assert granting.any()
    sure = run["tank_energy"] - run["measurement_bound"]
    assert sure[granting].min() >= floor - 1e-15


@pytest.mark.parametrize("initial", [0.11, 0.15, 0.3, 1.0])
def test_a_poor_tank_pays_down_to_its_floor_and_no_further(initial: float) -> None:
    """Everything at once: the valve is that of the level less its bound, motors stay in their limits, books close."""
    run = ran(**EVERYTHING, **CHANGED, tank={"initial": initial, "floor": FLOOR, "low": LOW})
    assert not run.failure
    assert not run["latched"].any()
    assert_never_paid_below(run, FLOOR)
    level = run["tank_energy"] - run["measurement_bound"]
    expected = [float(smoothstep((T - FLOOR) / (LOW - FLOOR))) for T in level]
    np.testing.assert_allclose(run["valve"], expected, rtol=0, atol=1e-12)
    assert (np.abs(run["tau_m"]) <= [100, 50]).all()
    assert np.ptp(books(run)) < 1e-12


@pytest.mark.parametrize(
    "tank",
    [
        {"initial": 50},
        {"initial": 50, "accounting": "paper"},
        {"initial": 50, "floor": 1, "low": 2, "cap": 60},
    ],
)
def test_a_full_tank_changes_nothing_of_the_motion(tank: dict[str, Any]) -> None:
    """Bit for bit, whatever its level and accounting; and another kind of tank moves the arm as well, to round-off."""
    usual = ran(**EVERYTHING, tank={"initial": 20})
    run = ran(**EVERYTHING, tank=tank)
    for name in MOTION:
        np.testing.assert_array_equal(run[name], usual[name])
    assert not same(run, usual)
    paper = ran(**EVERYTHING, tank={"kind": "paper", "initial": 50})
    for name in MOTION:
        np.testing.assert_allclose(paper[name], usual[name], rtol=0, atol=1e-9)
