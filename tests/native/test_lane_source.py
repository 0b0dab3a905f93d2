"""Functions in lanes: each operation as CasADi has it, with NaN, infinities and zeros; sin, cos, exp, tanh to 3 ulp."""

from __future__ import annotations

from typing import Any

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from native.lane_calls import LaneCalls, units
from passiflex.errors import ValueRangeError
from passiflex.native import find_compiler
from passiflex.native.lane_source import _BETWEEN, _CALLED, _NAMES, _WRITTEN, lane_source

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no compiler")

x, y = cs.SX.sym("x"), cs.SX.sym("y")
EXACT = {
    "assign": x, "neg": -x, "sq": x**2, "twice": 2 * x, "inv": 1 / x, "add": x + y, "sub": x - y, "mul": x * y,
    "div": x / y, "lt": x < y, "le": x <= y, "eq": x == y, "ne": x != y, "not": cs.logic_not(x),
    "and": cs.logic_and(x, y), "or": cs.logic_or(x, y), "if_else_zero": cs.if_else(x, y, 0),
    "fabs": cs.fabs(x), "sign": cs.sign(x), "fmin": cs.fmin(x, y), "fmax": cs.fmax(x, y), "sqrt": cs.sqrt(x),
    "floor": cs.floor(x), "ceil": cs.ceil(x), "fmod": cs.fmod(x, y), "copysign": cs.copysign(x, y),
}  # fmt: skip
"""What IEEE 754 leaves no choice about."""
ROUNDED = {
    "sin": cs.sin(x), "cos": cs.cos(x), "tan": cs.tan(x), "asin": cs.asin(x), "acos": cs.acos(x),
    "atan": cs.atan(x), "exp": cs.exp(x), "log": cs.log(x), "sinh": cs.sinh(x), "cosh": cs.cosh(x),
    "tanh": cs.tanh(x), "erf": cs.erf(x), "atan2": cs.atan2(x, y), "pow": x**y, "constpow": x**2.7,
    "hypot": cs.hypot(x, y),
}  # fmt: skip
SPECIAL = np.array([
    0.0, -0.0, 1.0, -1.0, 0.5, 2.5, -3.7, 20.0, -25.0, 700.0, 701.0, -745.0, 710.0, 1e5, 100000.1, -1e15,
    5e-324, -1e-310, 2.2250738585072014e-308, 1e300, -1e300, 1.7976931348623157e308, np.inf, -np.inf, np.nan,
])  # fmt: skip


def both(name: str, expression: Any) -> cs.Function:
    return cs.Function(f"op_{name}", [cs.vertcat(x, y)], [cs.SX(expression)])


@pytest.fixture(scope="module", params=[None, 1, 4, 8])
def calls(request):
    """Return every operation in lanes: as many as the processor has, and three fixed numbers of them."""
    functions = [both(name, e) for name, e in (EXACT | ROUNDED).items()]
    made = LaneCalls([*functions, divided(), remembered()], request.param)
    assert made.width == (request.param or made.width)
    return made


def divided() -> cs.Function:
    """Return quotients by the same, by another that overwrites it, and by one that is only used once."""
    v = cs.SX.sym("v", 5)
    a, b, c, d, e = cs.vertsplit(v)
    return cs.Function(
        "divided", [v], [cs.vertcat(a / d, b / d, 1 / d, a / (d + e), c / (d + e), b / c)], {"cse": True}
    )


CONSTANTS = [0.1, -1 / 3, 5e-324, 1.7976931348623157e308, 0.0, np.pi, np.inf, -np.inf, np.nan]


def remembered() -> cs.Function:
    v = cs.SX.sym("v", 1)
    return cs.Function("remembered", [v], [cs.vertcat(*map(cs.SX, CONSTANTS), cs.SX(2e-5), v)])


def arguments() -> np.ndarray:
    """Return all pairs of what is special, then what is not."""
    rng = np.random.default_rng(2)
    pairs = np.stack(np.meshgrid(SPECIAL, SPECIAL), axis=-1).reshape(-1, 2)
    return np.concatenate([pairs, rng.normal(0, 3, (300, 2)), rng.uniform(-1, 1, (100, 2))])


def test_every_operation_that_lanes_know_is_tested() -> None:
    """`assign` CasADi leaves out of single expressions."""
    assert set(EXACT) | set(ROUNDED) == _CALLED | set(_WRITTEN) | set(_BETWEEN)
    for name, expression in (EXACT | ROUNDED).items():
        f = both(name, expression)
        assert name in {"assign", *(_NAMES[f.instruction_id(k)] for k in range(f.n_instructions()))}


@pytest.mark.parametrize("name", EXACT)
def test_an_exact_operation_is_casadis(calls, name) -> None:
    """Comparisons with NaN are false but for ≠, fmin and fmax take the number, 0/0 is none; zeros keep their sign."""
    at = arguments()
    ours, theirs = calls(f"op_{name}", at), calls.casadi(f"op_{name}", at)
    np.testing.assert_array_equal(ours, theirs)
    if name not in ("fmin", "fmax"):  # of 0 and −0, C lets them take either
        numbers = ~np.isnan(theirs)
        np.testing.assert_array_equal(np.signbit(ours)[numbers], np.signbit(theirs)[numbers])


@pytest.mark.parametrize("name", ROUNDED)
def test_a_rounded_operation_is_casadis(calls, name) -> None:
    """To the 3 units of `lanes.h` and one of the C library; what is special is exactly that, signs of zeros too."""
    at = arguments()
    ours, theirs = calls(f"op_{name}", at), calls.casadi(f"op_{name}", at)
    assert units(ours, theirs).max() <= 4
    zeros = theirs == 0
    np.testing.assert_array_equal(np.signbit(ours[zeros]), np.signbit(theirs[zeros]))


def near(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the points, their neighbours, and what is close by."""
    scatter = points[:, None] + rng.normal(0, 1, (len(points), 8)) * 10.0 ** rng.uniform(-16, -3, (1, 8))
    return np.concatenate(
        [points, np.nextafter(points, np.inf), np.nextafter(points, -np.inf), scatter.ravel()]
    )


def test_sines_are_right_to_three_units_everywhere(calls) -> None:
    """Where k π/2 cancels all but the last bits, up to where the C library takes over, and beyond."""
    rng = np.random.default_rng(3)
    zeros = np.arange(-63663, 63664, 41) * (np.pi / 2)
    easy = np.concatenate([rng.uniform(-10, 10, 20000), rng.uniform(-1e5, 1e5, 20000), near(zeros, rng)])
    tiny = 10.0 ** rng.uniform(-308, 0, 2000)
    far = rng.choice([-1, 1], 2000) * 10.0 ** rng.uniform(5, 300, 2000)
    at = np.concatenate([easy, tiny, -tiny, far])[:, None]
    for name, oracle in (("sin", np.sin), ("cos", np.cos)):
        ours = calls(f"op_{name}", np.hstack([at, at]))
        assert units(ours, oracle(at.astype(np.longdouble))).max() <= 3
        assert np.abs(ours).max() <= 1


def test_exponentials_are_right_to_three_units_everywhere(calls) -> None:
    rng = np.random.default_rng(4)
    halves = (np.arange(-1010, 1011) + 0.5) * np.log(2)
    tiny = 10.0 ** rng.uniform(-308, 0, 3000)
    wide = [rng.uniform(-2, 2, 20000), rng.uniform(-750, 712, 20000), near(halves, rng), tiny, -tiny]
    at = np.concatenate([*wide, rng.choice([-1, 1], 500) * 10.0 ** rng.uniform(3, 300, 500)])[:, None]
    with np.errstate(over="ignore", under="ignore"):
        for name, oracle in (("exp", np.exp), ("tanh", np.tanh)):
            exact = oracle(at.astype(np.longdouble))
            exact = np.where(np.abs(exact) > 1.7976931348623157e308, np.inf, exact)
            ours = calls(f"op_{name}", np.hstack([at, at]))
            assert units(ours, exact).max() <= 3
    assert np.abs(ours).max() == 1


@pytest.mark.parametrize("name", ["sin", "tanh"])
def test_odd_functions_are_odd_to_the_last_bit(calls, name) -> None:
    at = np.concatenate([np.linspace(0, 30, 999), [0.0, 1e-320, 1e4, 1e5, 1e6, np.inf]])[:, None].repeat(2, 1)
    ours, mirrored = calls(f"op_{name}", at), calls(f"op_{name}", -at)
    np.testing.assert_array_equal(mirrored, -ours)
    assert np.signbit(mirrored[0]) != np.signbit(ours[0])


def test_lanes_do_not_look_at_their_neighbours(calls) -> None:
    """A number that is rare, beside it, sends all lanes to the C library; those that need not go do not."""
    alone, beside = np.full((64, 2), 0.7), np.full((64, 2), 0.7)
    beside[1::2] = np.resize(SPECIAL, 32)[:, None]
    for name in EXACT | ROUNDED:
        ours = calls(f"op_{name}", beside)[::2]
        np.testing.assert_array_equal(ours, calls(f"op_{name}", alone)[::2])


def test_quotients_by_the_same_share_one_division(calls) -> None:
    """1/d and the product are rounded once each: 1.5 units at most; a quotient that shares with none is exact."""
    rng = np.random.default_rng(5)
    at = rng.normal(0, 1, (500, 5)) * 10.0 ** rng.integers(-9, 9, (500, 5))
    ours, theirs = calls("divided", at), calls.casadi("divided", at)
    assert units(ours[:, :5], theirs[:, :5]).max() <= 2
    np.testing.assert_array_equal(ours[:, 2], 1 / at[:, 3])
    np.testing.assert_array_equal(ours[:, 5], at[:, 1] / at[:, 2])
    assert (ours[:, 0] != at[:, 0] / at[:, 3]).any()
    body = lane_source([divided()]).split("divided_in_lanes")[1]
    assert body.count("1.0 / ") == 2
    assert body.count(" / ") == 3


def test_constants_are_exact(calls) -> None:
    ours = calls("remembered", np.array([[0.25], [1.0]]))
    expected = np.array([*CONSTANTS, 2e-5])
    np.testing.assert_array_equal(ours[0, :-1], expected)
    assert ours[:, -1].tolist() == [0.25, 1.0]


def test_what_cannot_run_in_lanes_is_refused() -> None:
    matrix = cs.MX.sym("m", 2)
    with pytest.raises(ValueRangeError, match=r"function 'g' cannot run in lanes; got MXFunction; needs SX"):
        lane_source([cs.Function("g", [matrix], [matrix])])
    for expression, op in (
        (cs.log1p(x), "log1p"),
        (cs.remainder(x, y), "remainder"),
        (x * cs.SX.sym("z"), "parameter"),
    ):
        f = cs.Function("h", [x, y], [expression], {"allow_free": True})
        with pytest.raises(ValueRangeError, match=rf"function 'h' cannot run in lanes; got operation '{op}'"):
            lane_source([f])


# Whole functions

UNARY = {
    "sin": (np.sin, np.cos),
    "tanh": (np.tanh, lambda a: 1 / np.cosh(a) ** 2),
    "fabs": (np.abs, np.ones_like),
}
steps = st.tuples(
    st.sampled_from(["add", "sub", "mul", "div", "sin", "tanh", "fabs", "less", "fmin", "fmax"]),
    st.integers(0, 40),
    st.integers(0, 40),
)


@settings(max_examples=6, deadline=None, derandomize=True, database=None)
@given(st.lists(steps, min_size=20, max_size=40), st.integers(0, 2**31))
def test_a_whole_function_is_casadis(program, seed) -> None:
    """The same operations in another rounding: the bound goes through the graph along with the value."""
    v = cs.SX.sym("v", 4)
    at = np.random.default_rng(seed).uniform(-2, 2, (40, 4))
    nodes: list[tuple[Any, np.ndarray, np.ndarray]] = [(v[i], at[:, i], np.zeros(40)) for i in range(4)]
    for op, i, j in program:
        nodes.append(_next(op, *(nodes[k % len(nodes)] for k in (i, j)), v, at, i))
    last = nodes[-12:]
    f = cs.Function("whole", [v], [cs.vertcat(*(node[0] for node in last))], {"cse": True})
    calls = LaneCalls([f])
    ours, theirs = calls("whole", at), calls.casadi("whole", at)
    assert (np.abs(ours - theirs) <= 2 * np.stack([node[2] for node in last], axis=1)).all()


def _next(op: str, a: Any, b: Any, v: cs.SX, at: np.ndarray, i: int) -> tuple[Any, np.ndarray, np.ndarray]:
    """Return a step of a program: its expression, its value, and by how much it may be wrong to first order."""
    (ea, va, da), (eb, vb, db) = a, b
    if op in UNARY:
        function, slope = UNARY[op]
        found = getattr(cs, op)(ea), function(va), np.abs(slope(va)) * da
    elif op in ("add", "sub"):
        sign = 1 if op == "add" else -1
        found = ea + sign * eb, va + sign * vb, da + db
    elif op == "mul":
        t = np.tanh(va)
        found = (
            cs.tanh(ea) * eb,
            t * vb,
            (1 - t**2) * da * np.abs(vb) + np.abs(t) * db + 4e-16 * np.abs(t * vb),
        )
    elif op == "div":
        d = 1 + va**2
        error = db / d + np.abs(vb) / d**2 * (2 * np.abs(va) * da + 4e-16 * d)
        found = eb / (1 + ea**2), vb / d, error
    elif op == "less":
        first, second = i % 4, (i // 4) % 4
        found = (
            cs.if_else(v[first] <= v[second], ea, eb),
            np.where(at[:, first] <= at[:, second], va, vb),
            np.maximum(da, db),
        )
    else:
        found = getattr(cs, op)(ea, eb), getattr(np, op)(va, vb), np.maximum(da, db)
    return found[0], found[1], found[2] + 8e-16 * np.abs(found[1]) + 1e-300
