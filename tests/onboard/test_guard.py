"""Whatever a policy sends, what reaches the arm is a setpoint, on a way, with gains that hold, paid for."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

import passiflex as pf
from onboard.arms import ElasticArm
from onboard.test_controller import ALL, START, planar
from passiflex.onboard import ApproachSettings, Controller, Guard, Sensed, Setpoint, WatchSettings
from passiflex.problems.altered import altered
from passiflex.stability.judgement import judge

WATCH = WatchSettings(frozen_after=np.inf, soft_start=0.0)


@pytest.fixture(scope="module")
def guard() -> Iterator[Guard]:
    controller = Controller(planar(motors={"torque_limit": "robot"}), WATCH, ApproachSettings(0.05, 0.5, 1.0))
    controller.start(ElasticArm("planar2r", START).said(*ALL))
    with Guard(controller) as guard:
        yield guard


def test_gains_that_pass_hold(guard: Guard) -> None:
    """A search: random ones of every rank and size, each with what stayed of those before."""
    rng, problem, passed = np.random.default_rng(5), guard.controller.problem, 0
    now = {name: problem.law.layout.unpack(problem.gains)[name] for name in ("stiffness", "damping")}
    for _ in range(25):
        message = {}
        for name in now:
            shape = rng.normal(size=(3, rng.integers(1, 4)))
            if rng.random() < 0.8:
                message[name] = shape @ shape.T * 10 ** rng.uniform(-1, 5)
        before = guard.counts.reduced
        assert guard.send(**message) == ""
        guard.wait()
        taken = guard.take()
        assert taken is not None
        now |= {name: v for name in now if (v := getattr(taken, name)) is not None}
        assert judge(altered(problem, gains=now)).stable
        passed += bool(message) and guard.counts.reduced == before
    assert 2 < passed < 23


@pytest.mark.slow
def test_gains_that_pass_hold_on_an_iiwa() -> None:
    """Of low rank in six directions most do not hold, for damping that is missing in one of them."""
    scenario = pf.shipped_scenario("fig1_sampled").changed({"control.external_torque": "none"})
    controller = Controller(scenario, WATCH)
    problem, rng = controller.problem, np.random.default_rng(3)
    controller.start(Sensed(q=problem.q, dq=np.zeros(7), tau_a=np.zeros(7)))
    problem = controller.problem
    now = {name: problem.law.layout.unpack(problem.gains)[name] for name in ("stiffness", "damping")}
    with Guard(controller) as guard:
        for _ in range(60):
            roots = {name: rng.normal(size=(6, rng.integers(1, 7))) for name in now}
            most = {"stiffness": 5, "damping": 3}
            message = {
                n: r @ r.T * 10 ** rng.uniform(-1, most[n]) for n, r in roots.items() if rng.random() < 0.8
            }
            guard.send(**message)
            guard.wait()
            taken = guard.take()
            assert taken is not None
            now |= {name: v for name in now if (v := getattr(taken, name)) is not None}
            assert judge(altered(problem, gains=now)).stable
        assert guard.counts.reduced > 20


def test_gains_that_do_not_hold_are_taken_in_part_and_said(guard: Guard) -> None:
    own = guard.controller.problem.law.layout.unpack(guard.controller.problem.gains)
    guard.send(stiffness=own["stiffness"], damping=own["damping"])
    guard.wait()
    guard.take()
    guard.send(position=[0.5, 0, 0.5], stiffness=own["stiffness"], damping=60 * own["damping"])
    first = guard.take()
    assert first is not None
    assert first.damping is None  # the pose does not wait
    guard.wait()
    assert guard.said.startswith("gains taken ")
    assert "would tremble at" in guard.said
    taken = guard.take()
    assert taken is not None
    np.testing.assert_array_equal(taken.position, [0.5, 0, 0.5])
    assert own["damping"][0, 0] < taken.damping[0, 0] < 60 * own["damping"][0, 0]
    assert guard.take() is None


@pytest.mark.parametrize(
    ("message", "why"),
    [
        ({"position": [0, 0]}, r"refused: position of a setpoint"),
        ({"stiffness": np.eye(6)}, r"refused: stiffness of a setpoint; got \(6, 6\); needs shape \(3, 3\)"),
        ({"stiffness": [[1, 5, 0], [0, 1, 0], [0, 0, 1]]}, "symmetric"),
        ({"position": [np.nan, 0, 0]}, "finite"),
        ({"positoin": [0, 0, 0]}, "refused: a setpoint has no 'positoin'"),
        ({"posture": [0, 0, 0]}, r"needs shape \(2,\)"),
        ({"position": "there"}, "numbers"),
    ],
)
def test_what_is_no_setpoint_is_refused_and_the_one_before_stays(
    guard: Guard, message: dict[str, Any], why: str
) -> None:
    guard.send(position=[0.5, 0, 0.5])
    before = guard.counts.refused
    with pytest.raises(AssertionError, match=why):
        raise AssertionError(guard.send(**message))
    assert guard.counts.refused == before + 1
    taken = guard.take()
    assert taken is not None
    np.testing.assert_array_equal(taken.position, [0.5, 0, 0.5])


def test_messages_come_from_other_threads(guard: Guard) -> None:
    before = guard.counts.received

    def policy() -> None:
        for i in range(200):
            guard.send(position=[0.5, 0, 0.5 + 1e-4 * i])

    threads = [threading.Thread(target=policy) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert guard.counts.received == before + 800
    assert guard.take() is not None


def near(controller: Controller, name: str) -> np.ndarray:
    return controller.law.memory.unpack(controller.state)[f"near_{name}"]


def test_a_jump_becomes_a_way_in_the_time_of_a_ramp() -> None:
    """A straight line and a geodesic, K_x linearly; by SciPy's own interpolation of rotations."""
    arm = ElasticArm("planar2r", START)
    controller = Controller(planar(), WATCH, ApproachSettings(ramp=0.05))
    controller.start(arm.said(*ALL))
    begin = {name: near(controller, name).copy() for name in ("position", "rotation", "stiffness")}
    goal = Rotation.from_rotvec([0.4, -1.1, 2.0]).as_matrix()
    setpoint = Setpoint(begin["position"] + [0.02, 0, 0.01], goal, stiffness=[300, 100, 50])
    between = Slerp([0, 1], Rotation.from_matrix([begin["rotation"], goal]))
    for i in range(1, 61):
        controller.step(arm.said(*ALL), setpoint if i == 1 else None)
        share = min(i / 50, 1)
        np.testing.assert_allclose(
            near(controller, "position"), begin["position"] + share * np.array([0.02, 0, 0.01]), atol=1e-12
        )
        np.testing.assert_allclose(near(controller, "rotation"), between(share).as_matrix(), atol=1e-9)
        wished = begin["stiffness"] + share * (np.diag([300, 100, 50]) - begin["stiffness"])
        np.testing.assert_allclose(near(controller, "stiffness"), wished, atol=1e-9)
    np.testing.assert_array_equal(near(controller, "rotation"), setpoint.rotation)


@pytest.mark.parametrize("vector", [[np.pi, 0, 0], [0, np.pi, 0], [0, 0, np.pi], [2.2, 2.2, 0.3]])
def test_half_a_turn_arrives(vector: list[float]) -> None:
    arm = ElasticArm("planar2r", START)
    controller = Controller(planar(), WATCH, ApproachSettings(ramp=0.05, turn_rate=20.0))
    controller.start(arm.said(*ALL))
    half = Rotation.from_rotvec(np.pi * np.array(vector) / np.linalg.norm(vector)).as_matrix()
    goal = half @ near(controller, "rotation")
    before = near(controller, "rotation").copy()
    for i in range(200):
        controller.step(arm.said(*ALL), Setpoint(rotation=goal) if i == 0 else None)
        now = near(controller, "rotation")
        assert Rotation.from_matrix(now @ before.T).magnitude() <= 20.0 * 1e-3 + 1e-9
        before = now
    np.testing.assert_allclose(now, goal, atol=1e-9)


def test_whatever_is_sent_the_reference_is_no_faster_than_it_may_be_and_the_tank_pays() -> None:
    """A policy that jumps at 50 Hz, in pose and gains, with messages that are none; energy by the arm's own joints."""
    rng = np.random.default_rng(2)
    arm = ElasticArm("planar2r", START)
    controller = Controller(planar(motors={"torque_limit": "robot"}), WATCH, ApproachSettings(0.04, 0.5, 1.0))
    controller.start(arm.said(*ALL))
    guard = Guard(controller)
    guard.wait()
    full, least, before = controller.report.level, np.inf, near(controller, "position").copy()
    for k in range(4000):
        if k % 20 == 0:
            A, B = rng.normal(size=(2, 3, 3))
            message: dict[str, Any] = {"position": before + rng.normal(size=3) * 10 ** rng.uniform(-3, 0)}
            message["stiffness"] = A @ A.T * 10 ** rng.uniform(0, 4)
            message["damping"] = B @ B.T * 10 ** rng.uniform(0, 3)
            if rng.random() < 0.2:
                message[rng.choice(["position", "stiffness", "damping"])] = rng.choice(
                    [np.nan, np.inf, -1.0]
                ) * np.ones(3)
            guard.send(**message)
        arm.move(controller.step(arm.said(*ALL), guard.take()))
        now = near(controller, "position")
        assert np.linalg.norm(now - before) <= 0.5 * 1e-3 + 1e-12
        before = now.copy()
        least = min(least, full - arm.given)
    assert least > 0
    assert guard.counts.refused > 10
    guard.close()
    assert not controller.report.latched


def test_what_is_well_is_followed_as_without_a_guard() -> None:
    """Small messages at 20 Hz: the hand is where the law alone, told the same way at every period, would have it."""
    hands = []
    for guarded in (False, True):
        arm = ElasticArm("planar2r", START)
        controller = Controller(planar(), WATCH, ApproachSettings(ramp=0.05 if guarded else 0.0))
        controller.start(arm.said(*ALL))
        guard = Guard(controller) if guarded else None
        start, way = arm.hand, []
        for k in range(1500):
            t = (
                k if not guarded else k - k % 50 + 50
            ) * 1e-3  # the guard arrives when the next message comes
            wished = start + 0.03 * np.array([np.sin(2 * t), 0, 1 - np.cos(2 * t)])
            if guard is None:
                arm.move(controller.step(arm.said(*ALL), Setpoint(position=wished)))
            else:
                if k % 50 == 0:
                    assert guard.send(position=wished) == ""
                arm.move(controller.step(arm.said(*ALL), guard.take()))
            way.append(arm.hand)
        hands.append(np.array(way))
        if guard is not None:
            guard.close()
    alone, guarded_way = hands
    assert np.abs(alone - guarded_way).max() < 0.05 * np.ptp(alone, axis=0).max()
