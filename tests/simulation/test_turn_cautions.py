"""What is said before a run that turns its reference too far, or pushes its hand round."""

# ruff: noqa: E501 - one pinned message per line

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml

from passiflex.simulation import parse_scenario, resolve
from passiflex.simulation.cautions import cautions
from worlds import merged

SCENARIO: dict[str, Any] = {
    "name": "turned",
    "robot": "iiwa14",
    "posture": [0, 0.6, 0, -1.2, 0, 1, 0],
    "law": {
        "type": "impedance",
        "task": "pose",
        "gravity": "robot",
        "shaped_stiffness": {"ratio": 1},
        "shaped_inertia": {"ratio": 1},
        "stiffness": {"translation": 300, "rotation": 30},
        "damping": {"translation": 60, "rotation": 6},
        "null_space_damping": 5,
    },
    "duration": 9,
}
SAMPLED = {"control": {"rate": 1000}}
ANISOTROPIC = {"law": {"stiffness": {"rotation": [60, 60, 10]}}}


def said(**changes: Any) -> tuple[str, ...]:
    return cautions(resolve(parse_scenario(yaml.safe_dump(merged(SCENARIO, changes)))))


def step(at: float, degrees: float, axis: int = 2) -> dict[str, Any]:
    turn = [f"{degrees if i == axis else 0} deg" for i in range(3)]
    return {"at": at, "kind": "step", "by": [0, 0, 0], "turn": turn}


def push(moment: float, **more: Any) -> dict[str, Any]:
    """Return a moment about the tool of the start."""
    home = resolve(parse_scenario(yaml.safe_dump(SCENARIO))).home.rotation
    return {"from": 0.2, "to": 6, "moment": (moment * home[:, 2]).tolist()} | more


@pytest.mark.parametrize("more", [{}, SAMPLED, {"law": {"shaped_stiffness": {"ratio": 5}}}])
def test_half_a_turn_is_said_in_every_kind_of_run(more: dict[str, Any]) -> None:
    assert said(reference=[step(0.1, 180)], **more) == (
        "at 0.1 s the reference is turned by 180.0° from where the hand is: the rotational spring, K sin(angle), begins with 0 N m of its 30 N m and may hold the hand there, or let it go in either direction; turn in steps of 90° or less",
    )


@pytest.mark.parametrize(
    ("degrees", "count"), [(90, 0), (149, 0), (151, 1), (170, 1), (190, 1), (211, 0), (360, 0)]
)
def test_only_turns_near_half_a_turn_are(degrees: float, count: int) -> None:
    lines = said(reference=[step(0, degrees, axis=1)])
    assert len(lines) == count
    if degrees == 170:
        assert "170.0° " in lines[0]
        assert f"{30 * np.sin(np.radians(170)):.2f} N m of its 30 N m" in lines[0]


def test_two_turns_count_together_while_the_hand_is_on_its_way() -> None:
    """Its spring and damper have 6/30 = 0.2 s: after 10 ms it is where it was, after 5 s it is there."""
    assert len(said(reference=[step(1, 100), step(1.01, 80)])) == 1
    assert not said(reference=[step(1, 100), step(6, 80)])


def test_a_moment_that_the_spring_holds_is_not_worth_a_word() -> None:
    assert not said(forces=[push(-9)], **ANISOTROPIC)
    assert not said(forces=[push(29.5)])


def test_a_moment_beyond_the_spring_is_said_with_what_it_holds() -> None:
    assert said(forces=[push(-11)], **ANISOTROPIC) == (
        "from 0.2 s on a moment of 11 N m acts on the hand: the rotational spring, K sin(angle), holds 10 N m at most in that direction, and the hand turns on and on; take a stiffer rotation, or a smaller moment",
    )


def test_moments_of_all_sources_count_together() -> None:
    """Two forces that overlap, or a force and a feed-forward wrench: 18 N m each, 30 held."""
    assert len(said(forces=[push(18), push(18, **{"from": 1, "to": 2})])) == 1
    assert not said(forces=[push(18, to=0.9), push(18, **{"from": 1, "to": 2})])
    assert len(said(forces=[push(18)], feedforward=[push(18)], **SAMPLED)) == 1
    assert not said(forces=[push(18)], feedforward=[push(-18)], **SAMPLED)


def test_the_stiffness_of_the_moment_counts() -> None:
    """Softened in flight to 10 N m/rad, the spring no longer holds 18 N m."""
    soft = [{"at": 2, "duration": 1, "stiffness": {"translation": 300, "rotation": 10}}]
    (line,) = said(forces=[push(18)], gains=soft, **SAMPLED)
    assert line.startswith("from 2 s on a moment of 18 N m acts")
    assert "holds 10 N m at most" in line


def test_a_position_task_and_a_free_axis_have_no_angle() -> None:
    position = {"task": "position", "stiffness": {"rotation": None}, "damping": {"rotation": None}}
    assert not said(law=position, forces=[push(50)])
    free = {"stiffness": {"rotation": [30, 30, 0]}, "damping": {"rotation": [6, 6, 0]}}
    home = resolve(parse_scenario(yaml.safe_dump(SCENARIO))).home.rotation
    about = {"at": 1, "kind": "step", "by": [0, 0, 0], "turn": (np.pi * home[:, 2]).tolist()}
    assert not said(law=free, reference=[about])
    (line,) = said(law=free, forces=[push(1)])
    assert "holds 0 N m at most" in line
