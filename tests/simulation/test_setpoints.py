"""Tables of set-points: what they make of the reference and the gains, exactly, and alike in every way of running."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import passiflex as pf
from passiflex.control.motion import Pose, pose_at
from passiflex.problems.problem import SampledProblem
from passiflex.problems.resolution import resolve
from passiflex.problems.timeline import timeline
from passiflex.runs.run import Run
from passiflex.simulation import load_scenario, parse_scenario
from passiflex.simulation.batch import simulate_in_lane
from worlds import books, merged, planar_text, ran, same, world

HOME = Pose(np.array([0.4, 0.0, 0.5]), np.eye(3))
ROWS = "t,x,y,z\n0,0,0,0\n0.125,0.0625,0,0\n0.25,0.0625,0,0.03125\n"


def csv(names: str, rows: Any) -> str:
    return "\n".join([names, *(",".join(map(repr, row)) for row in np.asarray(rows, dtype=float).tolist())])


def table(rows: str = ROWS, **more: Any) -> dict[str, Any]:
    return {"rows": rows, "relative": True, **more}


def motions(reference: Any, **changes: Any) -> list[tuple[float, Any]]:
    scenario = world(reference=reference, **changes)
    return [(e.time, e.motion) for e in timeline(scenario, HOME) if e.motion is not None]


def test_a_held_table_is_the_list_of_its_steps_to_the_last_bit() -> None:
    steps = [
        {"at": 0.125, "kind": "step", "by": [0.0625, 0, 0]},
        {"at": 0.25, "kind": "step", "by": [0, 0, 0.03125]},
    ]
    assert same(ran(reference=table(between="held")), ran(reference=steps))


def test_a_table_with_minimum_jerk_is_the_list_of_its_moves() -> None:
    """But for rounding: displacements are differences of places here."""
    moves = [
        {"at": 0.0, "kind": "move", "by": [0.0625, 0, 0], "duration": 0.125},
        {"at": 0.125, "kind": "move", "by": [0, 0, 0.03125], "duration": 0.125},
    ]
    tabled = ran(reference=table(between="minimum_jerk"))
    listed = ran(reference=moves)
    for name in ("q", "tau_m", "desired_position", "tank_energy", "granted_energy"):
        np.testing.assert_allclose(tabled[name], listed[name], rtol=0, atol=1e-10)


@pytest.mark.parametrize("control", [{"rate": 1000}, None])
def test_in_continuous_time_the_same_table_is_followed(control: Any) -> None:
    changes: dict[str, Any] = {"control": control, "tank": None} if control is None else {}
    run = ran(reference=table(between="linear"), **changes)
    moved = run["desired_position"] - run["desired_position"][0]
    x = np.interp(run.time, [0, 0.125, 0.25], [0, 0.0625, 0.0625])
    z = np.interp(run.time, [0, 0.125, 0.25], [0, 0, 0.03125])
    np.testing.assert_allclose(moved, np.column_stack([x, 0 * x, z]), rtol=0, atol=1e-12)


@pytest.mark.parametrize("between", ["held", "linear", "minimum_jerk", "smooth"])
@given(seed=st.integers(0, 1000), count=st.integers(1, 8))
@settings(max_examples=15, deadline=None)
def test_each_row_is_reached_at_its_time(between: str, seed: int, count: int) -> None:
    """Random poses, of the world: exactly at the row, and what is between two rows ends at the second."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.01, 0.05, count))
    place, turn = rng.normal(size=(2, count, 3))
    rows = csv("t,x,y,z,rx,ry,rz", np.column_stack([time, place, turn]))
    law = {"task": "pose", "stiffness": {"rotation": 10}, "damping": {"rotation": 1}}
    found = motions({"rows": rows, "between": between}, law=law)
    assert [t for t, _ in found] == [0.0, *time]
    for i, (begin, motion) in enumerate(found[1:]):
        wanted = Rotation.from_rotvec(turn[i]).as_matrix()
        here = pose_at(motion, 0.0)
        np.testing.assert_allclose(here.position, place[i], rtol=0, atol=1e-14)
        np.testing.assert_allclose(here.rotation, wanted, rtol=0, atol=1e-14)
        if between != "held" and i + 1 < count:
            there = pose_at(motion, time[i + 1] - begin)
            np.testing.assert_allclose(there.position, place[i + 1], rtol=0, atol=1e-12)
            np.testing.assert_allclose(
                there.rotation, Rotation.from_rotvec(turn[i + 1]).as_matrix(), rtol=0, atol=1e-11
            )


def test_quaternions_are_taken_scalar_last_and_of_either_sign() -> None:
    turn = Rotation.from_rotvec([0.3, -0.5, 1.1])
    quaternion = turn.as_quat()
    law = {"task": "pose", "stiffness": {"rotation": 10}, "damping": {"rotation": 1}}
    rows = csv("t,qx,qy,qz,qw", [[0, *quaternion], [0.1, *-quaternion]])
    for _, motion in motions({"rows": rows, "between": "linear"}, law=law):
        pose = pose_at(motion, 0.05)
        np.testing.assert_allclose(pose.rotation, turn.as_matrix(), rtol=0, atol=1e-15)
        np.testing.assert_array_equal(pose.position, HOME.position)


def test_velocities_of_a_smooth_table_are_those_at_the_rows() -> None:
    """A parabola is a polynomial of degree two: its samples with their slopes give all of it back."""
    t = np.linspace(0, 0.5, 6)
    x, v, zero = 0.1 * t**2, 0.2 * t, 0 * t
    rows = csv("t,x,y,z,vx,vy,vz", np.column_stack([t, x, zero, zero, v, zero, zero]))
    run = ran(reference=table(rows, between="smooth"))
    inside = run.time < 0.5
    moved = (run["desired_position"] - run["desired_position"][0])[inside, 0]
    np.testing.assert_allclose(moved, 0.1 * run.time[inside] ** 2, rtol=0, atol=1e-15)


def test_what_comes_later_ends_a_table() -> None:
    events = [table(between="held") | {"kind": "table"}, {"at": 0.2, "kind": "hold"}]
    assert [t for t, _ in motions(events)] == [0.0, 0.125, 0.2]


# Gains

STILL: dict[str, Any] = {"reference": [], "forces": [{"from": 0.0, "to": 9.0, "force": [10, 0, -10]}]}


def first_after(run: Run, name: str, time: float) -> Any:
    return run[name][np.searchsorted(run.time, time - 1e-9)]


@pytest.mark.parametrize("columns", ["kx,ky,kz", "k11,k12,k13,k21,k22,k23,k31,k32,k33"])
def test_a_row_of_gains_is_in_force_at_once_and_costs_what_it_stores(columns: str) -> None:
    """½ eᵀ ΔK e at the pose of that very period; nothing else is told then."""
    K = np.array([[320.0, 20, 0], [20, 300, -10], [0, -10, 350]])
    if columns.startswith("kx"):
        K = np.diag(np.diag(K))
    numbers = np.diag(K) if columns.startswith("kx") else K.ravel()
    run = ran(
        **merged(STILL, {"reference": {"rows": csv(f"t,{columns}", [[0.3, *numbers]]), "between": "held"}})
    )
    k = int(np.searchsorted(run.time, 0.3 - 1e-9))
    np.testing.assert_array_equal(run["held_stiffness"][k - 1], 200 * np.eye(3))
    np.testing.assert_array_equal(run["held_stiffness"][k], K)
    problem = resolve(run.scenario)
    from passiflex.control.posture import posture

    model = problem.law.robot.layout.unpack(problem.model)
    gains = problem.law.layout.unpack(problem.gains)
    y = run["q"][k], run["theta"][k]
    phi = problem.law.posture_at_rest(*y, model["joint_stiffness"], gains)
    e = posture(problem.law.robot, phi, model).pose.position - run["governed_position"][k]
    cost = e @ (K - 200 * np.eye(3)) @ e / 2
    assert np.diff(run["reference_energy"])[k - 1] == pytest.approx(cost, rel=1e-9)
    assert np.diff(run["granted_energy"])[k - 1] == pytest.approx(cost, rel=1e-9)
    assert cost > 1e-3
    assert np.ptp(books(run)) < 1e-12


def test_a_step_of_a_table_costs_half_its_square_when_the_arm_has_not_moved() -> None:
    delta = np.array([0.03, 0, -0.04])
    rows = csv("t,x,y,z", [[0, 0, 0, 0], [0.1, *delta]])
    run = ran(reference=table(rows, between="held"))
    k = int(np.searchsorted(run.time, 0.1 - 1e-9))
    assert np.diff(run["granted_energy"])[k - 1] == pytest.approx(delta @ delta * 200 / 2, rel=1e-9)


def test_an_instant_change_of_gains_is_the_row_of_a_table_to_the_last_bit() -> None:
    change = {"at": 0.3, "duration": 0, "stiffness": {"translation": 320}, "damping": {"translation": 50}}
    rows = csv("t,kx,ky,kz,dx,dy,dz", [[0.3, 320, 320, 320, 50, 50, 50]])
    tabled = ran(**merged(STILL, {"reference": {"rows": rows, "between": "held"}}))
    listed = ran(**merged(STILL, {"gain_changes": [change]}))
    assert same(tabled, listed)
    late = int(np.searchsorted(listed.time, 0.3 - 1e-9))
    assert listed["held_stiffness"][late - 1, 0, 0] == 200
    assert listed["held_stiffness"][late, 0, 0] == 320


@pytest.mark.parametrize(("between", "share"), [("linear", 0.25), ("minimum_jerk", 0.103515625)])
def test_gains_go_from_row_to_row_as_the_poses_do(between: str, share: float) -> None:
    rows = csv("t,kx,ky,kz", [[0.1, 200, 200, 200], [0.3, 300, 200, 400]])
    run = ran(**merged(STILL, {"reference": {"rows": rows, "between": between}}))
    K = first_after(run, "held_stiffness", 0.15)
    np.testing.assert_allclose(np.diag(K), [200 + 100 * share, 200, 200 + 200 * share], rtol=1e-12)
    np.testing.assert_array_equal(np.diag(run["held_stiffness"][-1]), [300, 200, 400])


def test_what_the_tank_cannot_pay_is_not_in_force() -> None:
    """A jump worth 4 J with 0.3 J in the tank: the reference goes as far as that, and the rest later or never."""
    rows = csv("t,x,y,z", [[0.1, 0.2, 0, 0]])
    run = ran(reference=table(rows, between="held"), tank={"initial": 0.3})
    assert run["granted_energy"].max() < 0.3 + run["refilled_energy"].max()
    assert run["reference_share"].min() < 1
    assert run["governed_time"][-1] > 0
    assert run["tank_energy"].min() > 0
    assert pf.audit(run).verdict == "passive"


@given(seed=st.integers(0, 10_000))
@settings(max_examples=6, deadline=None)
def test_whatever_the_table_the_books_close_and_the_port_stays_passive(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 40))
    time = np.sort(rng.choice(np.arange(0, 600), count, replace=False)) * 1e-3
    A = rng.normal(size=(count, 3, 3))
    K = 50 * np.einsum("nij,nkj->nik", A, A) + 20 * np.eye(3)
    names = "t,x,y,z," + ",".join(f"k{i}{j}" for i in "123" for j in "123")
    rows = csv(names, np.column_stack([time, 0.1 * rng.normal(size=(count, 3)), K.reshape(count, 9)]))
    between = ["held", "linear", "minimum_jerk", "smooth"][seed % 4]
    run = ran(reference=table(rows, between=between), control={"allow_unstable": True}, tank={"initial": 0.5})
    assert np.ptp(books(run)) < 1e-9
    assert pf.audit(run).verdict == "passive"


# The same run again


def test_the_file_lies_beside_the_scenario_and_its_rows_are_kept(tmp_path: Path) -> None:
    (tmp_path / "targets.csv").write_text("\ufeff# of a planner\n" + ROWS)
    (tmp_path / "it.yaml").write_text(planar_text(reference={"table": "targets.csv", "relative": True}))
    scenario = load_scenario(tmp_path / "it.yaml")
    run = pf.simulate(scenario)
    (tmp_path / "targets.csv").unlink()
    assert run.scenario is not None
    assert run.scenario.reference == scenario.reference
    assert same(pf.simulate(run.scenario), run)
    assert scenario.reference[0].words() == "table targets.csv"


def test_a_long_table_is_packed_and_is_the_same_run_again() -> None:
    t = np.arange(600) * 1e-3
    rows = csv("t,x,y,z", np.column_stack([t, 0.02 * np.sin(9 * t), 0 * t, 0.01 * np.cos(7 * t)]))
    scenario = world(reference=table(rows, between="linear"))
    assert len(scenario.to_yaml()) < len(rows)
    again = parse_scenario(scenario.to_yaml())
    assert again == scenario
    assert same(pf.simulate(again), pf.simulate(scenario))


STREAM = {"rate": 20.0, "delay": 0.01, "jitter": 0.03, "lost": 0.3}


def test_a_stream_is_the_same_by_its_seed_and_another_by_another() -> None:
    t = np.arange(0, 0.6, 0.01)
    rows = csv("t,x,y,z", np.column_stack([t, 0.05 * t, 0 * t, -0.05 * t]))
    reference = table(rows, between="held", stream=STREAM)
    one, two = (motions(reference, seed=seed) for seed in (1, 2))
    assert [t for t, _ in one] == [t for t, _ in motions(reference, seed=1)]
    assert [t for t, _ in one] != [t for t, _ in two]


def test_a_stream_changes_no_other_chance() -> None:
    noise = {"torque_variance": 0.1, "hold": 1e-3}
    chance: dict[str, Any] = {"noise": noise, "control": {"jitter": 2e-4, "missed": 0.05}, "seed": 4}
    quiet = ran(reference=[], **chance)
    streamed = ran(reference=table(csv("t,x,y,z", [[0.0, 0, 0, 0]]), between="held", stream=STREAM), **chance)
    np.testing.assert_array_equal(quiet["q"], streamed["q"])


def test_messages_are_late_and_lost_and_the_last_one_holds() -> None:
    """Between two messages nothing changes; each comes 10 to 40 ms after its row; one that was overtaken is dropped."""
    t = np.arange(0, 40.0, 0.01)
    rows = csv("t,x,y,z", np.column_stack([t, t, 0 * t, 0 * t]))
    found = motions(table(rows, between="held", stream=STREAM | {"jitter": 0.2}), duration=45.0)[1:]
    comes = np.array([time for time, _ in found])
    sent = np.array([pose_at(motion, 0.0).position[0] - HOME.position[0] for _, motion in found])
    late = comes - sent
    assert late.min() >= 0.01 - 1e-9
    assert late.max() <= 0.21 + 1e-9
    assert (np.diff(comes) > 0).all()
    assert (np.diff(sent) > 0).all()
    np.testing.assert_allclose(sent * 20, np.round(sent * 20), atol=1e-6)
    assert 0.2 * 800 < len(found) < 0.7 * 800
    assert np.diff(sent).max() > 0.09  # a gap


def test_a_stream_that_is_never_late_or_lost_is_the_table_itself() -> None:
    steps = motions(table(between="held"))
    streamed = motions(table(between="held", stream={}))
    for (t, a), (u, b) in zip(steps, streamed, strict=True):
        assert t == u
        for name in a:
            np.testing.assert_array_equal(a[name], b[name])


@pytest.mark.parametrize("between", ["held", "linear", "minimum_jerk"])
def test_a_stream_runs_alone_as_in_lanes(between: str) -> None:
    t = np.arange(0, 0.5, 0.05)
    rows = csv("t,x,y,z,kx,ky,kz", np.column_stack([t, 0.1 * t, 0 * t, -0.1 * t, *[200 + 200 * t] * 3]))
    scenario = world(reference=table(rows, between=between, stream=STREAM), seed=3)
    problem = resolve(scenario)
    assert isinstance(problem, SampledProblem)
    alone, lane = pf.simulate(scenario), simulate_in_lane(problem)
    for name in ("q", "governed_position", "held_stiffness", "tank_energy"):
        np.testing.assert_allclose(lane[name], alone[name], rtol=1e-9, atol=1e-12)
