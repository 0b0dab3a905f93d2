"""Without contact a run is the same whoever moves the robot, but for round-off; energies to the error of their rule."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from cli.shell import Shell
from passiflex.errors import NameUnknownError, ValueRangeError
from passiflex.extras import MissingExtraError
from passiflex.loops.compiled import compiled_sampled_loop
from passiflex.passivity import audit, link_balance
from passiflex.problems.problem import SampledProblem
from passiflex.reports.facts import facts
from passiflex.simulation import Run, parse_scenario, resolve, simulate, simulate_problem, simulate_sampled
from passiflex.studies import shipped_scenario
from worlds import PERIOD, PLAIN, planar_text, world

ANGLE = 1e-6
"""What is promised [rad]; at equal steps the two integrators are one method, and what is left is round-off."""
ENERGY = 1e-9
"""[J]; summed up over the same stages by the same rule."""
LATE: dict[str, Any] = {
    "law": {"gravity": "static", "shaped_inertia": {"ratio": 1}},
    "control": {"delay": 0.3e-3, "jitter": 1.4e-3, "missed": 0.2},
    "sensors": {"velocity": "differences", "link_resolution": 1e-4},
    "noise": {"torque_variance": 0.01, "hold": 0.002},
    "motors": {
        "coulomb_friction": 2,
        "viscous_friction": [5, 3],
        "friction_width": 0.05,
        "torque_limit": "robot",
    },
    "drags": [{"from": 0.0, "to": 9.0, "viscous": 3, "dry": 0.2}],
    "forces": [{"from": 0.3, "to": 0.5, "force": [3, 0, 2], "moment": [0, 1, 0]}],
}
"""Commands that come late, in disorder or never; friction, drag, weight, a push, noise."""


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(monkeypatch, capsys)


def both(problem: SampledProblem) -> tuple[Run, Run]:
    return simulate_problem(problem), simulate_problem(problem, "mujoco")


def resolved(**changes: Any) -> SampledProblem:
    problem = resolve(world(**changes))
    assert isinstance(problem, SampledProblem)
    return problem


def require_same(one: Run, other: Run, angle: float = ANGLE, energy: float = ENERGY) -> None:
    assert not one.failure
    assert not other.failure
    assert set(one.data) == set(other.data)
    np.testing.assert_array_equal(one.time, other.time)
    for name in map(str, one.data):
        if name.endswith("_energy"):
            np.testing.assert_allclose(other[name], one[name], rtol=0, atol=energy, err_msg=name)
    for name in ("q", "theta", "measured_q", "position"):
        np.testing.assert_allclose(other[name], one[name], rtol=0, atol=angle, err_msg=name)
    np.testing.assert_allclose(other["tau_m"], one["tau_m"], rtol=0, atol=1e-4)


STATES: dict[str, Any] = {
    "motors": {"coulomb_friction": 2, "friction": "sticks"},
    "environment": [{"kind": "load", "from": 0.2, "to": 0.5, "mass": 1.0}],
}
"""Elements with states of their own, which go along with MuJoCo's stages."""
SLOW: dict[str, Any] = {"control": {"task_rate": 200, "delay": 1e-3}}
"""Two rates."""


@pytest.mark.parametrize("changes", [{}, LATE, STATES, SLOW], ids=["ideal", "late", "states", "slow"])
def test_a_run_is_the_same_in_mujoco(changes: dict[str, Any]) -> None:
    one, other = both(resolved(**changes))
    require_same(one, other, angle=1e-11)
    assert audit(one).verdict == audit(other).verdict
    assert (one.engine.partition(" ")[0], other.engine.partition(" ")[0]) == ("passiflex", "mujoco")
    assert other.moved_elsewhere
    assert not one.moved_elsewhere


@pytest.mark.slow
def test_so_is_that_of_an_iiwa_with_its_sensors() -> None:
    """A step and a push in 4 s at 1 kHz, with noise and a command that is late by a period."""
    scenario = shipped_scenario("fig1_sampled")
    data = scenario.model_dump(mode="json", exclude_unset=True) | {"duration": 4.0}
    data["reference"] = [{"at": 0.5, "kind": "step", "by": [0, 0, 0.1]}]
    data["forces"] = [{"from": 2.0, "to": 3.0, "force": [0, 4, 0]}]
    problem = resolve(parse_scenario(yaml.safe_dump(data)))
    assert isinstance(problem, SampledProblem)
    require_same(*both(problem))


UR5E = """\
name: carries
robot: ur5e
posture: [0, -1.2, 1.6, -1.9, -1.57, 0]
law:
  type: impedance
  task: pose
  gravity: static
  shaped_stiffness: {ratio: 1}
  shaped_inertia: {ratio: 1}
  stiffness: {translation: 300, rotation: 20}
  damping: {translation: 60, rotation: 4}
control: {rate: 1000, delay: 1 ms, external_torque: none}
tool: {mass: 0.4, centre: [0, 0, 0.03], position: [0, 0.02, 0.1], rotation_vector: [0, 0.3, 0]}
payload: {mass: 1.5, centre: [0.02, 0, 0.05]}
tank: {kind: port, initial: 2}
reference:
  - {at: 0.2, kind: circle, radius: 0.05, period: 2, plane: [y, z]}
forces:
  - {from: 1.0, to: 2.0, force: [5, -4, 8], moment: [0.5, 0.2, -0.4]}
duration: 3
output_interval: 0.001
"""


@pytest.mark.slow
def test_so_is_that_of_a_ur5e_that_carries_something_along_a_circle() -> None:
    problem = resolve(parse_scenario(UR5E))
    assert isinstance(problem, SampledProblem)
    require_same(*both(problem))


def with_step(problem: SampledProblem, count: int, engine: str, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Return the run with so many steps of the plant in each period."""
    longest = simulate_sampled.longest_step(problem, compiled_sampled_loop(problem.loop).plant)
    with monkeypatch.context() as m:
        share = simulate_sampled.RESOLVED * PERIOD / count / longest * (1 + 1e-9)
        m.setattr(simulate_sampled, "RESOLVED", share)
        return simulate_problem(problem, engine)


def test_the_error_of_mujocos_steps_falls_with_their_fourth_power(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against the native loop at 32 steps per period; and so does what is left in the links' balance."""
    problem = resolved(motors={"viscous_friction": 5}, law={"gravity": "static"})
    exact = with_step(problem, 32, "passiflex", monkeypatch)
    runs = [with_step(problem, count, "mujoco", monkeypatch) for count in (1, 2, 4)]
    errors = [np.abs(run["q"] - exact["q"]).max() for run in runs]
    left = [link_balance(run).worst for run in runs]
    for found in (errors, left):
        orders = -np.diff(np.log2(found))
        assert (orders > 3.6).all(), (found, orders)


def test_a_warning_of_mujoco_ends_the_run() -> None:
    """Under a push that no robot has felt, at the end of that period; the rows before it stay."""
    run = simulate_problem(resolved(forces=[{"from": 0.2, "to": 0.5, "force": [1e12, 0, 0]}]), "mujoco")
    assert run.failure.startswith("MuJoCo warned of BADCTRL 0.2")
    assert run.time[-1] == pytest.approx(0.2)
    assert np.isfinite(run["q"]).all()


def test_an_engine_that_there_is_not_is_refused() -> None:
    with pytest.raises(
        NameUnknownError, match=r"unknown engine; got 'bullet'; needs one of mujoco, passiflex"
    ):
        simulate(world(), engine="bullet")


def test_continuous_time_is_refused() -> None:
    with pytest.raises(
        ValueRangeError, match=r"runs sampled loops.*in continuous time; needs `control.*try the engine"
    ):
        simulate(parse_scenario(planar_text()), engine="mujoco")


def test_without_mujoco_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(
        MissingExtraError, match=r"the engine mujoco needs the package 'mujoco'.*passiflex\[mujoco\]"
    ):
        simulate(world(), engine="mujoco")


def test_the_command_line_has_the_engine(shell: Shell, tmp_path: Path) -> None:
    """A run that another engine moved is said to be so by `simulate`, by `audit`, and on its page."""
    scenario, out = tmp_path / "s.yaml", tmp_path / "run.nc"
    scenario.write_text(PLAIN)
    made = shell("simulate", scenario, "--engine", "mujoco", "--out", out)
    assert made.status == 0
    assert "moved by mujoco 4." in made.out
    assert "moved by mujoco 4." in shell("audit", out).out
    run = Run.load(out)
    assert run.moved_elsewhere
    assert ("moved by", run.engine) in facts(run, run.scenario)
    native = simulate(world())
    assert "moved by" not in dict(facts(native, native.scenario))
    wrong = shell("simulate", scenario, "--engine", "mojoco", "--out", out)
    assert (wrong.status, wrong.out.count("moved by")) == (2, 0)
    assert "unknown engine; got 'mojoco'; needs one of mujoco, passiflex; try 'mujoco'" in wrong.err
