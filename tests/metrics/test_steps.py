"""A step in numbers, whatever its direction and sign, and whatever happened before it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from passiflex.metrics.steps import StepWindow, displacement, step_numbers, step_window
from worlds import world

H = 1e-3
TIME = np.arange(3001) * H
BEGIN, END = 0.5, 2.5
Z = np.array([0.0, 0, 1])


def unit(t: np.ndarray, rate: float = 8.0, omega: float = 12.0) -> np.ndarray:
    """Return 1 − e^(−rate t) cos ωt for t > 0: a step of one that swings."""
    t = np.maximum(t, 0)
    return 1 - np.exp(-rate * t) * np.cos(omega * t)


def answer(direction: np.ndarray, size: float, **shape: float) -> np.ndarray:
    return size * unit(TIME - BEGIN, **shape)[:, None] * direction


def numbers(size: float, direction: np.ndarray, before: Any = 0.0, end: float = END) -> dict[str, float]:
    """Return the numbers of a swinging response, held against a slower one that does not swing."""
    window = StepWindow(size, direction, BEGIN, end)
    motion = answer(direction, size) + before
    return step_numbers(TIME, motion, answer(direction, size, rate=3, omega=0) + before, window)


@pytest.mark.parametrize("by", [[0, 0, -1], [1, 0, 0], [2, -3, 6], [-1, -1, 0]])
def test_a_step_in_any_direction_is_one_along_z(by: list[float]) -> None:
    direction = np.array(by) / np.linalg.norm(by)
    assert numbers(0.1, direction) == pytest.approx(numbers(0.1, Z), rel=1e-12)


def test_the_size_of_a_step_does_not_matter() -> None:
    assert numbers(0.02, Z) == pytest.approx(numbers(0.3, Z), rel=1e-12)


def test_the_numbers_of_a_step() -> None:
    found = numbers(0.1, Z)
    inside = (TIME >= BEGIN) & (TIME < END)
    motion, ideal = unit(TIME - BEGIN)[inside], unit(TIME - BEGIN, 3, 0)[inside]
    outside = np.flatnonzero(np.abs(motion - 1) > 0.02)[-1]
    assert found == pytest.approx(
        {
            "overshoot": motion.max() - 1,
            "settling_time": H * (outside + 1),
            "offset_before_step": 0.0,
            "rms_to_msd": math.sqrt(np.mean((motion - ideal) ** 2)),
        },
        rel=1e-9,
    )
    assert found["overshoot"] > 0.1


@pytest.mark.parametrize("before", [0.03, -0.2])
def test_what_was_there_before_the_step_is_not_of_it(before: float) -> None:
    """The reference may have moved before: robot and ideal then both begin elsewhere."""
    moved = numbers(0.1, Z, before=before * Z)
    assert moved.pop("offset_before_step") == pytest.approx(before)
    plain = numbers(0.1, Z)
    assert plain.pop("offset_before_step") == 0
    assert moved == pytest.approx(plain, rel=1e-9)


def test_a_droop_of_the_robot_alone_is_told_but_not_counted() -> None:
    window = StepWindow(0.1, Z, BEGIN, END)
    ideal = answer(Z, 0.1)
    found = step_numbers(TIME, ideal - 0.01 * Z, ideal, window)
    assert found["offset_before_step"] == pytest.approx(-0.01)
    assert found["rms_to_msd"] == pytest.approx(0, abs=1e-12)


def test_a_run_cut_short() -> None:
    """The ideal may be longer. What there is is measured; it has not settled."""
    window, ideal = StepWindow(0.1, Z, BEGIN, END), answer(Z, 0.1, rate=3, omega=0)
    whole = answer(Z, 0.1)
    short = TIME < 2.0
    found = step_numbers(TIME[short], whole[short], ideal, window)
    until = step_numbers(TIME, whole, ideal, window._replace(end=2.0))
    assert found["settling_time"] == math.inf
    assert until.pop("settling_time") < 1
    assert {name: found[name] for name in until} == pytest.approx(until, rel=1e-12)


def test_a_run_cut_short_before_the_step() -> None:
    short = TIME < 0.4
    motion = answer(Z, 0.1)[short]
    found = step_numbers(TIME[short], motion, answer(Z, 0.1), StepWindow(0.1, Z, BEGIN, END))
    assert found["settling_time"] == math.inf
    assert math.isnan(found["overshoot"])
    assert math.isnan(found["rms_to_msd"])


def test_a_last_row_before_the_end_is_the_last_there_can_be() -> None:
    """Rows every 7 ms of a run of 3 s end at 2.996 s: complete. One row less would not be."""
    rows = slice(None, None, 7)
    window, time, motion = StepWindow(0.1, Z, BEGIN, 3.0), TIME[rows], answer(Z, 0.1)[rows]
    assert time[-1] < 3.0
    assert step_numbers(time, motion, motion, window)["settling_time"] < 1
    assert step_numbers(time[:-1], motion[:-1], motion, window)["settling_time"] == math.inf


def test_a_step_at_the_very_start() -> None:
    window = StepWindow(0.1, Z, 0.0, END)
    motion = 0.1 * unit(TIME)[:, None] * Z
    found = step_numbers(TIME, motion, motion, window)
    assert found["offset_before_step"] == 0
    assert found["rms_to_msd"] == 0
    assert found["overshoot"] == pytest.approx(numbers(0.1, Z)["overshoot"], rel=1e-6)


def test_displacement_is_from_the_start() -> None:
    position = np.array([[1.0, 2, 3], [1.5, 2, 2]])
    np.testing.assert_array_equal(displacement(position), [[0, 0, 0], [0.5, 0, -1]])


STEP = {"at": 0.2, "kind": "step", "by": [0, 0, -0.05]}


def test_the_window_of_a_scenario() -> None:
    """A negative step has a positive size, and a direction."""
    window = step_window(world(reference=[STEP], duration=0.6))
    assert window is not None
    assert (window.size, window.begin, window.end) == (0.05, 0.2, 0.6)
    np.testing.assert_allclose(window.direction, [0, 0, -1])


def test_the_direction_of_an_oblique_step() -> None:
    window = step_window(world(reference=[{**STEP, "by": [0.03, 0, 0.04]}]))
    assert window is not None
    assert window.size == pytest.approx(0.05)
    np.testing.assert_allclose(window.direction, [0.6, 0, 0.8])


TURN = {"at": 0.1, "kind": "step", "by": [0, 0, 0]}
MOVE = {"at": 0.1, "kind": "move", "by": [0, 0, 0.1], "duration": 0.2}


@pytest.mark.parametrize("reference", [[], [MOVE], [TURN], [TURN, MOVE | {"at": 0.3}]])
def test_no_step_no_window(reference: list[dict[str, Any]]) -> None:
    assert step_window(world(reference=reference)) is None


def test_the_first_step_that_moves_counts() -> None:
    window = step_window(world(reference=[TURN, STEP, {**STEP, "at": 0.5}]))
    assert window is not None
    assert (window.begin, window.end) == (0.2, 0.5)


SOFT = {"translation": 100}
TABLE = {"kind": "table", "at": 0.0, "relative": True}
GOING_OVER = "t,kx,ky,kz\n0.1,200,200,200\n0.5,100,100,100\n0.55,90,90,90\n"
"""Its gains go on from 0.1 to 0.5 s, whatever comes to the reference meanwhile; what was to begin later does not."""


@pytest.mark.parametrize(
    ("changes", "end"),
    [
        ({"forces": [{"from": 0.3, "to": 0.4, "force": [1, 0, 0]}]}, 0.3),
        ({"forces": [{"from": 0.1, "to": 0.4, "force": [1, 0, 0]}]}, 0.4),
        ({"forces": [{"from": 0.05, "to": 0.1, "force": [1, 0, 0]}]}, 0.6),
        ({"reference": [STEP, {"at": 0.45, "kind": "hold"}]}, 0.45),
        ({"drags": [{"from": 0.35, "to": 0.4, "viscous": 1}]}, 0.35),
        ({"drags": [{"from": 0.1, "to": 0.4, "viscous": 1}]}, 0.4),
        ({"feedforward": [{"from": 0.25, "to": 0.4, "force": [1, 0, 0]}]}, 0.25),
        ({"gains": [{"at": 0.3, "duration": 0.1, "stiffness": SOFT}]}, 0.3),
        ({"gains": [{"at": 0.15, "duration": 0.1, "stiffness": SOFT}]}, 0.25),
        ({"reference": [{**TABLE, "rows": GOING_OVER}, STEP]}, 0.5),
        ({"reference": [{**TABLE, "rows": GOING_OVER, "between": "held"}, STEP]}, 0.6),
        ({"reference": [STEP, {**TABLE, "at": 0.3, "rows": "t,x,y,z\n0,0,0,0\n0.1,0,0,0.1\n"}]}, 0.3),
        (
            {"reference": [STEP, {"at": 0.3, "kind": "path", "points": [{"after": 0.1, "by": [0, 0, 0.1]}]}]},
            0.3,
        ),
    ],
)
def test_the_window_ends_at_the_next_event_of_any_kind(changes: dict[str, Any], end: float) -> None:
    window = step_window(world(**({"reference": [STEP]} | changes)))
    assert window is not None
    assert window.end == pytest.approx(end)
