"""Turns and paths in a scenario: geodesics, splines through points, and what a path may not ask for."""

from __future__ import annotations

from typing import Any

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from passiflex.control.motion import MOTION, Pose, pose_at, reference_at
from passiflex.errors import ScenarioError
from passiflex.problems.timeline import timeline
from worlds import ran, world

HOME = Pose(np.array([0.4, 0.0, 0.5]), Rotation.from_rotvec([0.2, 0.1, -0.4]).as_matrix())
POSE = {"task": "pose", "stiffness": {"rotation": 10}, "damping": {"rotation": 1}}


def _rates() -> cs.Function:
    clock = cs.SX.sym("clock")
    motion, c = MOTION.symbols("motion")
    velocity = reference_at(clock, cs.SX(1), c).velocity
    return cs.Function("rates", [clock, motion], [velocity, cs.jacobian(velocity, clock)])


RATES = _rates()


def motions(*reference: Any, law: Any = POSE) -> list[tuple[float, Any]]:
    scenario = world(reference=list(reference), law=law)
    return [(e.time, e.motion) for e in timeline(scenario, HOME) if e.motion is not None]


def rates(motion: Any, clock: float) -> tuple[np.ndarray, np.ndarray]:
    velocity, acceleration = RATES(clock, MOTION.pack(motion))
    return np.array(velocity)[:, 0], np.array(acceleration)[:, 0]


def path(points: Any, **more: Any) -> dict[str, Any]:
    return {"at": 0.1, "kind": "path", "points": points, **more}


def random_points(seed: int, count: int) -> list[dict[str, Any]]:
    rng = np.random.default_rng(seed)
    return [
        {"after": float(a), "by": b.tolist(), "turn": t.tolist()}
        for a, b, t in zip(
            rng.uniform(0.02, 0.05, count),
            rng.normal(0, 0.1, (count, 3)),
            rng.uniform(-1.5, 1.5, (count, 3)),
            strict=True,
        )
    ]


def poses(points: Any) -> list[Pose]:
    out = [HOME]
    for point in points:
        turned = Rotation.from_rotvec(point["turn"]).as_matrix() @ out[-1].rotation
        out.append(Pose(out[-1].position + point["by"], turned))
    return out


@given(seed=st.integers(0, 10_000), count=st.integers(1, 8))
@settings(max_examples=40, deadline=None)
def test_a_smooth_path_passes_its_points_without_a_jump_of_velocity_or_acceleration(
    seed: int, count: int
) -> None:
    points = random_points(seed, count)
    begun = motions(path(points))[1:]
    wanted = poses(points)
    still = np.zeros(6)
    before: Any = (still, still)
    for (begin, motion), (end, following), start, stop in zip(
        begun, [*begun[1:], (np.nan, None)], wanted, [*wanted[1:], None], strict=True
    ):
        np.testing.assert_allclose(pose_at(motion, 0.0).position, start.position, atol=1e-13)
        np.testing.assert_allclose(pose_at(motion, 0.0).rotation, start.rotation, atol=1e-13)
        size = 1 + np.abs(before[1]).max()
        np.testing.assert_allclose(rates(motion, 0.0)[0], before[0], rtol=1e-7, atol=1e-9 * size)
        np.testing.assert_allclose(rates(motion, 0.0)[1], before[1], rtol=1e-6, atol=1e-7 * size)
        if following is None:
            break
        just = (end - begin) * (1 - 1e-13)
        there = pose_at(motion, just)
        np.testing.assert_allclose(there.position, stop.position, atol=1e-11)
        np.testing.assert_allclose(there.rotation, stop.rotation, atol=1e-10)
        before = rates(motion, just)
    assert not rates(begun[-1][1], 0.01)[0].any()


@pytest.mark.parametrize("between", ["smooth", "minimum_jerk"])
def test_a_path_of_one_point_is_the_move(between: str) -> None:
    (point,) = random_points(3, 1)
    move = {"at": 0.1, "kind": "move", "by": point["by"], "turn": point["turn"], "duration": point["after"]}
    one, other = motions(path([point], between=between))[1][1], motions(move)[1][1]
    for clock in np.linspace(0, point["after"], 7):
        a, b = pose_at(one, clock), pose_at(other, clock)
        np.testing.assert_allclose(a.position, b.position, atol=1e-14)
        np.testing.assert_allclose(a.rotation, b.rotation, atol=1e-14)


@pytest.mark.parametrize("between", ["linear", "minimum_jerk", "smooth"])
def test_a_turn_about_one_axis_stays_about_it(between: str) -> None:
    """Each leg is a geodesic; so is the smooth whole, as long as all turns are about one axis."""
    axis = np.array([1.0, -2.0, 2.0]) / 3
    points = [{"after": 0.1, "turn": (angle * axis).tolist()} for angle in (1.0, 2.5, -0.7, 3.0)]
    for _, motion in motions(path(points, between=between))[1:]:
        for clock in (0.01, 0.05, 0.09):
            np.testing.assert_allclose(np.cross(rates(motion, clock)[0][3:], axis), 0, atol=1e-12)


def test_a_move_may_turn_only_and_a_circle_may_turn_along() -> None:
    ((_, turn),) = motions({"at": 0.1, "kind": "move", "turn": [0, 0, 1], "duration": 0.2})[1:]
    middle = pose_at(turn, 0.1)
    np.testing.assert_array_equal(middle.position, HOME.position)
    np.testing.assert_allclose(
        middle.rotation, Rotation.from_rotvec([0, 0, 0.5]).as_matrix() @ HOME.rotation, atol=1e-15
    )
    ring = {"at": 0.1, "kind": "circle", "plane": ["x", "y"], "radius": 0.1, "period": 2}
    ((_, circle),) = motions(ring | {"turns": 1})[1:]
    for clock in (0.0, 0.3, 1.7):
        velocity = rates(circle, clock)[0]
        ahead = pose_at(circle, clock).rotation @ HOME.rotation.T @ [1, 0, 0]
        np.testing.assert_allclose(velocity[:3], 0.1 * np.pi * ahead, atol=1e-13)
        np.testing.assert_allclose(velocity[3:], [0, 0, np.pi], atol=1e-13)


def test_the_hand_follows_a_path() -> None:
    points = [{"after": 0.2, "by": [0.03, 0, 0]}, {"after": 0.2, "by": [0, 0, 0.03]}]
    run = ran(reference=[path(points)])
    moved = run["desired_position"] - run["desired_position"][0]
    np.testing.assert_allclose(moved[np.searchsorted(run.time, 0.3 - 1e-9)], [0.03, 0, 0], atol=1e-12)
    np.testing.assert_allclose(moved[-1], [0.03, 0, 0.03], atol=1e-12)


@pytest.mark.parametrize(
    ("event", "law", "said"),
    [
        (
            path([]),
            POSE,
            "reference[0].points: needs at least one point, as {after: 1 s, by: [0, 0, 0.1]}",
        ),
        (
            path([{"by": [0, 0, 1]}]),
            POSE,
            "reference[0].points[0].after: missing: time since the point before, s",
        ),
        (
            path([{"after": 0}]),
            POSE,
            "reference[0].points[0].after: expected s, one number, > 0; got 0 (too small)",
        ),
        (
            path([{"after": 1, "turn": [0, 0, 4]}]),
            POSE,
            "reference[0].points[0].turn: is 4 rad; needs at most half a turn from point to point: add a point",
        ),
        (
            path([{"after": 1, "turn": [0, 0, 1]}]),
            {},
            "reference[0].points[0].turn: a position task has no orientation; remove it",
        ),
        (
            {"at": 0.1, "kind": "circle", "plane": ["x", "y"], "radius": 1, "period": 2, "turns": 1},
            {},
            "reference[0].turns: a position task has no orientation; remove it",
        ),
        (
            {"at": 0.1, "kind": "move", "turn": [0, 0, 1], "duration": 2},
            {},
            "reference[0].turn: a position task has no orientation; remove it",
        ),
        (
            {"at": 0.1, "kind": "move", "duration": 2},
            {},
            "reference[0].by: missing; a move needs by, turn or both",
        ),
    ],
)
def test_what_a_path_may_not_ask_for(event: Any, law: Any, said: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        world(reference=[event], law=law)
    assert said in str(refused.value)
