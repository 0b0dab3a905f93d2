"""Contacts in MuJoCo: a wall of given N/m, against the same wall in the native loop, and against statics."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from engines.walls import Wall
from passiflex.control.posture import posture
from passiflex.loops.compiled import compiled_sampled_loop
from passiflex.passivity import audit
from passiflex.problems.own_parts import with_parts
from passiflex.problems.problem import SampledProblem
from passiflex.simulation import Run, resolve, simulate_problem, simulate_sampled
from worlds import PERIOD, world

STIFFNESS = 200.0
DOWN: dict[str, Any] = {
    "reference": [{"at": 0.1, "kind": "step", "by": [0, 0, -0.05]}],
    "tank": {"initial": 10},
    "law": {"damping": {"translation": 60}},
    "duration": 2.0,
}
HEIGHT = 0.01
"""How far the wall is below the hand at the start [m]."""


def pressed(wall: Wall, **changes: Any) -> SampledProblem:
    problem = with_parts(resolve(world(**DOWN | changes)), elements=[wall])
    assert isinstance(problem, SampledProblem)
    return problem


def wall(stiffness: float, **changes: Any) -> Wall:
    """Return a wall with a tenth of the damping that is critical for a kilogram."""
    hand = resolve(world()).home.position[2] - changes.get("roundness", 0.02)
    damping = 0.2 * np.sqrt(stiffness)
    return Wall(stiffness=stiffness, damping=damping, height=hand - HEIGHT, **changes)


def in_steps(problem: SampledProblem, count: int, engine: str, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Return the run with so many steps of the plant in each period."""
    longest = simulate_sampled.longest_step(problem, compiled_sampled_loop(problem.loop).plant)
    with monkeypatch.context() as m:
        share = simulate_sampled.RESOLVED * PERIOD / count / longest * (1 + 1e-9)
        m.setattr(simulate_sampled, "RESOLVED", share)
        return simulate_problem(problem, engine)


def asked(run: Run, problem: SampledProblem) -> np.ndarray:
    """Return K_x (f(φ) − x_d) at the end (3,) [N]."""
    robot = problem.law.robot
    there = posture(robot, run["phi"][-1], robot.layout.unpack(problem.model)).pose.position
    return STIFFNESS * (there - run["desired_position"][-1])


@pytest.mark.parametrize("stiffness", [1e3, 1e4, 1e5, 1e6])
def test_a_wall_is_what_its_stiffness_says(stiffness: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Force, depth and energies are those of the native loop with the same wall; 4 steps per period.

    MuJoCo's contact has a mass of 2e-4 of the hand's, and the impact has this share of an error. At rest the force is
    that of the law, and the depth that of the wall.
    """
    problem = pressed(wall(stiffness))
    native = in_steps(problem, 4, "passiflex", monkeypatch)
    run = in_steps(problem, 4, "mujoco", monkeypatch)
    assert not run.failure
    assert set(run.data) - set(native.data) == {"wall_wrench"}
    normal, ours = run["wrench"][:, 2], native["wrench"][:, 2]
    assert normal[-1] == pytest.approx(asked(run, problem)[2], rel=1e-3)
    assert run["wall_storage"][-1] == pytest.approx(normal[-1] ** 2 / 2 / stiffness, rel=1e-3)
    assert normal.max() == pytest.approx(ours.max(), rel=1e-3)
    assert np.abs(run["q"] - native["q"]).max() < 1e-6
    for name in map(str, native.data):
        if name.endswith("_energy"):
            np.testing.assert_allclose(run[name], native[name], rtol=0, atol=5e-5, err_msg=name)
    seen = audit(run)
    assert seen.verdict == audit(native).verdict
    assert seen.integration_error < 1e-5
    assert seen.ledger_residual < 1e-5


def test_its_error_falls_with_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the books, by an order of 2 and more: an impact within a step has no higher one."""
    problem = pressed(wall(1e6))
    left = [
        audit(in_steps(problem, count, "mujoco", monkeypatch)).integration_error for count in (1, 2, 4, 8)
    ]
    assert (-np.diff(np.log2(left)) > 2).all()
    assert left[0] < 1e-4


@pytest.mark.parametrize(
    ("shape", "sizes", "below"),
    [("box", (0.5, 0.5, 0.1), 0.1), ("sphere", (0.3,), 0.3), ("cylinder", (0.3, 0.1), 0.1)],
)
def test_any_shape_is_pressed_on(shape: str, sizes: tuple[float, ...], below: float) -> None:
    home = resolve(world()).home.position
    element = wall(1e5, shape=shape, sizes=sizes, centre=(float(home[0]), 0.0, -below))
    run = simulate_problem(pressed(element, law={"damping": {"translation": 60}}), "mujoco")
    assert not run.failure
    assert run["wrench"][-1, 2] == pytest.approx(asked(run, pressed(element))[2], rel=0.02)
    assert audit(run).ledger_residual < 1e-4


def test_friction_is_dry_and_sticks() -> None:
    """Drawn along by 1 N it stays, but for a creep below 1 mm/s; drawn by more than μ times the force it slides."""
    push = [{"from": 1.0, "to": 1.5, "force": [1.0, 0, 0]}, {"from": 2.0, "to": 3.0, "force": [12.0, 0, 0]}]
    problem = pressed(wall(1e5, friction=0.4), forces=push, duration=2.3)
    run = simulate_problem(problem, "mujoco")
    assert not run.failure
    x, force = run["position"][:, 0], run["wall_wrench"]
    at = run.time.searchsorted
    assert abs(x[at(1.45)] - x[at(1.1)]) < 3e-4
    assert np.abs(force[at(1.4), 0]) < 0.4 * force[at(1.4), 2]
    speed = np.gradient(x, run.time)
    sliding = (run.time > 2.02) & (speed > 0.02)
    assert sliding.sum() > 20
    np.testing.assert_allclose(-force[sliding, 0], 0.4 * force[sliding, 2], rtol=1e-2)
    seen = audit(run)
    assert seen.integration_error < 1e-4
    assert seen.ledger_residual < 1e-3
    assert run["wall_energy"][-1] > 0.01
