"""Sensors that are late: what they say, what the books make of it, and a judge who refuses what they make unstable."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from passiflex.errors import PassiflexError, ScenarioError, UnstableLoopError
from passiflex.passivity import audit
from passiflex.problems.altered import altered, later_sensors
from passiflex.sampled.readings import Lateness
from passiflex.scenarios.sensor_settings import DELAYS
from passiflex.simulation import Run, resolve, simulate
from passiflex.simulation.book_cautions import book_cautions
from passiflex.simulation.simulate_sampled import simulate_unchecked
from passiflex.stability.judgement import holds, judge
from passiflex.stability.linear_loop import LinearLoop
from worlds import PERIOD, books, merged, ran, same, world

SLOW: dict[str, Any] = {"law": {"shaped_inertia": {"ratio": 1.0}}}


def late(*periods: float, **changes: Any) -> dict[str, Any]:
    """Return changes with the delays of links, motors, joint torque and wrench, in periods."""
    delays = {name: k * PERIOD for name, k in zip(DELAYS, periods, strict=False)}
    return merged(merged(SLOW, {"sensors": delays}), changes)


def ago(run: Run, name: str, periods: int) -> np.ndarray:
    rows = np.arange(len(run.time))
    return run[name][np.maximum(rows - periods, 0)]


def test_each_reads_what_was_so_long_ago_and_the_books_pair_it() -> None:
    """Whole periods to the last bit, and between two samples the straight line; q̇ and θ̇ with their positions.

    Readings that come apart are paired: Σw is that of the true τ_a and q, as late as the later of the two.
    """
    run = ran(**late(2, 1.25, 3, 4, sensors={"velocity": "true"}))
    np.testing.assert_array_equal(run["measured_q"], ago(run, "q", 2))
    np.testing.assert_array_equal(run["measured_dq"], ago(run, "dq", 2))
    np.testing.assert_array_equal(run["measured_tau_a"], ago(run, "tau_a", 3))
    between = 0.75 * ago(run, "theta", 1) + 0.25 * ago(run, "theta", 2)
    np.testing.assert_allclose(run["measured_theta"], between, rtol=0, atol=1e-14)
    require_paired(run, 3)


def require_paired(run: Run, last: int) -> None:
    w = ((run["tau_a"][1:] + run["tau_a"][:-1]) / 2 * np.diff(run["q"], axis=0)).sum(axis=1)
    true = np.concatenate([[0], np.cumsum(w)])[np.maximum(np.arange(len(run.time)) - last, 0)]
    np.testing.assert_allclose(run["measured_port_energy"], true, rtol=0, atol=1e-14)
    np.testing.assert_allclose(books(run), 2.0, rtol=0, atol=1e-13)
    assert (
        ago(run, "joint_energy", last) - run["measured_port_energy"] <= run["measurement_bound"] + 1e-12
    ).all()
    assert audit(run).verdict == "passive"


def test_no_delay_is_as_if_it_were_not_there() -> None:
    assert same(ran(**late(0, 0, 0, 0)), ran(**SLOW))


@pytest.mark.slow
@pytest.mark.parametrize("periods", [(2, 1, 2), (3, 0, 0), (0, 0, 2)])
def test_sum_w_is_the_energy_of_the_last_instant_that_was_read(periods: tuple[int, int, int]) -> None:
    require_paired(ran(**late(*periods)), max(periods[0], periods[2]))


def test_unpaired_the_mismatch_would_be_a_claim_without_end() -> None:
    """τ = A sin ωt moves q = B sin ωt and gives nothing; with q read late by d it seems to give ½ A B ω sin ωd."""
    t, omega, d = np.arange(2001) * PERIOD, 2 * np.pi * 20, 3
    q, tau = 1e-3 * np.sin(omega * t), 10 * np.sin(omega * t)
    seen = ((tau[d + 1 :] + tau[d:-1]) / 2 * np.diff(q[:-d])).sum()
    expected = 10 * 1e-3 * omega / 2 * np.sin(omega * d * PERIOD) * 2
    assert seen == pytest.approx(expected, rel=0.01)
    assert expected > 0.4
    assert abs(((tau[1:] + tau[:-1]) / 2 * np.diff(q)).sum()) < 1e-6


def refused(**changes: Any) -> str:
    with pytest.raises(UnstableLoopError) as error:
        simulate(world(**changes))
    return str(error.value)


def test_the_judge_sees_a_late_torque() -> None:
    light = {"shaped_inertia": {"ratio": 0.15}}
    on_time, a_little, late_ = (world(law=light, sensors={"torque_delay": k * PERIOD}) for k in (0, 1, 4))
    radii = [LinearLoop(resolve(s), native=False).radius() for s in (on_time, a_little, late_)]
    assert radii[0] < 1
    assert radii[1] < 1
    assert radii[2] > 1.04
    assert not holds(resolve(late_), native=False)


@pytest.mark.slow
def test_a_late_torque_is_refused_with_its_cause_and_a_remedy() -> None:
    text = refused(sensors={"torque_delay": 4e-3}, law={"shaped_inertia": {"ratio": 0.15}})
    assert "sensors that are late, by a torque_delay of 4 ms" in text
    assert "remedy: a torque_delay of at most 1 ms (now 4 ms); or " in text
    better = world(sensors={"torque_delay": 1e-3}, law={"shaped_inertia": {"ratio": 0.15}})
    assert judge(resolve(better)).stable


BORDERS: dict[str, dict[str, Any]] = {
    "torque_delay": {"shaped_inertia": {"ratio": 0.15}},
    "motor_delay": {"shaped_inertia": {"ratio": 1.0}},
    "link_delay": {
        "shaped_stiffness": {"ratio": 5},
        "shaped_inertia": {"ratio": 1.0},
        "stiffness": {"translation": 3000},
        "damping": {"translation": 300},
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("entry", BORDERS)
def test_the_border_is_where_simulations_begin_to_grow(entry: str) -> None:
    """A tenth below the judge's border a small push dies out, a tenth above it grows, for each sensor."""
    pushed = {"at": 0.01, "kind": "step", "by": [0, 0, 1e-5]}

    def problem(periods: float) -> Any:
        changes = {"tank": None, "law": BORDERS[entry], "reference": [pushed], "duration": 4.0}
        return resolve(world(**changes, sensors={entry: periods * PERIOD}))

    low, high = 0.5, 20.0
    assert (
        LinearLoop(problem(low), native=False).radius() < 1 < LinearLoop(problem(high), native=False).radius()
    )
    while high - low > 0.05:
        middle = (low + high) / 2
        holds = LinearLoop(problem(middle), native=False).radius() < 1
        low, high = (middle, high) if holds else (low, middle)
    for share in (0.9, 1.1):
        run = simulate_unchecked(problem(share * low))
        speeds = [np.abs(run["dq"][run.time > t][:1000]).max() for t in (0.5, 2.9)]
        assert (bool(run.failure) or speeds[1] > speeds[0]) == (share > 1)


def test_at_another_rate_it_is_as_late_in_seconds() -> None:
    problem = resolve(world(**late(1.5, 0, 2, 0)))
    faster = altered(problem, rate=2000)
    same_text = resolve(world(**late(1.5, 0, 2, 0), control={"rate": 2000}))
    assert faster.controller.readings == same_text.controller.readings
    assert faster.lateness == same_text.lateness == Lateness(1.5e-3, 0, 2e-3, 0)
    for part in ("sensors", "errors"):
        one, other = (p.parts.unpack(part, p.numbers) for p in (faster, same_text))
        assert all(np.array_equal(one[name], other[name]) for name in one)
    assert LinearLoop(faster, native=False).radius() == pytest.approx(
        LinearLoop(same_text, native=False).radius()
    )
    sooner = later_sensors(problem, Lateness(torque=1e-3))
    assert sooner.controller.readings == resolve(world(**late(0, 0, 1, 0))).controller.readings
    assert resolve(world(**late(0, 0, 1, 0))).text.count("torque_delay: 0.001") == sooner.text.count(
        "torque_delay: 0.001"
    )
    with pytest.raises(PassiflexError, match=r"delay of a sensor; got 40 periods; needs at most 20 periods"):
        altered(problem, rate=20000)


def test_a_sensor_that_is_too_late_is_refused() -> None:
    with pytest.raises(ScenarioError) as error:
        world(sensors={"torque_delay": 0.021, "wrench_delay": 0.02})
    (line,) = str(error.value).splitlines()[1:]
    assert line.endswith("sensors.torque_delay: a sensor is at most 20 periods late; got 21 periods")


def test_what_the_tank_cannot_know_yet_is_said_before_the_run() -> None:
    (line,) = book_cautions(resolve(world(**late(2, 0, 4, 0))))
    assert line == (
        "the tank sees what goes through the joints 4 ms late, and until then can but guess it: its floor of 0.1 J "
        "covers that up to 25 W"
    )
    assert book_cautions(resolve(world(**late(0, 3, 0, 3)))) == ()
    (more,) = book_cautions(resolve(world(**late(2, 0, 4, 0), control={"missed": 0.1})))
    assert more == f"{line}; with periods missed as well it may fall back for good though the loop is sound"


@pytest.mark.slow
def test_another_engine_reads_the_same() -> None:
    """MuJoCo moves the arm, and the sensors, late and noisy, are the law's: both agree to round-off."""
    pytest.importorskip("mujoco")
    wrench = {"rows": "t,fx,fy,fz\n0,0,0,0\n0.2,3,0,2\n0.3,0,0,0\n"}
    noise = {"link_deviation": 1e-5, "motor_deviation": 1e-5}
    scenario = world(**late(2, 0.5, 1, noise=noise, forces=wrench))
    own, other = simulate(scenario), simulate(scenario, engine="mujoco")
    for name in ("q", "measured_q", "tank_energy", "measurement_bound"):
        np.testing.assert_allclose(other[name], own[name], rtol=0, atol=1e-12)
