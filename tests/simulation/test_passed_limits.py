"""Which limits a run passed: against the rows of every sample, and sentence by sentence."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from passiflex.robots.catalogue import read_description
from passiflex.simulation import PassedLimit, Run, parse_scenario, passed_limits, simulate
from worlds import by_rows, merged, planar_text, ran

FAST: dict[str, Any] = {
    "law": {
        "stiffness": {"translation": 3000},
        "damping": {"translation": 100},
        "shaped_inertia": {"ratio": 0.5},
    },
    "tank": {"initial": 200},
    "reference": [{"at": 0.1, "kind": "step", "by": [-0.3, 0, 0.3]}],
}
"""A step that asks more of both joints than they may do."""
LIMITS = {"speed": ("dq", "velocity_limit"), "torque": ("tau_m", "torque_limit")}


def with_range(run: Run, lower: list[float], upper: list[float]) -> Run:
    """Return the rows of a run of a robot with these ends of its joints."""
    data = by_rows(run).data
    ends = {"lower_position_limit": lower, "upper_position_limit": upper}
    return Run(data.assign({name: ("joint", np.array(end), data[name].attrs) for name, end in ends.items()}))


def test_speed_and_torque_are_those_of_every_period() -> None:
    run, sparse = ran(**FAST), ran(**merged(FAST, {"output_interval": 0.3}))
    found = passed_limits(sparse)
    assert [p.kind for p in found] == ["speed", "torque"]
    assert found == passed_limits(run)
    for passed in found:
        signal, name = LIMITS[passed.kind]
        value, limit = np.abs(run[signal]), run[name]
        first = (value > limit).any(axis=1).argmax()
        assert passed.time == pytest.approx(run.time[first], abs=1e-12)
        assert value[first, passed.joint - 1] > limit[passed.joint - 1]
        worst = value.max(axis=0) - limit
        assert passed.most == pytest.approx(worst[passed.joint - 1], rel=1e-6)
        assert {passed.joint, *passed.others} == set(np.flatnonzero(worst > 0) + 1)
        assert passed.every_step
        assert str(passed).endswith(
            "at most; so does " + ("motor 2" if passed.kind == "torque" else "joint 1")
        )


def test_a_motor_at_its_limit_does_not_pass_it() -> None:
    run = ran(
        **merged(FAST, {"motors": {"torque_limit": "robot"}, "law": {"stiffness": {"translation": 1000}}})
    )
    assert (np.abs(run["tau_m"]).max(axis=0) == run["torque_limit"]).any()
    assert "torque" not in [p.kind for p in passed_limits(run)]


def test_a_calm_run_says_nothing_and_a_robot_without_limits_neither() -> None:
    assert passed_limits(ran()) == ()
    run = ran(**FAST)
    endless = {
        name: run.data[name] * np.inf for name in ("velocity_limit", "torque_limit", "upper_position_limit")
    }
    assert passed_limits(Run(by_rows(run).data.assign(endless))) == ()


def test_a_joint_that_leaves_its_range_is_named_with_the_end_it_left() -> None:
    run = ran()
    q, low, high = run["q"], run["q"].min(axis=0), run["q"].max(axis=0)
    middle = (low + high) / 2
    (passed,) = passed_limits(with_range(run, [-9, middle[1]], [9, 9]))
    row = int((q[:, 1] < middle[1]).argmax())
    expected = (2, run.time[row], middle[1], middle[1] - low[1], "rad", ())
    assert tuple(passed[1:-1]) == expected
    assert str(passed).startswith(
        f"joint 2 leaves its range, {middle[1]:.4g} rad, first at {run.time[row]:.4g} s, by "
    )
    assert str(passed).endswith(" rad at most (as far as its rows show)")
    (other,) = passed_limits(with_range(run, [-9, -9], [9, middle[1]]))
    assert other.limit == middle[1]
    assert other.most == high[1] - middle[1]


def test_the_loop_notes_a_range_that_is_left(tmp_path: Path) -> None:
    """The second joint of the planar arm, pushed further than it can turn."""
    posture = {
        "posture": [0.5, 2.9],
        "reference": [],
        "forces": [{"from": 0.1, "to": 0.4, "force": [30, 0, -30]}],
    }
    run = ran(**posture)
    passed = {p.kind: p for p in passed_limits(Run.load(run.save(tmp_path / "run.nc")))}["position"]
    outside = (run["q"] < run["lower_position_limit"]) | (run["q"] > run["upper_position_limit"])
    first = outside.any(axis=1).argmax()
    assert passed.every_step
    assert passed.time == pytest.approx(run.time[first], abs=1e-12)
    assert outside[first, passed.joint - 1]
    assert passed == {p.kind: p for p in passed_limits(run)}["position"]


def test_in_continuous_time_the_torque_is_that_of_the_rows() -> None:
    text = planar_text(**FAST, output_interval=0.05)
    speed, torque = passed_limits(simulate(parse_scenario(text)))
    assert (speed.kind, torque.kind) == ("speed", "torque")
    assert (speed.every_step, torque.every_step) == (True, False)
    fine = simulate(parse_scenario(planar_text(**FAST, output_interval=1e-4)))
    value = np.abs(fine["dq"]) - fine["velocity_limit"]
    assert speed.most == pytest.approx(value[:, speed.joint - 1].max(), rel=1e-4)
    assert speed.time == pytest.approx(fine.time[(value > 0).any(axis=1).argmax()], abs=2e-3)


def test_three_joints_are_listed() -> None:
    passed = PassedLimit("torque", 2, 0.25, 10.0, 2.5, "N m", (1, 3, 7), every_step=True)
    assert str(passed) == (
        "motor 2 exceeds its torque limit, 10 N m, first at 0.25 s, by 2.5 N m at most; so do motors 1, 3 and 7"
    )


def test_a_file_without_limits_is_asked_nothing() -> None:
    names = ["velocity_limit", "torque_limit", "lower_position_limit"]
    assert passed_limits(Run(ran(**FAST).data.drop_vars(names))) == ()


def test_a_joint_that_slides_is_told_in_its_own_unit() -> None:
    run = ran(**FAST)
    chain = read_description("planar2r").chain
    slide = chain.joints[1]._replace(kind="prismatic")
    data = run.data.assign_attrs(robot_description=replace(chain, joints=(chain.joints[0], slide)).to_urdf())
    data["dq"] = data["dq"].assign_attrs(units="rad/s or m/s")
    speed = passed_limits(Run(data.drop_vars("position")))[0]
    assert (speed.joint, speed.unit) == (2, "m/s")
