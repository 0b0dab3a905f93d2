"""Compiled code against the symbolic law, in place, copied, and over many points."""

from concurrent.futures import ThreadPoolExecutor

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from passiflex.errors import SimulationError, SizeError, ValueRangeError
from passiflex.native import NativeFunction, compile_functions, find_compiler


def law():
    """Return a small law with scalars, vectors, matrices, an unused and an empty input."""
    x, A, s, empty = cs.SX.sym("x", 3), cs.SX.sym("A", 3, 2), cs.SX.sym("s"), cs.SX.sym("empty", 0)
    y = cs.sin(x) * s + A @ cs.vertcat(s, x[0] ** 2)
    M = x @ x.T / (1 + cs.sumsqr(x)) + cs.diag(cs.exp(-(x**2)))
    return cs.Function(
        "law",
        [x, A, s, empty],
        [y, cs.densify(M[:2, :]), cs.tanh(s)],
        ["x", "A", "s", "empty"],
        ["y", "M", "t"],
    )


@pytest.fixture(scope="module", params=["compiled", "machine"])
def native(request, tmp_path_factory):
    if request.param == "compiled" and find_compiler() is None:
        pytest.skip("no compiler")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PASSIFLEX_CACHE", str(tmp_path_factory.mktemp("cache")))
        library = None
        if request.param == "compiled":
            library = compile_functions([law()])
        return NativeFunction(law(), library)


numbers = st.floats(-10, 10)
points = st.tuples(arrays(float, 3, elements=numbers), arrays(float, (3, 2), elements=numbers), numbers)


@given(point=points)
@settings(deadline=None)
def test_code_equals_law(native, point):
    # A handful of operations on numbers up to 1e3: rounding stays below 1e-13 of the largest term.
    for got, exact in zip(native(*point, []), law()(*point, []), strict=True):
        exact = np.array(exact)
        np.testing.assert_allclose(got.reshape(exact.shape), exact, rtol=1e-13, atol=1e-13 * 1e3)


@given(rows=st.lists(points, min_size=1, max_size=5))
@settings(deadline=None)
def test_map_equals_calls(native, rows):
    x, A, s = np.array([r[0] for r in rows]), rows[0][1], np.array([[r[2]] for r in rows])
    y, M, t = native.map(x, A.ravel(order="F"), s, [])
    for k in range(len(rows)):
        y_k, M_k, t_k = native(x[k], A, s[k], [])
        np.testing.assert_array_equal(y[k], y_k)
        np.testing.assert_array_equal(M[k], M_k.ravel(order="F"))
        np.testing.assert_array_equal(t[k], t_k)


def test_call_works_in_place(native):
    x, _, s, _ = native.inputs
    y, M, t = native.outputs
    x[:], s[:] = [1.0, 2.0, 3.0], 0.5
    native.inputs[1][:] = [[1, 2], [3, 4], [5, 6]]
    native.call()
    np.testing.assert_allclose(y, np.sin(x) * 0.5 + [2.5, 5.5, 8.5], rtol=1e-14)
    assert M.shape == (2, 3)
    assert t[0] == pytest.approx(np.tanh(0.5), rel=1e-15)


def test_results_of_calls_are_copies(native):
    point = (np.ones(3), np.ones((3, 2)), 1.0, [])
    first = native(*point)
    kept = [a.copy() for a in first]
    native(-point[0], *point[1:])
    for a, b in zip(first, kept, strict=True):
        np.testing.assert_array_equal(a, b)


def test_it_tells_its_names(native):
    assert (native.n_in, native.n_out) == (4, 3)
    assert native.names_in == ("x", "A", "s", "empty")
    assert native.names_out == ("y", "M", "t")
    assert repr(native).startswith("<law(x, A, s, empty) -> (y, M, t), ")


def test_map_without_rows_is_one_point(native):
    assert [r.shape for r in native.map(np.ones(3), np.ones(6), [1.0], [])] == [(1, 3), (1, 6), (1, 1)]
    assert [r.shape for r in native.map(np.ones((0, 3)), np.ones(6), [1.0], [])] == [(0, 3), (0, 6), (0, 1)]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.ones(3), np.ones((3, 2)), 1.0), r"arguments of function 'law'; got 3; needs 4: x, A, s, empty"),
        ((np.ones(4), np.ones((3, 2)), 1.0, []), r"argument 'x' of 'law'; got \(4,\); needs shape \(3,\)"),
        ((1.0, np.ones((3, 2)), 1.0, []), r"argument 'x' of 'law'; got \(\)"),
        ((np.ones(3), np.ones((2, 3)), 1.0, []), r"argument 'A' of 'law'; got \(2, 3\); needs"),
    ],
)
def test_a_wrong_argument_is_named(native, arguments, message):
    with pytest.raises(SizeError, match=message):
        native(*arguments)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ((np.ones((2, 3)), np.ones(6), [1.0]), "got 3; needs 4"),
        ((np.ones((2, 3)), np.ones((3, 6)), [1.0], []), r"argument 'A' of 'law'; got \(3, 6\); needs"),
        ((np.ones((2, 4)), np.ones(6), [1.0], []), r"argument 'x' of 'law'; got \(2, 4\)"),
    ],
)
def test_a_wrong_column_is_named(native, columns, message):
    with pytest.raises(SizeError, match=message):
        native.map(*columns)


def test_sparse_outputs_are_refused():
    x = cs.SX.sym("x", 2)
    with pytest.raises(ValueRangeError, match=r"'M' of function 'f' is sparse; .*densify"):
        NativeFunction(cs.Function("f", [x], [cs.diag(x)], ["x"], ["M"]))


@pytest.mark.parametrize("compiled", [True, False])
def test_a_function_that_refuses_is_an_error(compiled, monkeypatch, tmp_path):
    if compiled and find_compiler() is None:
        pytest.skip("no compiler")
    monkeypatch.setenv("PASSIFLEX_CACHE", str(tmp_path))
    x = cs.MX.sym("x")
    f = cs.Function("positive", [x], [cs.sqrt(x.attachAssert(x > 0, "x must be positive"))])
    native = NativeFunction(f, compile_functions([f]) if compiled else None)
    assert native.map([[4.0], [9.0]]).tolist() == [[2.0], [3.0]]
    with pytest.raises(SimulationError, match="'positive' could not be evaluated"):
        native([-1.0])
    with pytest.raises(SimulationError, match="'positive' could not be evaluated"):
        native.map([[4.0], [-1.0]])
    assert native([16.0]) == 4.0


def test_numbers_that_are_not_finite_pass_through():
    x = cs.SX.sym("x")
    assert np.isnan(NativeFunction(cs.Function("root", [x], [cs.sqrt(x)]))([-1.0])[0])


def test_threads_may_share_a_map(native):
    if not native.compiled:
        pytest.skip("the virtual machine's map uses the arrays of the object")
    x = np.random.default_rng(0).normal(size=(2000, 3))
    rest = (np.ones(6), [1.0], [])
    alone = native.map(x, *rest)[1]
    with ThreadPoolExecutor(2) as pool:
        for result in pool.map(lambda _: native.map(x, *rest)[1], range(8)):
            np.testing.assert_array_equal(result, alone)
