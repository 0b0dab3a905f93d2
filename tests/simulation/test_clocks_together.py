"""Two rates, late sensors, long delays and bursts, where they meet each other and what asks about clocks."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import passiflex as pf
from passiflex.limits import limit_map, recommend_for
from passiflex.limits.confirmation import disturbed
from passiflex.limits.torque_noise import SLOW as SLOWEST
from passiflex.limits.torque_noise import torque_by_noise
from passiflex.metrics.steps import step_window
from passiflex.passivity import audit
from passiflex.problems.problem import SampledProblem, require_sampled
from passiflex.reports.facts import facts
from passiflex.scenarios.control_settings import MOST_PERIODS
from passiflex.simulation import resolve, simulate_problem
from passiflex.simulation.cautions import cautions
from passiflex.stability.driven_loop import driven
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.noise_credit import noise_credit
from worlds import PERIOD, ran, world

SLOW: dict[str, Any] = {"task_rate": 200}


@pytest.mark.parametrize(
    ("control", "why"), [(SLOW, "with task_rate take plain"), ({"delay": 0.021}, "at most 20 periods")]
)
def test_a_recommendation_leaves_out_the_inner_loop_that_it_does_not_go_with(
    control: dict[str, Any], why: str
) -> None:
    soft = {"stiffness": {"translation": 50}, "damping": {"translation": 15}}
    found = recommend_for(world(control=control, law=soft), margin=0.0)
    assert found.inner_loop == "plain"
    assert "the matched inner loop is none here: " in found.other
    assert why in found.other


def test_a_limit_map_scans_rates_with_as_many_periods_of_everything() -> None:
    """Of sensors that are late too, so that theory and simulation are asked about one loop.

    What changes by 1e-5 in a period changes by 2 % in the 2000 that are simulated, which is not seen.
    """
    late = world(sensors={"torque_delay": 1e-3}, control=SLOW, law={"shaped_inertia": {"ratio": 1}})
    found = limit_map(late)
    assert all(p.agrees for p in found.confirmations if abs(p.radius - 1) > 1e-5)
    told = "with as many periods that the sensors are late and a task_rate of a 5th of it"
    assert found.admissible.borders.endswith(told)


def test_a_tank_that_brakes_does_so_in_every_period() -> None:
    """Held for a cycle, its damping of 200 N m s/rad would be what destroys the arm."""
    tank = {"kind": "time_domain", "initial": 0.011, "braking": 200}
    soft = {"damping": {"translation": 15}}
    margins = [audit(ran(tank=tank, law=soft, control={"task_rate": rate})).margin for rate in (1000, 100)]
    assert margins[1] > 10 * margins[0]


def test_a_fallback_does_not_wait_for_the_task() -> None:
    """It takes over in the period that finds the tank overdrawn, and goes on as the task's clock has it."""
    fallback = {"damping": {"translation": 20}, "shaped_inertia": {"ratio": 1}}
    control = SLOW | {"allow_unstable": True, "fallback": fallback}
    run = ran(law={"damping": {"translation": 200}}, control=control, duration=1.5)
    fell = int(np.flatnonzero(run["latched"])[0])
    changes = np.flatnonzero(np.abs(np.diff(run["tau_u"], axis=0)).max(axis=1) > 1e-9) + 1
    assert fell % 5 != 0
    assert fell in changes
    after = changes[changes > fell]
    assert after[0] - fell < 5
    assert not (after % 5).any()
    assert np.abs(run["dq"][-100:]).max() < 0.05


@pytest.mark.parametrize("rate", [1000, 4000])
def test_the_longest_delay_runs_as_the_matrix_says(rate: float) -> None:
    """60 periods: a tenth below the judge's border of the gains' scale a push dies out, a tenth above it grows."""
    late = {"rate": rate, "delay": MOST_PERIODS / rate, "allow_unstable": True}
    push = [{"at": 0, "kind": "step", "by": [0, 0, 1e-6]}]
    motors = {"shaped_inertia": {"ratio": 1}}

    def problem(scale: float) -> SampledProblem:
        gains = {"stiffness": {"translation": 20 * scale**2}, "damping": {"translation": 20 * scale}}
        scenario = world(law=motors | gains, control=late, reference=push, duration=1000 * late["delay"])
        return require_sampled(resolve(scenario))

    low, high = 1e-3, 100.0
    while high / low > 1.01:
        middle = (low * high) ** 0.5
        low, high = (middle, high) if LinearLoop(problem(middle)).radius() < 1 else (low, middle)
    for share in (0.9, 1.1):
        p = problem(share * low)
        run = simulate_problem(
            dataclasses.replace(p, controller=dataclasses.replace(p.controller, tank=None))
        )
        third = len(run.time) // 3
        speed = np.abs(run["dq"]).max(axis=1)
        assert (speed[-third:].max() > speed[third : 2 * third].max()) == (share > 1)


def test_noise_of_a_cycle_is_what_drawing_it_gives() -> None:
    """Credit of noise that lasts for four cycles, drawn through the cycle's own maps, within five standard errors."""
    lasting, n, rng, draws = 20, 2, np.random.default_rng(1), 4000
    noisy = {"torque_variance": 0.2, "hold": lasting * PERIOD}
    problem = require_sampled(resolve(world(control=SLOW, noise=noisy)))
    periods = driven(LinearLoop(problem))
    z, credit = np.zeros((draws, len(periods[0].A))), np.zeros(draws)
    noise = before = q = np.zeros((draws, n))
    for k in range(60 * lasting):
        if k % lasting == 0:
            noise = rng.normal(0, np.sqrt(0.2), (draws, n))
        if k >= 40 * lasting:  # settled by then
            credit -= np.sum((before + noise) / 2 * (z[:, :n] - q), axis=1)
        p, q, before = periods[k % len(periods)], z[:, :n], noise
        z = z @ p.A.T + noise @ p.G.T
    powers = credit / (20 * lasting * problem.period)
    error = float(powers.std()) / draws**0.5
    assert noise_credit(problem) == pytest.approx(float(powers.mean()), abs=5 * error)
    assert 5 * error < 0.3 * noise_credit(problem)


def test_torque_by_noise_of_a_cycle_is_what_drawing_it_gives() -> None:
    """rms of the torque less its low-pass, of 4000 draws in each of 5 cycles: to 1/√(2 · 4000), five times."""
    n, rng, draws = 2, np.random.default_rng(2), 4000
    loop = LinearLoop(require_sampled(resolve(world(control=SLOW))))
    periods, share = driven(loop), 1 - np.exp(-2 * np.pi * SLOWEST * PERIOD)
    z, slow, squares = np.zeros((draws, len(periods[0].A))), np.zeros((draws, n)), np.zeros(n)
    for k in range(2000):
        p, w = periods[k % 5], rng.normal(0, np.sqrt(0.2), (draws, n))
        torque = z @ p.C.T + w @ p.D.T
        if k >= 1975:
            squares += np.mean((torque - slow) ** 2, axis=0) / 25
        slow = slow + share * (torque - slow)
        z = z @ p.A.T + w @ p.G.T
    rms = torque_by_noise(loop, 0.2)
    np.testing.assert_allclose(rms, np.sqrt(squares), rtol=5 / (2 * draws) ** 0.5)


def test_a_burst_is_a_missed_period_to_what_is_said_and_none_to_a_confirmation() -> None:
    problem = resolve(world(sensors={"link_delay": 2e-3}, control={"lost": [{"at": 0.2, "periods": 5}]}))
    assert any("with periods missed as well" in line for line in cautions(problem))
    assert disturbed(problem).lost == ()


def test_rows_of_a_wrench_that_say_the_same_end_no_step() -> None:
    """Its step is looked at until the wrench changes; where it changes from row to row there is none to look at."""
    time = np.arange(600) * PERIOD
    window = step_window(world(forces=[{"rows": pf.wrench_table(time, np.zeros((600, 3))).rows}]))
    assert window is not None
    assert window.end == 0.6
    push = np.column_stack([0.1 * np.sin(np.arange(600)), *np.zeros((2, 600))])
    assert step_window(world(forces=[{"rows": pf.wrench_table(time, push).rows}])) is None


def test_a_report_says_both_rates() -> None:
    run = ran(control=SLOW)
    assert any("the task at 200 Hz" in str(value) for _, value in facts(run, run.scenario))
