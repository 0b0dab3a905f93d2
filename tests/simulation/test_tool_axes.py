"""Gains in tool axes: the same matrices turned with the reference, paid for by the tank, and exact."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import passiflex as pf
from passiflex.control.tool_axes import damping_in_world, stiffness_in_world
from passiflex.errors import ScenarioError
from passiflex.problems.altered import altered
from passiflex.problems.problem import SampledProblem
from passiflex.problems.resolution import resolve
from passiflex.runs.run import Run
from passiflex.simulation import Scenario, parse_scenario
from passiflex.simulation.batch import simulate_in_lane
from worlds import books, same, world

K_T, K_O = np.array([900.0, 300.0, 150.0]), [30.0, 20.0, 10.0]
LAW: dict[str, Any] = {
    "type": "impedance",
    "task": "pose",
    "gravity": "robot",
    "shaped_stiffness": {"ratio": 1},
    "shaped_inertia": {"ratio": 0.3},
    "stiffness": {"translation": K_T, "rotation": K_O},
    "damping": {"translation": None, "ratio": 0.7},
}
BASE: dict[str, Any] = {
    "robot": "iiwa14",
    "posture": [0, 0.6, 0.2, -1.2, 0.1, 1, 0.3],
    "law": LAW,
    "tank": {"initial": 3},
    "reference": [],
}
TURN = {"at": 0.1, "kind": "move", "turn": [0, 0.5, 0.4], "duration": 0.3}


def scenario(axes: str = "tool", **changes: Any) -> Scenario:
    return world(**over(over(BASE, {"law": {"stiffness": {"axes": axes}}}), changes))


def over(data: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Return the data with changes; None stays, for `world` to leave out what it would have had."""
    out = dict(data)
    for name, value in changes.items():
        both = isinstance(value, dict) and isinstance(out.get(name), dict)
        out[name] = over(out[name], value) if both else value
    return out


def in_world(run: Run, K: np.ndarray) -> np.ndarray:
    return np.array([stiffness_in_world(K, R) for R in run["desired_rotation"]])


def test_the_stiffness_turns_with_the_reference() -> None:
    run = pf.simulate(scenario(reference=[TURN]))
    K = np.diag([*K_T, *K_O])
    wanted = in_world(run, K)
    granted = run["stiffness_share"] == 1
    assert granted.all()
    np.testing.assert_allclose(run["held_stiffness"], wanted, rtol=0, atol=1e-9)
    assert np.abs(wanted[-1] - wanted[0])[:3, :3].max() > 100
    np.testing.assert_array_equal(run["held_stiffness"][:, :3, 3:], 0)
    np.testing.assert_allclose(
        run["held_stiffness"][:, 3:, 3:], np.broadcast_to(np.diag(K_O), (601, 3, 3)), atol=1e-12
    )


def test_the_books_close_and_what_a_turn_stores_is_paid_for() -> None:
    """A push that deflects the hand: turning the stiffness then changes its energy."""
    push = [{"from": 0.0, "to": 9.0, "force": [15, -10, 20]}]
    run = pf.simulate(scenario(reference=[TURN], forces=push))
    still = pf.simulate(scenario("world", reference=[TURN], forces=push))
    assert np.ptp(books(run)) < 1e-10
    assert abs(run["reference_energy"][-1] - still["reference_energy"][-1]) > 1e-3
    assert pf.audit(run).verdict == "passive"


def test_an_empty_tank_does_not_let_it_turn() -> None:
    push = [{"from": 0.0, "to": 9.0, "force": [60, -40, 60]}]
    poor = {"initial": 0.2001, "floor": 0.2, "low": 0.3, "cap": 0.31, "trip": 0.01}
    run = pf.simulate(scenario(reference=[TURN], forces=push, tank=poor))
    assert run["stiffness_share"].min() < 1 or run["reference_share"].min() < 1
    assert pf.audit(run).verdict == "passive"
    assert np.ptp(books(run)) < 1e-10


def test_a_stiffness_alike_in_all_directions_is_the_same_in_either_axes() -> None:
    alike = {"law": {"stiffness": {"translation": 300}}, "reference": [TURN]}
    one, other = pf.simulate(scenario("tool", **alike)), pf.simulate(scenario("world", **alike))
    np.testing.assert_allclose(one["q"], other["q"], rtol=0, atol=1e-12)


def test_the_start_is_at_rest_with_gains_of_the_tool() -> None:
    run = pf.simulate(scenario())
    assert np.ptp(run["q"], axis=0).max() < 1e-9
    assert run["granted_energy"][-1] < 1e-12


@pytest.mark.parametrize("free", [False, True])
def test_damping_in_tool_axes_turns_too(free: bool) -> None:
    rotation, law = ([5.0, 4.0, 0.0 if free else 3.0], dict(LAW))
    D = np.diag([60.0, 30.0, 20.0, *rotation])
    law["stiffness"] = {"translation": K_T, "rotation": [30, 20, 0 if free else 10]}
    law["damping"] = {"translation": [60, 30, 20], "rotation": rotation, "axes": "tool"}
    problem = resolve(world(**BASE | {"law": law}))
    assert isinstance(problem, SampledProblem)
    R = problem.home.rotation
    gains = problem.law.layout.unpack(problem.gains)
    np.testing.assert_allclose(gains["damping"], damping_in_world(D, R, turned=free), atol=1e-9)
    (change,) = problem.told_gains
    np.testing.assert_allclose(change.damping, gains["damping"], atol=1e-9)
    np.testing.assert_allclose(change.stiffness, gains["stiffness"], atol=1e-9)
    if not free:
        W = np.kron(np.eye(2), R)
        np.testing.assert_allclose(gains["damping"], W @ D @ W.T, atol=1e-12)


def test_a_change_and_a_table_may_be_in_tool_axes() -> None:
    change = {
        "at": 0.2,
        "duration": 0.1,
        "stiffness": {"translation": K_T / 2, "rotation": K_O, "axes": "tool"},
    }
    changed = pf.simulate(scenario("world", reference=[TURN], gain_changes=[change]))
    K = np.diag([*K_T, *K_O])
    np.testing.assert_allclose(changed["held_stiffness"][0], K, atol=1e-12)
    half = np.diag([*K_T / 2, *K_O])
    np.testing.assert_allclose(changed["held_stiffness"][-1], in_world(changed, half)[-1], atol=1e-9)
    numbers = ",".join(map(repr, np.diag(half).tolist()))
    rows = {"rows": f"t,kx,ky,kz,krx,kry,krz\n0.2,{numbers}\n", "axes": "tool", "between": "held"}
    tabled = pf.simulate(scenario("world", reference=rows))
    np.testing.assert_array_equal(tabled["held_stiffness"][150], K)
    np.testing.assert_allclose(tabled["held_stiffness"][-1], in_world(tabled, half)[-1], atol=1e-9)


def test_alone_in_lanes_and_by_its_own_text_it_is_the_same_run() -> None:
    given = scenario(reference=[TURN])
    run = pf.simulate(given)
    assert same(pf.simulate(parse_scenario(given.to_yaml())), run)
    problem = resolve(given)
    assert isinstance(problem, SampledProblem)
    lane = simulate_in_lane(problem)
    for name in ("q", "held_stiffness", "tank_energy"):
        np.testing.assert_allclose(lane[name], run[name], rtol=1e-9, atol=1e-10)


def test_altered_gains_are_those_of_the_world() -> None:
    problem = altered(resolve(scenario()), gains={"stiffness": np.diag([200.0, 300, 400, 9, 9, 9])})
    assert not problem.gain_changes
    again = resolve(parse_scenario(problem.text))
    np.testing.assert_array_equal(again.gains, problem.gains)
    assert altered(resolve(scenario()), rate=2000.0).gain_changes


def test_turning_axes_are_those_of_the_reference() -> None:
    R = Rotation.from_rotvec([0, 0, np.pi / 2]).as_matrix()
    K = np.diag([1.0, 2, 3])
    np.testing.assert_allclose(stiffness_in_world(K, R), np.diag([2.0, 1, 3]), atol=1e-15)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"control": None, "tank": None},
            "law.stiffness.axes: tool needs `control`, in which each turn of them is paid for",
        ),
        (
            {"law": {"damping": {"axes": "tool"}}},
            "law.damping.axes: a ratio has no axes; remove it, or give the numbers",
        ),
        (
            {"law": {"stiffness": {"translation": [0, 1, 1]}, "damping": {"ratio": 0.7}}},
            "law.stiffness.axes: a free translation is one of the world; remove it, or hold all three",
        ),
        (
            {"control": {"fallback": {"stiffness": {"translation": 9, "rotation": 9, "axes": "tool"}}}},
            "control.fallback.stiffness.axes: the fallback holds one pose; give its gains in axes of the world",
        ),
        ({"law": {"stiffness": {"axes": "tol"}}}, "law.stiffness.axes: unknown word 'tol'; try 'tool'"),
        (
            {
                "law": {"stiffness": {"translation": [0, 1, 1], "axes": "world"}, "damping": {"ratio": 0.7}},
                "reference": {"rows": "t,kx,ky,kz,krx,kry,krz\n0,0,9,9,1,1,1\n", "axes": "tool"},
            },
            "reference[0].axes: a free translation is one of the world; remove axes: tool",
        ),
    ],
)
def test_what_has_no_tool_axes(changes: Any, said: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        scenario(**changes)
    assert said in str(refused.value)
