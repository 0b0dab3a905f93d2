"""Two integrators against each other, the order of one, and the replay of noise."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from passiflex.control.motion import circle
from passiflex.errors import SimulationError
from passiflex.loops.closed_loop import ClosedLoop
from passiflex.native import fastest_pole
from passiflex.simulation import CompiledLoop, Problem, Run, Scenario, compiled_loop, resolve, simulate
from passiflex.simulation.integrate import SLOW_POLE, held_stretch, resolved_stretch, smooth_stretch

CIRCLE = {"at": 0.1, "kind": "circle", "plane": ["x", "z"], "radius": 0.05, "period": 0.7}


def planar(**changes: Any) -> Scenario:
    """Return a slow closed loop of the planar arm: K_e = K, B_e = B/2."""
    data = {
        "name": "planar",
        "robot": "planar2r",
        "posture": [0.4, 0.9],
        "law": {
            "type": "impedance",
            "task": "position",
            "gravity": "static",
            "shaped_stiffness": {"ratio": 1},
            "shaped_inertia": {"ratio": 0.5},
            "stiffness": {"translation": 200},
            "damping": {"translation": 30},
        },
        "reference": [CIRCLE],
        "forces": [{"from": 0.3, "to": 0.6, "force": [3, 0, -2]}],
        "duration": 1,
        "output_interval": 0.01,
    }
    return Scenario.model_validate(data | changes)


@lru_cache
def loop() -> tuple[Problem, CompiledLoop, np.ndarray, np.ndarray]:
    """Return the planar problem, its functions, and a moving start (x, u)."""
    problem = resolve(planar())
    compiled = compiled_loop(ClosedLoop(problem.law))
    n = problem.law.robot.n
    start = {
        "q": problem.q,
        "theta": problem.theta + 0.002,
        "dq": np.array([0.5, -1]),
        "dtheta": np.array([0.4, -1.1]),
    }
    x = compiled.loop.state.pack(start | {"tank_energy": 2.0, "clock": 0.0})
    motion = circle(problem.home, [1, 0, 0], [0, 0, 1], 0.05, 0.7)
    u = compiled.loop.inputs.pack(
        motion | {"F_e": np.array([3.0, 0, -2, 0, 0, 0]), "torque_noise": np.zeros(n)}
    )
    return problem, compiled, x, u


def test_order_of_runge_kutta_is_four_on_the_closed_loop() -> None:
    """Error ∝ h⁴: halving the step divides it by 16. Richardson's: e(h) − e(h/2) ratios need no exact solution.

    hλ is 0.3 and less, where the next order (5) still counts for a part hλ of it.
    """
    problem, compiled, x, u = loop()
    pole = fastest_pole(compiled.fixed_step.rhs, x, u, problem.numbers)
    period = 0.05
    coarsest = int(np.ceil(pole * period / 0.3))
    ends = []
    for k in range(5):
        result = compiled.fixed_step.advance(
            x, np.zeros(compiled.loop.energies.size), u[None, :], problem.numbers, period, coarsest * 2**k
        )
        ends.append(np.concatenate([result.states[-1], result.quads[-1]]))
    n = problem.law.robot.n
    for part in (slice(0, 4 * n), slice(4 * n, None)):  # motion; tank and energies
        gaps = [np.abs(b[part] - a[part]).max() for a, b in pairwise(ends)]
        orders = np.log2(np.array(gaps[:-1]) / gaps[1:])
        assert orders[0] == pytest.approx(4, abs=0.4)
        assert orders[1] == pytest.approx(4, abs=0.2)


def test_runge_kutta_and_cvodes_agree() -> None:
    """The same stretch, at instants off any grid, by two methods; energies are quadratures of both.

    The step resolves the fastest pole with hλ = 0.56, where Runge-Kutta 4 turns a mode by (hλ)⁴/120 = 8e-4 of each
    radian too little. A mode of 10 % damping lives for e⁻¹/0.1 = 4 rad: 3e-3 of its velocity, 1 rad/s for a joint
    that is let loose as here, and 1/600 of that of its position. A fifth of the step leaves 5⁻⁴ = 1/625.
    """
    problem, compiled, x, u = loop()
    p = problem.numbers
    pole = fastest_pole(compiled.fixed_step.rhs, x, u, p)
    assert pole < SLOW_POLE
    instants = np.array([0.0137, 0.02, 0.03, 0.04, 0.0501, 0.33, 0.777])
    theirs = smooth_stretch(compiled.rhs, x, u, p, instants, 1e-11)
    errors = []
    for finer, bound in ((1, 3e-3), (5, 3e-3 / 625)):
        ours = resolved_stretch(compiled.fixed_step, x, u, p, instants, finer * pole)
        assert ours.failure == theirs.failure == ""
        assert ours.states.shape == (len(instants), x.size)
        np.testing.assert_allclose(ours.states, theirs.states, rtol=0, atol=bound)
        np.testing.assert_allclose(ours.energies, theirs.energies, rtol=0, atol=bound)
        positions = slice(0, 2 * problem.law.robot.n)
        np.testing.assert_allclose(
            ours.states[:, positions], theirs.states[:, positions], rtol=0, atol=bound / 600
        )
        errors.append(np.abs(ours.states - theirs.states).max())
    assert errors[0] / errors[1] > 300


@settings(max_examples=8, deadline=None)
@given(st.lists(st.floats(1e-4, 0.2), min_size=1, max_size=6), st.integers(1, 3))
def test_instants_do_not_change_the_motion(gaps: list[float], repeats: int) -> None:
    """Any instants, even or not: the last row is where one stretch to the last instant ends.

    Both are within Runge-Kutta's error of the truth. A step h ≤ 0.2 ms across a zero of P_X, where |P_X| has a kink of
    some 100 W/s, misses h² · 100 W/s = 4e-6 J of the tank's energy on top.
    """
    problem, compiled, x, u = loop()
    p = problem.numbers
    instants = np.cumsum(np.repeat(gaps, repeats))
    pole = 3 * fastest_pole(compiled.fixed_step.rhs, x, u, p)
    many = resolved_stretch(compiled.fixed_step, x, u, p, instants, pole)
    one = resolved_stretch(compiled.fixed_step, x, u, p, instants[-1:], pole)
    assert len(many.states) == len(instants)
    assert np.isfinite(many.states).all()
    tank = compiled.loop.state.slices["tank_energy"].start
    np.testing.assert_allclose(many.states[-1][:tank], one.states[-1][:tank], rtol=0, atol=1e-6)
    np.testing.assert_allclose(many.states[-1], one.states[-1], rtol=0, atol=1e-5)
    np.testing.assert_allclose(many.energies[-1], one.energies[-1], rtol=0, atol=1e-5)
    clock = compiled.loop.state.slices["clock"]
    np.testing.assert_allclose(many.states[:, clock].ravel(), instants, rtol=0, atol=1e-9)


def common(coarse: Run, fine: Run, name: str) -> np.ndarray:
    """Return the difference of a signal at the instants of the coarse run."""
    rows = np.searchsorted(fine.time, coarse.time - 1e-9)
    np.testing.assert_allclose(fine.time[rows], coarse.time, atol=1e-9)
    return coarse[name] - fine[name][rows]


def test_events_need_not_fall_on_the_output_grid() -> None:
    """Rows at 10 ms or at 0.5 ms, events at odd times in between: the same motion and the same energies.

    The steps of the two differ, and with them the error of the vibration that the events kick: 3e-3 of 0.1 rad/s.
    """
    events = {
        "reference": [{"at": 0.1237, "kind": "step", "by": [0, 0, 0.03]}, {**CIRCLE, "at": 0.5003}],
        "forces": [{"from": 0.2001, "to": 0.71119, "force": [3, 0, -2]}],
    }
    coarse = simulate(planar(**events))
    fine = simulate(planar(**events, output_interval=5e-4))
    assert coarse.time[-1] == pytest.approx(1)
    exact = ("clock", "desired_position", "wrench")
    positions = ("q", "theta", "phi")
    others = (
        "dq",
        "dtheta",
        "tank_energy",
        "external_energy",
        "motor_energy",
        "drawn_energy",
        "joint_loss_energy",
    )
    for names, bound in ((exact, 1e-12), (positions, 5e-7), (others, 3e-4)):
        for name in names:
            np.testing.assert_allclose(common(coarse, fine, name), 0, atol=bound, err_msg=name)


@pytest.mark.parametrize("duration", [0.403, 0.408])
def test_a_run_ends_at_its_duration(duration: float) -> None:
    """Even if that is no row of the output grid: one row more, at the duration, with the state there."""
    run, longer = simulate(planar(duration=duration)), simulate(planar(output_interval=1e-3))
    np.testing.assert_allclose(run.time, [*np.arange(41) * 0.01, duration], rtol=0, atol=1e-12)
    np.testing.assert_allclose(common(run, longer, "q"), 0, atol=5e-7)
    np.testing.assert_allclose(common(run, longer, "dq"), 0, atol=3e-4)


def test_rows_at_events_are_those_after_them() -> None:
    """A row that falls on an event has the wrench and the reference that begin there."""
    run = simulate(planar(reference=[{"at": 0.2, "kind": "step", "by": [0, 0, 0.03]}]))
    row = {t: int(np.argmin(np.abs(run.time - t))) for t in (0.19, 0.2, 0.3, 0.6)}
    assert run["desired_position"][row[0.2], 2] - run["desired_position"][row[0.19], 2] == pytest.approx(0.03)
    np.testing.assert_array_equal(run["wrench"][row[0.3]], [3, 0, -2, 0, 0, 0])
    np.testing.assert_array_equal(run["wrench"][row[0.6]], np.zeros(6))
    assert (run["wrench"][row[0.6] - 1] != 0).any()


NOISE = {"torque_variance": 0.2, "hold": 0.001}


def noisy(seed: int, **changes: Any) -> Run:
    return simulate(planar(noise=NOISE, duration=0.4, forces=[], seed=seed, **changes))


def test_noise_is_replayed_bit_for_bit() -> None:
    """The same seed gives the same run; another one another run; and no noise a third."""
    first, again, other, none = noisy(3), noisy(3), noisy(4), simulate(planar(duration=0.4, forces=[]))
    for name in first.data.data_vars:
        np.testing.assert_array_equal(first[str(name)], again[str(name)], err_msg=str(name))
    assert np.abs(first["q"] - other["q"]).max() > 1e-6
    assert np.abs(first["q"] - none["q"]).max() > 1e-6
    assert first.data.attrs["seed"] == 3


def test_noise_does_not_depend_on_what_is_recorded() -> None:
    """Coarser rows are a part of the finer ones, though the events split the noise elsewhere.

    The step is taken from the pole at the start of each stretch, which is the same for both: bit for bit.
    """
    coarse, fine = noisy(3, output_interval=0.02), noisy(3, output_interval=0.001)
    np.testing.assert_array_equal(common(coarse, fine, "q"), 0)
    np.testing.assert_array_equal(common(coarse, fine, "motor_energy"), 0)


def test_noise_has_its_variance_at_the_motors() -> None:
    """K_e = K makes K_F = 0, and B_e = B/2 makes K_H = 2: the noise reaches τ_m as K_H − 1 = 1 of itself.

    So τ_m of a noisy row less τ_m of the same state without noise is the noise, here 300 samples of 2 joints; its
    variance is met within 5 standard errors, 5 √(2/600) = 29 %.
    """
    run = noisy(5, output_interval=0.001)
    problem, compiled, *_ = loop()
    layout = compiled.loop.inputs
    clean = []
    moving = run.time >= 0.1
    motion = circle(problem.home, [1, 0, 0], [0, 0, 1], 0.05, 0.7)
    u = layout.pack(motion | {"F_e": np.zeros(6), "torque_noise": np.zeros(2)})
    for i in np.flatnonzero(moving)[:-1]:
        x = compiled.loop.state.pack({f.name: run[f.name][i] for f in compiled.loop.state})
        clean.append(compiled.outputs(x, u, problem.numbers)[compiled.loop.output_layout.slices["tau_m"]])
    noise = run["tau_m"][moving][:-1] - np.array(clean)
    assert noise.var() == pytest.approx(0.2, rel=0.29)
    assert abs(noise.mean()) < 5 * np.sqrt(0.2 / noise.size)


@pytest.mark.parametrize(
    ("changes", "time"),
    [
        ({"forces": [{"from": 0.1005, "to": 0.2, "force": [1, 0, 0]}]}, "0.1005"),
        ({"reference": [{**CIRCLE, "at": 0.0333}]}, "0.0333"),
        ({"duration": 0.4005}, "0.4005"),
    ],
)
def test_events_between_two_samples_of_the_noise_are_refused(changes: dict[str, Any], time: str) -> None:
    scenario = planar(**({"noise": NOISE, "duration": 0.4, "forces": []} | changes))
    with pytest.raises(
        SimulationError, match=f"time {time} s does not fall on the noise's grid; needs a multiple"
    ):
        simulate(scenario)


def test_a_run_that_diverges_ends_there_and_says_so() -> None:
    """Energy that explodes is a result: rows up to then, a reason, and no exception."""
    problem, compiled, x, u = loop()
    held = np.tile(u, (400, 1))
    held[:, compiled.loop.inputs.slices["torque_noise"]] = 1e200
    rows = np.arange(1, 401)
    stretch = held_stretch(compiled.fixed_step, x, held, problem.numbers, 1e-3, rows)
    assert "left the finite numbers" in stretch.failure
    assert np.isnan(stretch.states[-1]).all()
