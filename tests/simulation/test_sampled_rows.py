"""What a sampled loop is told in each period: chance in streams of its own, events in whatever chunk they fall into."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from passiflex.loops.compiled import compiled_sampled_loop
from passiflex.loops.recorded import sample_parts
from passiflex.loops.sampled_loop import SampledLoop
from passiflex.problems.problem import SampledProblem
from passiflex.robots.arm import SerialArm
from passiflex.simulation import ClosedLoop, resolve
from passiflex.simulation.schedule import PeriodRows
from worlds import PERIOD, world

NOISE = {"noise": {"torque_variance": 0.25, "hold": PERIOD}}
ACTING: dict[str, Any] = {
    "drags": [{"from": 0.1, "to": 0.5, "viscous": 5, "dry": 1}, {"from": 0.2, "to": 0.3, "viscous": 2}],
    "feedforward": [{"from": 0.2, "to": 0.4, "force": [3, 0, 0], "moment": [0, 1, 0]}],
    "forces": [{"from": 0.15, "to": 0.45, "force": [0, 0, 2]}],
    "reference": [
        {"at": 0.1, "kind": "step", "by": [0, 0, 0.05]},
        {"at": 0.2, "kind": "circle", "plane": ["x", "z"], "radius": 0.1, "period": 1.0},
    ],
}


def told(*chunks: int, **changes: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the periods' noise, timing with the time since the last one that ran, and rows; made in such chunks."""
    problem = resolve(world(**NOISE | changes))
    assert isinstance(problem, SampledProblem)
    compiled = compiled_sampled_loop(problem.loop)
    rows, first = PeriodRows(problem, compiled.loop.period, compiled.row), 0
    said, timing, at = [], [], compiled.loop.row.slices
    for count in chunks:
        row, when = rows.take(first, count)
        said.append(row)
        timing.append(np.column_stack([when, row[:, at["elapsed"]]]))
        first += count
    whole = np.vstack(said)
    return whole[:, at["torque_noise"]], np.vstack(timing), whole


def test_noise_jitter_and_missed_periods_do_not_touch_each_other() -> None:
    """One stream each: none of them changes when another one is switched on or off."""
    jitter, missed = {"jitter": 1e-3}, {"missed": 0.3}
    noise, timing, _ = told(400, control=jitter | missed)
    for control in ({}, jitter, missed):
        np.testing.assert_array_equal(told(400, control=control)[0], noise)
    np.testing.assert_array_equal(told(400, control=jitter)[1][:, 0], timing[:, 0])
    np.testing.assert_array_equal(told(400, noise=None, control=missed)[1][:, 1:], timing[:, 1:])
    other = told(400, control=jitter | missed, seed=1)
    assert (other[0] != noise).all()
    assert (other[1][:, 0] != timing[:, 0]).all()


def test_rows_do_not_depend_on_the_pieces_that_they_are_made_in() -> None:
    """Events, gains that change one after the other, drags and chance, whatever chunk they fall into."""
    gains = [
        {"at": 0.1 + 0.05 * i, "duration": 0.05, "stiffness": {"translation": 200 + 100 * (i % 3)}}
        for i in range(5)
    ]
    gains.append({"at": 0.36, "duration": 0.01, "damping": {"translation": 50}})
    chance = {"jitter": 1e-3, "missed": 0.3}
    changes = {"gains": gains, "control": chance} | ACTING
    whole = told(500, **changes)
    for chunks in ((1, 150, 349), (100, 25, 25, 25, 325), (499, 1)):
        for one, other in zip(told(*chunks, **changes), whole, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("lasting", [2, 3, 7, 500])
def test_a_sample_of_the_noise_lasts_as_long_as_it_is_held(lasting: int) -> None:
    """Its numbers are those of noise that is new in every period, in their order; the last one is cut off."""
    fresh, _, _ = told(400)
    held, _, _ = told(400, **_held(lasting))
    np.testing.assert_array_equal(held, np.repeat(fresh, lasting, axis=0)[:400])


@pytest.mark.parametrize("chunks", [(1,) * 12, (5, 7), (3, 3, 6), (2, 1, 8, 1), (4, 4, 4)])
@pytest.mark.parametrize("lasting", [3, 4, 30])
def test_noise_that_is_held_does_not_depend_on_the_chunks(chunks: tuple[int, ...], lasting: int) -> None:
    """Chunks that end with a sample, in the middle of one, and that lie within one."""
    changes: dict[str, Any] = {"control": {"jitter": 1e-3, "missed": 0.3}} | _held(lasting)
    for one, other in zip(told(*chunks, **changes), told(12, **changes), strict=True):
        np.testing.assert_array_equal(one, other)


def _held(lasting: int) -> dict[str, Any]:
    return {"noise": {"torque_variance": 0.25, "hold": lasting * PERIOD}}


def test_elapsed_counts_the_missed_periods() -> None:
    _, timing, _ = told(400, control={"missed": 0.5})
    ran_at = np.flatnonzero(timing[:, 1])
    np.testing.assert_allclose(timing[ran_at[1:], 2], np.diff(ran_at) * PERIOD, rtol=1e-12)
    assert timing[0].tolist() == [0, 1, PERIOD]


def test_each_thing_is_said_in_its_own_periods() -> None:
    """From its first instant on, and not at its last; overlapping drags add up."""
    _, _, rows = told(500, **ACTING)
    at = where(**ACTING)
    time = np.arange(500) * PERIOD
    viscous = np.where((time >= 0.1), 5.0, 0.0) + np.where((time >= 0.2) & (time < 0.3), 2.0, 0.0)
    np.testing.assert_array_equal(rows[:, at["viscous_drag"]].ravel(), viscous)
    np.testing.assert_array_equal(rows[:, at["dry_drag"]].ravel(), np.where(time >= 0.1, 1.0, 0.0))
    pressed = np.where((time >= 0.2) & (time < 0.4), 1.0, 0.0)[:, None]
    np.testing.assert_array_equal(rows[:, at["feedforward"]], pressed * [3, 0, 0, 0, 1, 0])
    pushed = np.where((time >= 0.15) & (time < 0.45), 1.0, 0.0)[:, None]
    np.testing.assert_array_equal(rows[:, at["F_e"]], pushed * [0, 0, 2, 0, 0, 0])


def test_the_reference_and_its_derivatives_agree() -> None:
    """On the circle: the velocity is the slope of the position, the acceleration that of the velocity, to h²."""
    _, _, rows = told(500, **ACTING)
    at, turning = where(**ACTING), slice(201, 500)
    position, velocity, acceleration = (
        rows[turning, at[f"desired_{name}"]][:, :3] for name in ("position", "velocity", "acceleration")
    )
    h, third = PERIOD, 0.1 * (2 * np.pi) ** 3
    for value, slope, bound in ((position, velocity, third), (velocity, acceleration, third * 2 * np.pi)):
        difference = (value[2:] - value[:-2]) / (2 * h)
        np.testing.assert_allclose(difference, slope[1:-1], rtol=0, atol=bound * h**2 / 6 * 1.01)
    before = rows[:200, at["desired_velocity"]]
    np.testing.assert_array_equal(before, 0)


def where(**changes: Any) -> dict[str, slice]:
    """Return where each thing is said."""
    problem = resolve(world(**changes))
    assert isinstance(problem, SampledProblem)
    return compiled_sampled_loop(problem.loop).loop.row.slices


def test_a_sampled_run_has_the_units_of_its_joints() -> None:
    """As a run in continuous time has them: a sliding joint has m, m/s and N."""
    sampled = resolve(world())
    assert isinstance(sampled, SampledProblem)
    law, robot = sampled.controller.law, sampled.controller.law.robot
    first, *others = robot.arm.chain.joints
    chain = replace(robot.arm.chain, joints=(first._replace(kind="prismatic"), *others))
    law = replace(law, robot=replace(robot, arm=SerialArm(chain)))
    closed = ClosedLoop(law)
    wanted = {f.name: f.unit for f in closed.state + closed.output_layout}
    parts = sample_parts(SampledLoop(replace(sampled.controller, law=law)))
    found = {f.name: f.unit for layout in parts.values() for f in layout}
    shared = wanted.keys() & found.keys()
    assert {"q", "theta", "dq", "dtheta", "tau_m", "tau_a", "tau_e", "tau_u", "phi", "dphi"} <= shared
    assert {name: found[name] for name in shared} == {name: wanted[name] for name in shared}
    assert found["measured_tau_a"] == found["commanded_torque"] == found["believed_tau_e"] == "N m or N"
    assert (found["measured_q"], found["measured_dq"]) == ("rad or m", "rad/s or m/s")
