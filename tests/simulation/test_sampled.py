"""Sampled runs: they tend to continuous time, their energies close, and the books of 1e6 periods do not drift."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from passiflex.loops.compiled import compiled_sampled_loop
from passiflex.passivity import Balance, link_balance, robot_balance
from passiflex.problems.problem import Problem, SampledProblem
from passiflex.simulation import Run, resolve, simulate_problem, simulate_sampled
from worlds import PERIOD, books, ran, same, world

RATES = (1000, 2000, 4000, 8000)
ROWS = {"output_interval": 2e-3}
SIGNALS = ("position", "tau_a", "dtheta", "tank_energy")
CONTINUOUS: dict[str, Any] = {"control": None, "tank": {"kind": None, "accounting": "signed"}}


def orders(continuous: Run, rates: tuple[int, ...], changes: dict[str, Any]) -> dict[str, np.ndarray]:
    """Return by how many powers of two the error of each signal falls from one rate to the double of it."""
    errors: dict[str, list[float]] = {name: [] for name in SIGNALS}
    for rate in rates:
        sampled = ran(**changes | {"control": {"rate": rate} | changes.get("control", {})})
        for name in SIGNALS:
            errors[name].append(np.abs(sampled[name] - continuous[name]).max())
    return {name: -np.diff(np.log2(e)) for name, e in errors.items()}


@pytest.mark.parametrize("stiffness_ratio", [1, 3])
def test_a_held_command_is_an_error_of_first_order(stiffness_ratio: float) -> None:
    """A hold is late by half a period. Position 1.00; torque, motor velocity and tank level within 0.06 of it.

    The continuous run is that of the signed tank, which is the port tank in continuous time (theory note 4).
    """
    gains = {"law": {"shaped_stiffness": {"ratio": stiffness_ratio}}} | ROWS
    found = orders(ran(**gains, **CONTINUOUS), RATES, gains)
    np.testing.assert_allclose(found["position"], 1, rtol=0, atol=5e-3)
    for name in SIGNALS[1:]:
        assert found[name][-1] == pytest.approx(1, abs=0.06), name


def test_the_matched_inner_loop_tends_to_the_continuous_law_as_well() -> None:
    """Its estimates are of higher order: its error falls faster than that of the hold, until that is left."""
    loop = {"control": {"inner_loop": "matched"}} | ROWS
    found = orders(ran(**ROWS, **CONTINUOUS), (1000, 2000, 4000, 8000, 16000), loop)
    for name in SIGNALS:
        assert (found[name] > 0.95).all(), name
        assert found[name][-1] == pytest.approx(1, abs=0.15), name


ROUGH: dict[str, Any] = {
    "law": {"gravity": "static"},
    "motors": {"coulomb_friction": 2, "viscous_friction": [5, 3], "friction_width": 0.05},
    "drags": [{"from": 0.0, "to": 9.0, "viscous": 3, "dry": 0.2}],
    "forces": [{"from": 0.3, "to": 0.5, "force": [3, 0, 2], "moment": [0, 1, 0]}],
    "noise": {"torque_variance": 0.01, "hold": 0.001},
}
"""Friction, drag, weight, pushes and noise: all that the energy of a robot can go through."""


def with_steps(problem: Problem, count: int, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Return the run with `count` steps of the plant in each period."""
    usual = simulate_sampled.RESOLVED
    assert isinstance(problem, SampledProblem)
    plant = compiled_sampled_loop(problem.loop).plant
    longest = simulate_sampled.longest_step(problem, plant)
    with monkeypatch.context() as m:
        m.setattr(simulate_sampled, "RESOLVED", usual * PERIOD / count / longest * (1 + 1e-9))
        return simulate_problem(problem)


@pytest.mark.parametrize("changes", [{}, ROUGH], ids=["ideal", "rough"])
def test_energies_close_to_the_error_of_the_integrator(
    changes: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """H(t) − H(0) = supplied − dissipated, of the links and of the robot with its friction and drag.

    What is left is 1e-7 J at the usual step, and falls with order 4: 16-fold when the step is halved.
    """
    problem = resolve(world(**changes))
    usual = simulate_problem(problem)
    finer = [with_steps(problem, count, monkeypatch) for count in (1, 2, 4, 8)]
    assert same(finer[0], usual)  # here a period is one step, as usual
    for balance, least in ((link_balance, 3.9), (robot_balance, 3.6)):
        left = np.array([balance(run).worst for run in finer])
        assert left[0] < 1e-7
        assert -np.log2(left[3] / left[2]) > least
        assert left[3] < 1e-3 * left[0]


@pytest.mark.parametrize("balance", [link_balance, robot_balance])
@pytest.mark.parametrize("delay", [0.0, 0.3e-3, 2.7e-3])
def test_energies_close_whatever_the_delay(balance: Callable[[Run], Balance], delay: float) -> None:
    """A command that arrives within a period splits the step there, so that no torque is taken for another."""
    late = {"delay": delay, "jitter": 0.5e-3, "missed": 0.2}
    run = ran(**ROUGH | {"law": {"gravity": "static", "shaped_inertia": {"ratio": 1}}, "control": late})
    assert not run.failure
    assert run["joint_energy"].max() > 0.3
    assert balance(run).worst < 1e-7


@pytest.mark.parametrize("signal", ["friction", "joint_loss"])
def test_friction_and_joint_dampers_only_take(signal: str) -> None:
    run = ran(**ROUGH)
    assert (run[f"{signal}_power"] >= 0).all()
    assert (np.diff(run[f"{signal}_energy"]) >= 0).all()
    assert run[f"{signal}_energy"][-1] > 0


def test_a_drag_takes_its_power_from_the_end_effector() -> None:
    """A pure drag of v N s/m and f N takes v|ẋ|² + f|ẋ| (but for the slowest 1 mm/s); τ_eᵀ q̇ is never positive."""
    run = ran(drags=[{"from": 0.0, "to": 9.0, "viscous": 3, "dry": 0.5}])
    speed = np.linalg.norm(np.gradient(run["position"], run.time, axis=0), axis=1)
    taken = -run["external_power"]
    assert (taken >= 0).all()
    moving = speed > 0.02
    assert moving.sum() > 50
    np.testing.assert_allclose(taken[moving], (3 * speed**2 + 0.5 * speed)[moving], rtol=0.02)
    assert np.abs(run["wrench"][:, 3:]).max() == 0


LIMITS = np.array([100.0, 50.0])
TERMS = ("tank_energy", "law_storage", "measured_port_energy", "spilled_energy")


def random_operation(periods: int, rows: int) -> dict[str, Any]:
    """Return what may happen to a robot: steps, pushes, other gains, noise, late and missed periods, limits."""
    rng, end = np.random.default_rng(periods), periods * PERIOD
    reference: list[dict[str, Any]] = []
    at = np.zeros(3)
    for time in np.arange(0.5, end - 0.6, 0.7):
        goal = np.array([rng.uniform(-0.3, 0.05), 0, rng.uniform(-0.2, 0.2)])
        reference.append({"at": round(time, 3), "kind": "step", "by": (goal - at).tolist()})
        at = goal
    gains = [
        {
            "at": round(time, 3),
            "duration": 0.3,
            "stiffness": {"translation": rng.uniform(100, 800)},
            "damping": {"translation": rng.uniform(20, 60)},
        }
        for time in np.arange(0.7, end - 0.6, 0.9)
    ]
    pushes = [
        {"from": round(time, 3), "to": round(time + 0.2, 3), "force": [rng.normal() * 20, 0, 10]}
        for time in np.arange(0.6, end - 0.6, max(1.7, end / 200))
    ]
    return {
        "reference": reference, "gains": gains, "forces": pushes, "duration": end,
        "output_interval": end / rows, "noise": {"torque_variance": 1.0, "hold": 0.001},
        "control": {"missed": 0.1, "delay": 0.5e-3, "jitter": 0.4e-3},
        "motors": {"torque_limit": "robot", "torque_rate_limit": 2e4},
        "tank": {"initial": 10, "cap": 12, "floor": 1, "low": 1.5, "trip": 0.01},
    }  # fmt: skip


@pytest.mark.parametrize("periods", [50_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_the_books_do_not_drift(periods: int) -> None:
    """T + S + Σw + Σspilled stays, to 1e-12 of the largest of them: what rounding does to the sum of 1e6 numbers."""
    run = ran(**random_operation(periods, rows=500))
    assert not run.failure
    H, largest = books(run), max(np.abs(run[term]).max() for term in TERMS)
    np.testing.assert_allclose(H, H[0], rtol=0, atol=1e-12 * largest)
    # It was no idle time.
    assert (np.abs(run["commanded_torque"]) > LIMITS).any()
    assert run["granted_energy"][-1] > 10
    assert run["spilled_energy"][-1] > 0.1
    assert run["governed_time"][-1] > 0.1
    assert not run["latched"].any()
    assert np.ptp(run["held_stiffness"][:, 0, 0]) > 500
