"""The tank's flow at every level: its books, its floor, its cap, and no division by its state."""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace

import casadi as cs
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from passiflex.control import EnergyTank
from passiflex.control.tank import NO_CAP, jump_cost, smoothstep

FLOOR, LOW, CAP, BAND = 0.01, 0.05, 3.0, 0.2
LEVELS = st.floats(-1, 6)
POWERS = st.floats(0, 1e4)
SIGNED_POWERS = st.floats(-1e4, 1e4)
FILLS = st.floats(0, 1)


@lru_cache
def functions() -> cs.Function:
    """(T, P_D, P_X, gains) → rate, drawn, spilled, fill, β."""
    tank, (vector, g) = EnergyTank(), EnergyTank().layout.symbols("g")
    T, P_D, P_X = cs.SX.sym("T"), cs.SX.sym("P_D"), cs.SX.sym("P_X")
    return cs.Function("tank", [T, P_D, P_X, vector], [*tank.flow(T, P_D, P_X, g), tank.valve(T, g)])


def flow(T: float, P_D: float, P_X: float, **gains: float) -> SimpleNamespace:
    values = {"fill": 1.0, "floor": FLOOR, "low": LOW, "cap": CAP, "band": BAND, "signed": 0.0} | gains
    numbers = EnergyTank().layout.pack({f"tank_{k}": np.asarray(float(v)) for k, v in values.items()})
    names = ("rate", "drawn", "spilled", "fill", "valve")
    return SimpleNamespace(**dict(zip(names, map(float, functions()(T, P_D, P_X, numbers)), strict=True)))


@given(LEVELS, POWERS, SIGNED_POWERS, FILLS, st.booleans())
def test_the_books_close(T: float, P_D: float, P_X: float, alpha: float, signed: bool) -> None:
    """P_D = rate + drawn + spilled, to the round-off of the sum: nothing is counted twice or lost."""
    f = flow(T, P_D, P_X, fill=alpha, signed=signed)
    assert abs(f.rate + f.drawn + f.spilled - P_D) <= 4e-16 * (P_D + abs(P_X)) * 2
    assert 0 <= f.fill <= alpha
    assert 0 <= f.spilled <= P_D + max(-f.drawn, 0)
    assert f.drawn == (P_X if signed else abs(P_X))


@given(POWERS, SIGNED_POWERS, FILLS)
def test_between_floor_and_cap_it_is_23(P_D: float, P_X: float, alpha: float) -> None:
    """Ṫ = α P_D − |P_X|, exactly, without a cap or below its band; the paper's α is the whole story there."""
    for f in (flow(2.0, P_D, P_X, fill=alpha), flow(1e6, P_D, P_X, fill=alpha, cap=NO_CAP)):
        assert f.rate == alpha * P_D - abs(P_X)
        assert f.fill == alpha
        assert f.valve == 1


@given(POWERS, SIGNED_POWERS, st.sampled_from([0.0, -0.5, FLOOR]))
def test_an_empty_tank_has_finite_rates_and_a_shut_valve(P_D: float, P_X: float, T: float) -> None:
    """Nothing is divided by the level; (19) is singular there. What comes in still fills it."""
    f = flow(T, P_D, P_X)
    assert f.valve == 0
    assert f.rate == P_D - abs(P_X)
    assert np.isfinite(list(vars(f).values())).all()


def test_a_still_reference_never_drains_it() -> None:
    """With the valve shut the reference stands, P_X = 0, and Ṫ ≥ 0 at the floor."""
    assert flow(FLOOR, 0.0, 0.0).rate == 0
    assert flow(FLOOR, 0.3, 0.0).rate == 0.3


@given(st.floats(0, 1), st.floats(0, 1))
def test_valve_opens_between_floor_and_low(a: float, b: float) -> None:
    """β is 0 at the floor, ½ in the middle, 1 at `tank_low`, and rises in between."""
    below, above = sorted((FLOOR + a * (LOW - FLOOR), FLOOR + b * (LOW - FLOOR)))
    assert flow(below, 0, 0).valve <= flow(above, 0, 0).valve + 1e-15
    assert flow(FLOOR, 0, 0).valve == 0
    assert flow((FLOOR + LOW) / 2, 0, 0).valve == pytest.approx(0.5, abs=1e-14)
    assert flow(LOW, 0, 0).valve == pytest.approx(1, abs=1e-14)
    assert flow(5, 0, 0).valve == 1


@given(st.floats(0, 2), st.floats(0, 2), st.floats(1, 100), FILLS)
def test_inflow_fades_out_below_the_cap(a: float, b: float, P_D: float, alpha: float) -> None:
    """α falls over the band and is 0 from the cap on, where all of P_D is spilled: T cannot rise past the cap."""
    lower, higher = sorted((CAP - BAND + a * BAND, CAP - BAND + b * BAND))
    assert flow(lower, P_D, 0, fill=alpha).fill >= flow(higher, P_D, 0, fill=alpha).fill - 1e-14
    assert flow(CAP - BAND, P_D, 0, fill=alpha).fill == pytest.approx(alpha, abs=1e-14)
    assert flow(CAP - BAND / 2, P_D, 0, fill=alpha).fill == pytest.approx(alpha / 2, abs=1e-12)
    for level in (CAP, CAP + 1e-9, 5.9):
        full = flow(level, P_D, 0, fill=alpha)
        assert abs(full.rate) <= 1e-12 * P_D  # (cap − cap)/band + 1 is 1 up to round-off
        assert full.spilled == pytest.approx(P_D, rel=1e-12)


def test_a_full_tank_still_pays() -> None:
    f = flow(CAP + 1, 5.0, -2.0)
    assert (f.rate, f.drawn, f.spilled) == (-2.0, 2.0, 5.0)


@given(POWERS, SIGNED_POWERS)
def test_paper_and_signed_accounting_differ_by_what_the_reference_takes_out(P_D: float, P_X: float) -> None:
    """While P_X ≥ 0 they agree; while P_X < 0 the paper's tank loses 2|P_X| more."""
    paper, signed = flow(2.0, P_D, P_X), flow(2.0, P_D, P_X, signed=1)
    lost = signed.rate - paper.rate
    assert lost == pytest.approx(2 * max(-P_X, 0.0), rel=1e-12, abs=1e-11)
    assert lost >= 0


@given(st.floats(-10, 10))
def test_a_jump_costs_what_it_stores(stored: float) -> None:
    """The integral of |P_X| or P_X over the delta function of (21) (theory note 2.7)."""
    assert jump_cost(stored, signed=True) == stored
    assert jump_cost(stored, signed=False) == abs(stored)


def test_smoothstep_is_smooth() -> None:
    """Its slope is 0 at both ends and 3/2 in the middle."""
    x = cs.SX.sym("x")
    f = cs.Function("s", [x], [smoothstep(x), cs.gradient(smoothstep(x), x)])
    values = [[float(v) for v in f(at)] for at in (-0.1, 0.5, 1.1)]
    np.testing.assert_allclose(values, [[0, 0], [0.5, 1.5], [1, 0]], atol=1e-15)
    np.testing.assert_allclose([float(f(1e-6)[1]), float(f(1 - 1e-6)[1])], 0, atol=1e-5)


@given(POWERS, SIGNED_POWERS, FILLS)
def test_at_the_cap_nothing_flows_in_whatever_the_accounting(P_D: float, P_X: float, alpha: float) -> None:
    """Neither P_D nor what the signed accounting gets back from the reference lifts a full tank; both are spilled."""
    for signed in (False, True):
        assert flow(CAP, P_D, P_X, fill=alpha, signed=signed).rate <= 0
