"""What a controller does about setpoints and readings that stay away, and whatever it is told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.arms import ElasticArm
from onboard.test_controller import ALL, IDEAL, START, moved, planar
from passiflex.errors import SizeError, ValueRangeError
from passiflex.onboard import Controller, Sensed, Setpoint, WatchSettings

WATCH = WatchSettings(
    stale_after=0.02, soften_after=0.05, frozen_after=0.01, silent_after=0.005, soften=0.1, soft_start=0.0
)
LIMITED = {"motors": {"torque_limit": [20, 15], "torque_rate_limit": 2000}}


def started(watch: WatchSettings = WATCH, **changes: Any) -> tuple[ElasticArm, Controller]:
    arm, controller = ElasticArm("planar2r", START), Controller(planar(**changes), watch)
    controller.start(arm.said(*ALL))
    return arm, controller


def shaken(arm: ElasticArm) -> Sensed:
    """Return readings whose last bits flicker, as those of real sensors."""
    said = arm.said(*ALL)
    return said._replace(tau_a=said.tau_a + 1e-6 * np.random.default_rng().normal(size=2))


def test_a_setpoint_that_stays_away_lets_the_arm_stand_and_then_go() -> None:
    arm, controller = started()
    for _ in range(200):
        arm.move(controller.step(shaken(arm), Setpoint(velocity=np.zeros(6))))
    assert controller.report.why == ""
    seen = []
    for _ in range(200):
        arm.move(controller.step(shaken(arm)))
        seen.append((controller.report.stiffness_scale, controller.report.why))
    assert seen[15][1] == ""
    assert seen[30] == (1.0, "no setpoint for 0.031 s: the reference stands still")
    assert seen[100][0] == pytest.approx(1 - (101 - 49) / 100, abs=0.02)
    assert "the arm is let go" in seen[100][1]
    assert seen[-1][0] == 0
    controller.step(shaken(arm), Setpoint(velocity=np.zeros(6)))
    assert controller.report.stiffness_scale == 1  # without a soft start it is taken again at once
    assert controller.report.setpoint_age == 0


def test_a_velocity_ends_where_its_setpoint_is_stale() -> None:
    arm, controller = started(actions={"follow_velocity": 1})
    forward = Setpoint(position=arm.hand, velocity=[0.1, 0, 0, 0, 0, 0])
    controller.step(shaken(arm), forward)
    pushed = controller.step(shaken(arm)).copy()
    for _ in range(25):
        controller.step(shaken(arm))
    assert np.abs(pushed).max() > np.abs(controller.torque).max()


def test_nobody_who_never_sent_a_setpoint_is_missed() -> None:
    arm, controller = started()
    for _ in range(300):
        arm.move(controller.step(shaken(arm)))
    assert controller.report.why == ""


def test_it_stops_and_starts_softly() -> None:
    arm, controller = started(WatchSettings(soft_start=0.1, soften=0.1, frozen_after=np.inf))
    goal = Setpoint(position=arm.hand + np.array([0, 0, 0.02]))
    scales = []
    for k in range(600):
        if k == 200:
            controller.stop()
        if k == 400:
            assert controller.stopped
            assert controller.report.why == "stopped"
            controller.resume()
        arm.move(controller.step(arm.said(*ALL), goal))
        scales.append(controller.report.stiffness_scale)
    assert scales[49] == pytest.approx(0.5)
    assert scales[150] == 1
    assert scales[249] == pytest.approx(0.5)
    assert scales[350] == 0
    assert scales[449] == pytest.approx(0.5)
    assert not controller.stopped


def test_readings_that_freeze_let_the_arm_go() -> None:
    arm, controller = started()
    said = shaken(arm)
    for _ in range(60):
        controller.step(said)
    assert controller.report.stiffness_scale == pytest.approx(0.5, abs=0.02)
    assert "not changed by a bit" in controller.report.why
    for _ in range(3):
        controller.step(shaken(arm))
    assert controller.report.why == ""


def test_without_a_finite_reading_the_torque_is_held_then_goes_to_what_carries_the_arm() -> None:
    arm, controller = started(law={"gravity": "static"}, motors={"torque_limit": [20, 15]})
    moved(arm, controller, ALL, 0.02, Setpoint(position=arm.hand + np.array([0, 0, 0.05])))
    held = controller.torque.copy()
    nothing = Sensed(*[np.full(2, np.nan)] * 5)
    for _ in range(4):
        np.testing.assert_allclose(controller.step(nothing), held, atol=1e-9)
    for _ in range(200):
        controller.step(nothing)
    carried = np.clip(arm.weight(arm.x[:2]), [-20, -15], [20, 15])
    np.testing.assert_allclose(controller.torque, carried, atol=0.1)
    assert "no finite reading" in controller.report.why
    assert controller.report.faults == 204
    controller.step(arm.said(*ALL))
    assert controller.report.silent_time == 0
    assert np.isfinite(controller.state).all()


WHATEVER = st.one_of(st.floats(-3, 3), st.sampled_from([np.nan, np.inf, -np.inf, 1e308, 1e31, 0.0, 5e-324]))


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_whatever_it_is_told_the_torque_is_finite_and_within_its_limits(data: st.DataObject) -> None:
    """And nothing that is no number stays in what it remembers for longer than it is told."""
    controller = CONTROLLER[0]
    arm = ElasticArm("planar2r", START)
    controller.start(arm.said(*ALL, "applied"))
    before = np.zeros(2)
    for _ in range(30):
        said = Sensed(*(np.array([data.draw(WHATEVER), data.draw(WHATEVER)]) for _ in range(5)))
        elapsed = data.draw(st.sampled_from([1e-3, 2e-3, 0.0, -1.0, np.nan, 1e-9]))
        torque = controller.step(said._replace(applied=before), None, elapsed).copy()
        assert np.isfinite(torque).all()
        assert (np.abs(torque) <= [20, 15]).all()
        lasted = elapsed if elapsed > 0 else 1e-3
        assert (np.abs(torque - before) <= 2000 * max(lasted, 1e-3) + 1e-9).all()
        before = torque
    for _ in range(3):
        controller.step(arm.said(*ALL, "applied"))
    assert np.isfinite(controller.state).all()


CONTROLLER: list[Controller] = []


@pytest.fixture(scope="module", autouse=True)
def _compiled_once() -> None:
    CONTROLLER.append(Controller(planar(law={"gravity": "static"}, **LIMITED), WATCH))


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        ({"position": [0, 0]}, r"position of a setpoint; got \(2,\)"),
        ({"position": [0, 0, np.nan]}, "finite numbers"),
        ({"rotation": np.diag([1.0, 1, -1])}, "orthonormal, right-handed"),
        ({"rotation": [0, 0, 0, 2]}, "length 1"),
        ({"rotation": [0, 0, 0, 0.5]}, "length 1"),
        ({"rotation": np.full((3, 3), 1e200)}, "orthonormal"),
        ({"stiffness": np.full((3, 3), 1e300)}, "at most 1e"),
        ({"stiffness": [[1, 2, 0], [0, 1, 0], [0, 0, 1]]}, "symmetric"),
        ({"stiffness": [100, -1, 100]}, "none below 0"),
        ({"damping": "much"}, "numbers"),
        ({"stiffness": 100}, "needs"),
    ],
)
def test_a_setpoint_that_is_none_is_refused_where_it_is_made(wrong: dict[str, Any], match: str) -> None:
    with pytest.raises((ValueRangeError, SizeError), match=match):
        Setpoint(**wrong)


def test_what_a_setpoint_leaves_out_stays() -> None:
    arm, controller = started(IDEAL)
    controller.step(
        arm.said(*ALL), Setpoint(position=[0.6, 0, 0.6], stiffness=[100, 100, 100], wrench=[1, 0, 0, 0, 0, 0])
    )
    controller.step(arm.said(*ALL), Setpoint(damping=[50, 50, 50]))
    now = controller.asked
    np.testing.assert_array_equal(now["position"], [0.6, 0, 0.6])
    np.testing.assert_array_equal(now["stiffness"], 100 * np.eye(3))
    np.testing.assert_array_equal(now["damping"], 50 * np.eye(3))
    np.testing.assert_array_equal(now["wrench"], 0)
    with pytest.raises(SizeError, match=r"stiffness of a setpoint; got \(6, 6\); needs shape \(3, 3\)"):
        controller.step(arm.said(*ALL), Setpoint(stiffness=np.eye(6)))


def test_a_rotation_that_was_printed_is_mended() -> None:
    """To the nearest one, by an independent way: the polar factor of the singular value decomposition."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        exact, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        printed = np.round(exact * np.sign(np.linalg.det(exact)), 4)
        u, _, v = np.linalg.svd(printed)
        np.testing.assert_allclose(Setpoint(rotation=printed).rotation, u @ v, atol=1e-12)
    np.testing.assert_allclose(Setpoint(rotation=[0, 0, 1, 0]).rotation, np.diag([-1.0, -1, 1]), atol=1e-15)
