"""What was run, in words: short, with units, and nothing of what was left out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml

from passiflex.reports.facts import facts, made_by, shown_configuration
from passiflex.simulation import Run, passed_limits
from reports.pages import baseline, changed, continuous, sampled
from worlds import by_rows, world

POSE = {
    "task": "pose",
    "stiffness": {"translation": [60, 70, 80], "rotation": 50},
    "damping": {"translation": None, "ratio": 0.7},
}
COUPLED = np.eye(3) * 60 + np.fromfunction(lambda i, j: (i != j) * 5.0, (3, 3))
TURNED = np.kron([[1.0, 0.1], [0.1, 1.0]], np.eye(3) * 60)


def told(**changes: Any) -> dict[str, str]:
    return dict(facts(sampled(), world(**changes)))


@pytest.mark.parametrize(
    ("changes", "label", "value"),
    [
        ({"description": "a push"}, "task", "a push"),
        ({"law": POSE}, "stiffness K_x", "[60, 70, 80] N/m, 50 N m/rad"),
        ({"law": POSE}, "damping D_x", "damping ratio 0.7"),
        ({"law": {"stiffness": {"translation": COUPLED}}}, "stiffness K_x", "[60 5 5; 5 60 5; 5 5 60] N/m"),
        (
            {"law": POSE | {"stiffness": {"translation": None, "matrix": TURNED}}},
            "stiffness K_x",
            "60 N/m, 60 N m/rad (with coupling)",
        ),
        ({"law": {"shaped_stiffness": {"ratio": None, "value": 900}}}, "shaped stiffness K_e", "900 N m/rad"),
        ({"law": {"shaped_inertia": {"ratio": [0.3, 0.4]}}}, "shaped inertia B_e", "[0.3, 0.4] × B"),
        ({"law": {"gravity": "motor"}}, "gravity", "compensated at the motor position"),
        (
            {
                "control": {"rate": 500, "delay": "2 ms", "jitter": "1 ms", "missed": 0.1},
                "output_interval": 0.002,
            },
            "control",
            "500 Hz, commands 2 ms late, jitter up to 1 ms, 0.1 of the periods missed, plain inner loop, τ_e: true",
        ),
        (
            {"tank": {"cap": 5, "power": 3}},
            "tank",
            "port tank, 2 J at the start, T_min 0.1 J, cap 5 J, at most 3 W, signed accounting",
        ),
        ({"tool": {"position": [0, 0, 0.1]}}, "tool", "[0, 0, 0.1] m"),
        (
            {"tool": {"rotation_vector": [0, 0, 0.5]}},
            "tool",
            "[0, 0, 0] m, turned by [0, 0, 0.5] rad",
        ),
        (
            {"sensors": {"link_resolution": 1e-4, "velocity": "differences"}},
            "sensors",
            "q to 0.1 mrad, θ exact, velocities: differences",
        ),
        (
            {"sensors": {"link_delay": "1 ms", "torque_delay": "2.5 ms"}},
            "sensors",
            "q exact, θ exact, velocities: true, q 1 ms late, τ_a 2.5 ms late",
        ),
        (
            {"noise": {"link_deviation": 1e-5}},
            "noise of q, θ",
            "deviations 1e-05 and 0 rad, new in each period",
        ),
        ({"motors": {"torque_limit": "robot"}}, "motors", "torques limited, no friction"),
        ({"motors": {"coulomb_friction": 1}}, "motors", "torques not limited, with friction"),
        (
            {"noise": {"torque_variance": 0.2, "hold": "2 s"}},
            "noise of τ_a",
            "variance 0.2 (N m)², each value held for 2 s",
        ),
        (
            {"environment": [{"kind": "load", "from": 0.1, "to": 0.4, "mass": 1.5}]},
            "load",
            "1.5 kg, grip 20000 N/m, the law does not know it, 0.1 to 0.4 s",
        ),
        (
            {"environment": [{"kind": "person", "name": "anna", "from": 0.1, "to": 0.4}]},
            "person anna",
            "2 kg, grip 5000 N/m, arm 300 N/m, 0.1 to 0.4 s",
        ),
        ({"environment": [{"kind": "end_stops", "stiffness": 3e4}]}, "end stops", "30000 N m/rad"),
        (
            {"environment": [{"kind": "drag", "from": 0.1, "to": 0.4, "viscous": 3, "dry": 2}]},
            "drag",
            "3 N s/m, 2 N, 0.1 to 0.4 s",
        ),
        ({"deviations": {"joint_stiffness": 0.2}}, "robot is off by", "joint stiffness +20 %"),
        (
            {"model_errors": {"joint_damping": -0.5, "motor_inertia": [0.1, 0.2]}},
            "model is off by",
            "joint damping -50 %, motor inertia +10 %, +20 %",
        ),
    ],
)
def test_a_setting_in_words(changes: dict[str, Any], label: str, value: str) -> None:
    assert told(**changes)[label] == value


def test_what_is_plain_is_not_said() -> None:
    assert list(told()) == [
        "robot", "law", "gravity", "stiffness K_x", "damping D_x", "shaped stiffness K_e", "shaped inertia B_e",
        "control", "tank", "duration", "seed",
    ]  # fmt: skip


def test_the_rigid_law_has_an_inertia_and_no_tank() -> None:
    scenario = baseline_scenario()
    said = dict(facts(baseline(), scenario))
    assert said["law"] == "baseline for rigid joints, task position"
    assert said["target inertia M_x"] == "damping ratio 0.7"
    assert said["motor inertia"] == "ignored"
    assert said["tank"] == "none"
    assert "shaped inertia B_e" not in said


def baseline_scenario():
    from passiflex.simulation import parse_scenario

    return parse_scenario(baseline().data.attrs["scenario"])


@pytest.mark.parametrize(
    ("make", "control", "tank"),
    [
        (continuous, "continuous time", "yes"),
        (sampled, "1 kHz", "yes"),
        (baseline, "continuous time", "none"),
    ],
)
def test_without_a_scenario_the_attributes_say_what_they_can(make, control: str, tank: str) -> None:
    said = dict(facts(make(), None))
    assert (said["control"], said["tank"]) == (control, tank)
    assert said["law"] == make().data.attrs["law"]


def test_a_run_that_ended_early_says_when() -> None:
    run = changed(sampled(), duration=2.0, failure="it left the numbers")
    assert dict(facts(run, None))["duration"] == "0.6 s of 2 s: it left the numbers"


def test_a_limit_that_was_passed_is_among_the_facts() -> None:
    assert "limit passed" not in dict(facts(continuous(), None))
    data = by_rows(continuous()).data
    slow = Run(data.assign(velocity_limit=data["velocity_limit"] * 0 + 1e-3))
    (passed,) = passed_limits(slow)
    assert dict(facts(slow, None))["limit passed"] == str(passed)
    assert str(passed).startswith("joint ")


def test_who_made_it() -> None:
    run = changed(sampled(), version="1.2", commit="0123456789abcdef")
    assert made_by(run) == "passiflex 1.2, commit 0123456"
    assert made_by(changed(run, commit="0123456789abcdef+")) == "passiflex 1.2, commit 0123456 with changes"
    assert made_by(changed(run, commit="unknown")) == "passiflex 1.2, commit unknown"


@pytest.mark.parametrize(
    "path", ["/home/me/arms/arm.yaml", "C:\\arms\\arm.yaml", "arms/arm.yaml", "arm.yaml"]
)
def test_a_robot_file_is_shown_by_its_name(path: str) -> None:
    text = f"name: a\nrobot: {path}\nduration: 1.0\n"
    assert shown_configuration(changed(sampled(), scenario=text)) == text.replace(path, "arm.yaml")


@pytest.mark.parametrize("name", ["arm.yaml", "my arm: #1.yaml"])
def test_a_robot_file_in_quotes_and_over_lines_is_shown_by_its_name(name: str) -> None:
    said = {"name": "a", "robot": f"/home/me/{'a b ' * 40}#x/{name}", "forces": [{"robot": "/not/this"}]}
    text = shown_configuration(changed(sampled(), scenario=yaml.safe_dump(said)))
    assert yaml.safe_load(text) == said | {"robot": name}


@pytest.mark.parametrize("text", ["", "- 1\n", "robot: {a: 1}\n", "name: a\n"])
def test_a_configuration_without_a_robot_file_is_shown_as_it_is(text: str) -> None:
    assert shown_configuration(changed(sampled(), scenario=text)) == text


def test_of_a_configuration_that_is_no_yaml_no_path_is_shown() -> None:
    text = shown_configuration(changed(sampled(), scenario="robot: '/home/me/arm.yaml\nlaw: [1"))
    assert text == "robot: 'arm.yaml\nlaw: [1"


@pytest.mark.parametrize(
    "text",
    ["a" * 1_000_000, "robot: [" * 5000, "robot: 2001-99-99\n", "robot: " + "9" * 5000, "a: b" * 300_000],
)
def test_a_configuration_of_any_kind_is_shown_without_being_waited_for(text: str) -> None:
    """Some took a time that grew as the square of their length."""
    assert shown_configuration(changed(sampled(), scenario=text)) == text
