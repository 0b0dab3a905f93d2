"""A task at a slower rate than the joints: what is held, one joint by hand, the judge."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
import scipy.linalg

from passiflex.errors import ScenarioError, UnstableLoopError
from passiflex.limits import check
from passiflex.limits.own_margin import own_margin
from passiflex.native import find_compiler
from passiflex.passivity import audit
from passiflex.problems.altered import altered
from passiflex.problems.problem import SampledProblem, require_sampled
from passiflex.simulation import resolve, simulate, simulate_problem
from passiflex.simulation.batch import simulate_batch
from passiflex.simulation.simulate_sampled import longest_step, start
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.loop_at_rest import loop_at_rest
from simulation.test_linear_loop import D_X, K_X, LENGTH, B, D, K, one_joint
from worlds import world

SLOW = {"control": {"task_rate": 200}}


def slow(control: dict[str, Any] | None = None, **changes: Any) -> SampledProblem:
    return require_sampled(resolve(world(control=SLOW["control"] | (control or {}), **changes)))


def one(rate: float, task_rate: float, delay: float = 0.0, **law: object) -> SampledProblem:
    gains = {
        "shaped_stiffness": [K], "shaped_inertia": [0.3 * B], "stiffness": {"translation": K_X},
        "damping": {"translation": D_X},
    }  # fmt: skip
    scenario = world(
        posture=[0.3], law=gains | law, reference=[],
        control={"rate": rate, "task_rate": task_rate, "delay": delay, "allow_unstable": True},
        output_interval=1 / task_rate,
    )  # fmt: skip
    return require_sampled(resolve(scenario, one_joint()))


def test_the_outer_torque_is_held_between_two_runs_of_the_task() -> None:
    run = simulate(world(**SLOW))
    held = np.asarray(run["tau_u"])[:-1].reshape(-1, 5, 2)
    assert np.ptp(held, axis=1).max() < 1e-12 * np.abs(held).max()
    assert (np.ptp(run["commanded_torque"][:-1].reshape(-1, 5, 2), axis=1).max(axis=0) > 0.1).all()
    assert np.ptp(held[:, 0], axis=0).min() > 1


def test_a_task_in_every_period_is_one_rate() -> None:
    same = simulate(world(control={"task_rate": 1000}))
    plain = simulate(world())
    np.testing.assert_array_equal(same["q"], plain["q"])


def test_the_grid_stays_where_it_was_after_a_burst() -> None:
    """Periods 6 to 11 are lost: what was due in 10 runs in 12, and then again in 15."""
    lost = [{"at": 0.006, "periods": 6}]
    run = simulate(world(control={"task_rate": 200, "lost": lost}, duration=0.03, reference=[
        {"at": 0, "kind": "move", "by": [0, 0, 0.05], "duration": 0.03}]))  # fmt: skip
    changed = np.flatnonzero(np.abs(np.diff(run["tau_u"], axis=0)).max(axis=1) > 1e-9) + 1
    assert changed.tolist() == [5, 12, 15, 20, 25, 30]


def test_one_joint_has_the_eigenvalues_worked_out_by_hand() -> None:
    """K_e = K: τ_m = τ_a + B/B_e (τ_u − τ_a), with τ_u = −L² (K_x θ + D_x θ̇) of the period in which the task ran."""
    p = one(2000, 400)
    M = float(LinearLoop(p).at.arm.mass_matrix.item())
    A = np.zeros((5, 5))
    tau_a = np.array([-K, K, -D, D])
    A[:2, 2:4], A[2, :4], A[3, :4], A[3, 4] = np.eye(2), tau_a / M, -tau_a / B, 1 / B
    flow = scipy.linalg.expm(A / 2000)[:4]
    ratio, whole = 1 / 0.3, np.eye(5)  # of (x, τ_u held)
    for k in range(5):
        read = np.eye(5)
        if k == 0:
            read[4] = -(LENGTH**2) * np.array([0, K_X, 0, D_X, 0])
        tau_m = np.concatenate([(1 - ratio) * tau_a, [ratio]])
        moved = np.vstack([flow[:, :4] @ np.eye(4, 5) + np.outer(flow[:, 4], tau_m), np.eye(1, 5, 4)])
        whole = moved @ read @ whole
    theirs = np.linalg.eigvals(whole)
    ours = np.linalg.eigvals(LinearLoop(p).matrix())
    for value in theirs[np.abs(theirs) > 1e-3]:
        assert np.abs(ours - value).min() < 1e-5
    assert LinearLoop(p).radius() == pytest.approx(np.abs(theirs).max() ** (1 / 5), rel=1e-6)


def test_the_matrix_is_the_derivative_of_the_loop_itself() -> None:
    p = slow(law={"gravity": "static"}, reference=[], control={"delay": 1e-3})
    loop, periods = LinearLoop(p), 10
    held, at_rest = (
        loop.compiled.held,
        loop_at_rest(p, loop.compiled.loop, p.law.layout.unpack(p.gains), p.period),
    )
    timing = np.tile([p.delay, 1.0], (periods + 1, 1))
    longest = longest_step(p, loop.compiled.plant) / 16
    first = start(p, loop.compiled)
    aged = at_rest.memory.copy()
    aged[loop.compiled.loop.memory.slices["task_age"]] = 4e-3

    def run(z: np.ndarray) -> np.ndarray:
        memory = aged.copy()
        memory[loop.remembered] = z[loop.x.size :]
        begin = first._replace(x=z[: loop.x.size], controller=memory)
        rows = np.tile(at_rest.row, (periods + 1, 1))
        done = held.advance(begin, rows, timing, p.plant, p.numbers, p.period, longest, last=True)
        return np.hstack([done.x[1:], done.controller[:-1, loop.remembered]])

    z, h = np.concatenate([loop.x, aged[loop.remembered]]), 1e-5
    slopes = np.array([(run(z + h * e) - run(z - h * e)) / (2 * h) for e in np.eye(z.size)])
    power = np.eye(len(loop.matrix()))
    for k, each in enumerate(2 * loop.maps()):
        power = each @ power
        expected = power[: z.size, : z.size]
        scale = np.abs(expected).max(axis=1, keepdims=True) + 1e-9
        assert (np.abs(slopes[:, k].T - expected) / scale).max() < 1e-5


@pytest.mark.parametrize("rate", [1000, 4000])
def test_the_judge_and_the_loop_itself_have_the_same_border(rate: float) -> None:
    """D_x that a task at 200 Hz bears: a fifth below it a push dies out, a fifth above it grows."""
    low, high = 10.0, 4000.0
    push = [{"at": 0, "kind": "step", "by": [0, 0, 1e-6]}]
    loop = LinearLoop(slow(control={"rate": rate}, reference=push, duration=0.2))
    while high / low > 1.01:
        middle = (low * high) ** 0.5
        low, high = (
            (middle, high) if loop.radius(gains={"damping": middle * np.eye(3)}) < 1 else (low, middle)
        )
    last, alone = {}, dataclasses.replace(loop.problem.controller, tank=None)
    for share in (0.8, 1.2):
        p = altered(loop.problem, gains={"damping": share * low * np.eye(3)})
        run = simulate_problem(dataclasses.replace(p, controller=alone, allow_unstable=True))
        trembles = np.abs(np.diff(run["dtheta"], 2, axis=0)).max(axis=1)
        last[share] = trembles[-20:].max() / trembles[40:60].max()
    assert last[0.8] < 1
    assert last[1.2] > 10


def test_a_task_that_is_too_slow_is_refused_with_one_that_is_fast_enough() -> None:
    with pytest.raises(UnstableLoopError, match=r"task_rate of at least 333.333 Hz \(now 20 Hz\)"):
        simulate(world(control={"task_rate": 20}, law={"damping": {"translation": 80}}))
    run = simulate(world(control={"task_rate": 1000 / 3}, law={"damping": {"translation": 80}}))
    assert audit(run).verdict == "passive"


def test_frequency_beyond_half_the_tasks_rate_is_told() -> None:
    """A motor made too light for the delay swings above the 50 Hz that samples of a cycle show; turns are counted."""
    loop = LinearLoop(one(2000, 100, 1e-3, shaped_inertia=[0.02 * B]))
    mode, maps = loop.spectrum(), loop.maps()
    state, theta = np.random.default_rng(0).normal(size=len(maps[0])), []
    for each in 100 * maps:
        state = each @ state
        state /= np.linalg.norm(state)
        theta.append(state[1])
    turns = np.count_nonzero(np.diff(np.sign(theta[-1000:]))) / 2
    assert mode.radius > 1.05
    assert mode.frequency == pytest.approx(turns / 0.5, abs=2)
    assert mode.frequency > 100


def test_rates_keep_their_ratio_when_one_is_altered() -> None:
    changed = altered(slow(), rate=2000)
    assert changed.task_periods == 5
    assert "task_rate: 400.0" in changed.text
    assert check(slow(), rate=2000).stable


def test_a_margin_knows_both_rates() -> None:
    assert own_margin(slow()).share < own_margin(require_sampled(resolve(world()))).share


@pytest.mark.skipif(find_compiler() is None, reason="no compiler")
def test_lanes_have_two_rates_as_well() -> None:
    problem = slow(control={"delay": 1e-3})
    ours, alone = simulate_batch([problem], ["q", "tau_u"])[0], simulate_problem(problem)
    np.testing.assert_allclose(ours["q"], alone["q"], atol=1e-12)
    assert np.ptp(np.asarray(ours["tau_u"])[:-1].reshape(-1, 5, 2), axis=1).max() < 1e-10


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"task_rate": 300}, r"rate, 1000 Hz, needs to be a whole multiple of it; got 300 Hz"),
        ({"inner_loop": "matched", "external_torque": "none"}, "with task_rate take plain"),
        ({"missed": 0.1}, "judged for one rate only"),
    ],
)
def test_what_two_rates_do_not_go_with(changes: dict[str, object], text: str) -> None:
    with pytest.raises(ScenarioError, match=text):
        world(control=SLOW["control"] | changes)


def test_the_rigid_law_has_no_inner_loop() -> None:
    law = {
        "type": "rigid",
        "shaped_stiffness": None,
        "shaped_inertia": None,
        "target_inertia": {"translation": 3},
    }
    with pytest.raises(ScenarioError, match="the rigid law has no inner loop; leave it out"):
        world(law=law, tank=None, control=SLOW["control"])
