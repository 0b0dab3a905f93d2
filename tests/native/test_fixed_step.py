"""Runge-Kutta 4: order, holds, quadratures, divergence, and the choice of the step."""

import casadi as cs
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from passiflex.errors import CompilerError, SizeError, ValueRangeError
from passiflex.native import (
    DRIVER,
    FixedStep,
    NativeFunction,
    compile_functions,
    fastest_pole,
    find_compiler,
    stable_step,
)

PERIOD = 0.1


def pendulum():
    """Return a damped pendulum with a torque; its quadratures are the dissipated and the supplied work."""
    x, u, p = cs.SX.sym("x", 2), cs.SX.sym("u"), cs.SX.sym("p", 2)
    q, dq = x[0], x[1]
    dx = cs.vertcat(dq, -p[0] * cs.sin(q) - p[1] * dq + u)
    return cs.Function("pendulum", [x, u, p], [dx, cs.vertcat(p[1] * dq**2, u * dq)])


def runaway():
    """Return dx/dt = x² + u, which reaches infinity at t = 1/x0."""
    x, u, p = cs.SX.sym("x"), cs.SX.sym("u"), cs.SX.sym("p", 0)
    return cs.Function("runaway", [x, u, p], [x**2 + u, cs.SX(0, 1)])


def sums():
    """Return dx/dt = u, dquad/dt = x0: Runge-Kutta is exact up to rounding, every hold is visible."""
    x, u, p = cs.SX.sym("x", 2), cs.SX.sym("u", 2), cs.SX.sym("p", 0)
    return cs.Function("sums", [x, u, p], [u, x[0]])


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    if find_compiler() is None:
        pytest.skip("no compiler")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PASSIFLEX_CACHE", str(tmp_path_factory.mktemp("cache")))
        return compile_functions([pendulum(), runaway(), sums()], driver=DRIVER)


@pytest.fixture(params=["compiled", "machine"])
def where(request):
    return request.getfixturevalue("library") if request.param == "compiled" else None


def test_the_order_is_four(where):
    stepper = FixedStep(pendulum(), where)
    held = np.sin(np.arange(10.0))[:, None]
    p, start = np.array([9.0, 0.3]), np.array([1.0, 0.0, 0.0, 0.0])

    def exact(y):
        for u in held[:, 0]:
            y = solve_ivp(
                lambda t, y, u=u: [y[1], -9 * np.sin(y[0]) - 0.3 * y[1] + u, 0.3 * y[1] ** 2, u * y[1]],
                (0, PERIOD), y, method="DOP853", rtol=1e-13, atol=1e-14,
            ).y[:, -1]  # fmt: skip
        return y

    reference = exact(start)
    steps, errors = np.array([1, 2, 4, 8]), []
    for substeps in steps:
        run = stepper.advance(start[:2], start[2:], held, p, PERIOD, substeps)
        errors.append(np.abs(np.concatenate([run.states[-1], run.quads[-1]]) - reference))
    orders = np.log2(np.array(errors)[:-1] / np.array(errors)[1:])
    assert orders[-1].min() > 3.8, "state and quadratures converge with order 4"
    assert np.array(errors)[-1].max() < 1e-6


def test_the_books_of_the_pendulum_close(where):
    p = np.array([9.0, 0.3])
    run = FixedStep(pendulum(), where).advance([1.0, 0.0], [0, 0], np.full((50, 1), 2.0), p, PERIOD, 50)
    energy = run.states[:, 1] ** 2 / 2 - p[0] * np.cos(run.states[:, 0])
    # Global error ~ h⁴ = 1.6e-11, times the fifth derivative ~ 3⁵.
    np.testing.assert_allclose(energy - energy[0], run.quads[:, 1] - run.quads[:, 0], atol=4e-9)
    assert (np.diff(run.quads[:, 0]) >= 0).all(), "a damper never gives power"


def test_native_equals_machine(library):
    held = np.random.default_rng(1).normal(size=(40, 1))
    runs = [
        FixedStep(pendulum(), which).advance([1.0, 0.5], [0.1, 0.2], held, [9.0, 0.3], PERIOD, 7, 3)
        for which in (library, None)
    ]
    assert runs[0].completed == runs[1].completed == 40
    assert runs[0].states.shape == (14, 2)
    np.testing.assert_allclose(runs[0].states, runs[1].states, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(runs[0].quads, runs[1].quads, rtol=1e-13, atol=1e-13)


def test_each_row_is_held_during_its_own_period(where):
    held = np.arange(12.0).reshape(6, 2)
    run = FixedStep(sums(), where).advance([0.0, 1.0], [0.0], held, [], 1.0, 4)
    exact = np.array([0, 1]) + np.vstack([[0, 0], np.cumsum(held, axis=0)])
    np.testing.assert_allclose(run.states, exact, rtol=1e-14)
    # ∫x over a period in which x moves along a line: the trapezium.
    np.testing.assert_allclose(run.quads[1:, 0], np.cumsum((exact[1:, 0] + exact[:-1, 0]) / 2), rtol=1e-14)


@pytest.mark.parametrize(("every", "rows"), [(1, [0, 1, 2, 3, 4, 5, 6]), (4, [0, 4]), (6, [0, 6]), (7, [0])])
def test_records_are_every_so_many_periods(where, every, rows):
    held, stepper = np.arange(12.0).reshape(6, 2), FixedStep(sums(), where)
    full = stepper.advance([0, 1], [0], held, [], 1.0)
    thin = stepper.advance([0, 1], [0], held, [], 1.0, record_every=every)
    assert thin.completed == 6
    np.testing.assert_array_equal(thin.states, full.states[rows])
    np.testing.assert_array_equal(thin.quads, full.quads[rows])


def test_no_periods_give_the_start(where):
    run = FixedStep(sums(), where).advance([3, 1], [2], np.empty((0, 2)), [], 1.0)
    assert (run.states.tolist(), run.quads.tolist(), run.completed) == ([[3, 1]], [[2]], 0)


def test_a_diverging_state_is_reported_with_its_period(where):
    # x = 1/(1 - t) leaves the finite numbers soon after t = 1, in period 10 or just after.
    run = FixedStep(runaway(), where).advance([1.0], [], np.zeros((30, 1)), [], PERIOD, 20)
    assert 10 <= run.completed <= 11
    assert np.isfinite(run.states[: run.completed + 1]).all()
    assert np.isnan(run.states[run.completed + 1 :]).all()
    assert run.states[5, 0] == pytest.approx(2.0, rel=1e-6)
    assert run.quads.shape == (31, 0)


def test_an_input_that_is_no_number_stops_in_its_period(where):
    held = np.ones((6, 2))
    held[3, 0] = np.nan
    run = FixedStep(sums(), where).advance([0, 0], [0], held, [], 1.0, 2, record_every=2)
    assert run.completed == 3
    np.testing.assert_allclose(run.states, [[0, 0], [2, 2], [np.nan] * 2, [np.nan] * 2], rtol=1e-14)
    assert np.isnan(run.quads[2:]).all()


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"x0": [0.0]}, SizeError, r"x0; got \(1,\); needs shape \(2,\)"),
        ({"quad0": [0, 0]}, SizeError, r"quad0; got \(2,\); needs shape \(1,\)"),
        ({"p": [1.0]}, SizeError, r"p; got \(1,\); needs shape \(0,\)"),
        ({"held": np.ones(2)}, SizeError, r"held inputs; got \(2,\); needs shape \(periods, 2\)"),
        ({"held": np.ones((2, 3))}, SizeError, r"held inputs; got \(2, 3\)"),
        ({"period": 0.0}, ValueRangeError, "period; got 0.0; needs a positive time in s"),
        ({"period": np.inf}, ValueRangeError, "period; got inf"),
        ({"substeps": 0}, ValueRangeError, "substeps; got 0; needs a whole number, at least 1"),
        ({"record_every": 1.5}, ValueRangeError, "record_every; got 1.5"),
    ],
)
def test_wrong_arguments_are_named(where, change, error, message):
    right = {"x0": [0, 0], "quad0": [0], "held": np.ones((2, 2)), "p": [], "period": 1.0}
    with pytest.raises(error, match=message):
        FixedStep(sums(), where).advance(**{**right, **change})


def test_a_right_hand_side_of_another_form_is_refused():
    x, u, p = (cs.SX.sym(name, 2) for name in "xup")
    for f in (
        cs.Function("f", [x], [x]),
        cs.Function("f", [x, u, p], [x[0], x]),
        cs.Function("f", [x, cs.SX.sym("U", 2, 2), p], [x, x]),
    ):
        with pytest.raises(SizeError, match="right-hand side"):
            FixedStep(f)


def test_a_library_without_the_driver_is_refused(library, monkeypatch, tmp_path):
    monkeypatch.setenv("PASSIFLEX_CACHE", str(tmp_path))
    with pytest.raises(CompilerError, match="no routine 'passiflex_rk4'; needs the driver"):
        FixedStep(sums(), compile_functions([sums()]))


def test_the_fastest_pole_of_known_systems(where):
    rhs = NativeFunction(pendulum(), where)
    # At rest: λ² + d λ + g = 0, complex, |λ| = √g. Central differences: about ε^(2/3) = 4e-11.
    assert fastest_pole(rhs, [0, 0], [0], [9.0, 0.3]) == pytest.approx(3.0, rel=1e-9)
    # Overdamped: the faster of the two real roots.
    assert fastest_pole(rhs, [0, 0], [0], [9.0, 10.0]) == pytest.approx(9.0, rel=1e-9)
    with pytest.raises(ValueRangeError, match="slope around this state is not finite"):
        fastest_pole(rhs, [np.nan, 0], [0], [9.0, 0.3])


def test_the_step_is_stable_and_no_shorter_than_needed(where):
    pole, period = 9.0, 2.0
    stepper, start = FixedStep(pendulum(), where), [1e-3, 0.0]
    held = np.zeros((200, 1))
    edge = stable_step(pole, period, safety=1.0)
    assert edge == int(np.ceil(18 / 2.78))
    assert np.abs(stepper.advance(start, [0, 0], held, [9, 10], period, edge).states[-1]).max() < 1e-6
    wild = stepper.advance(start, [0, 0], held, [9, 10], period, edge - 1)
    assert wild.completed < 200 or np.abs(wild.states[-1]).max() > 1e-3
    assert stable_step(pole, period) == int(np.ceil(18 / 1.39))
    assert stable_step(0.0, period) == 1


@pytest.mark.parametrize(
    "arguments", [(-1.0, 1.0, 0.5), (np.nan, 1.0, 0.5), (1.0, 0.0, 0.5), (1.0, 1.0, 0.0), (np.inf, 1.0, 0.5)]
)
def test_a_step_needs_numbers(arguments):
    with pytest.raises(ValueRangeError, match="needs a positive number"):
        stable_step(*arguments)
