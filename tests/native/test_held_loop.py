"""A loop under held commands: closed forms for every delay, the order of the plant, and books that close."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from native.carts import (
    FIRST_COMMAND,
    GAINS,
    MASS,
    PERIOD,
    START,
    Scheduled,
    cart,
    pendulum,
    regulator,
    run,
    runaway,
    told,
)
from passiflex.native import HELD_LOOP_DRIVER, HeldLoop, compile_functions, find_compiler
from passiflex.native.python_loop import LONGEST_LINE, TOGETHER

ROUND = 1e-12
"""A hundred periods of sums of ten terms, of numbers up to 10; the loop is stable, errors do not grow."""


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    if find_compiler() is None:
        pytest.skip("no compiler")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PASSIFLEX_CACHE", str(tmp_path_factory.mktemp("cache")))
        return compile_functions([cart(), pendulum(), runaway(), regulator()], driver=HELD_LOOP_DRIVER)


@pytest.fixture(params=["compiled", "machine"])
def where(request):
    return request.getfixturevalue("library") if request.param == "compiled" else None


def waiting(state):
    """Return the command in force and those on their way, without what the line no longer needs."""
    return state.line[: 3 + 3 * int(state.line[0])]


def closed_form(t):
    """Return the states of the cart at the samples, and what is in force, in one sweep over the instants of arrival."""
    x, c, held, arrivals = START.copy(), 0, FIRST_COMMAND, [(-1.0, FIRST_COMMAND)]
    out = []
    for k, (row, (delay, runs)) in enumerate(zip(*t, strict=True)):
        now = k * PERIOD
        if runs:
            command = GAINS[0] * (row[2:] - x[:2]) - GAINS[1] * x[2:] + GAINS[2] * c
            arrivals.append((max(now + delay, arrivals[-1][0]), command))
            c += 1
        soon = TOGETHER * PERIOD
        held = [command for at, command in arrivals if at <= now + soon][-1]
        out.append(np.concatenate([x, [c], held]))
        inside = sorted({at for at, _ in arrivals if now + soon < at < now + PERIOD - soon})
        for begin, end in pairwise([now, *inside, now + PERIOD]):
            held = [command for at, command in arrivals if at <= begin + soon][-1]
            a, h = (held + row[:2]) / MASS, end - begin
            x = np.concatenate([x[:2] + h * x[2:] + h**2 / 2 * a, x[2:] + h * a])
    return np.array(out)


DELAYS = {
    "none": 0.0,
    "part": 0.35,
    "one": 1.0,
    "one and a bit": 1.000001,
    "nearly one": 1 - 1e-7,
    "several": 7.0,
    "several and a part": 2.6,
    "most": LONGEST_LINE - 2.1,
    "random": np.array(4.5),
}


@pytest.mark.parametrize("missed", [0.0, 0.3])
@pytest.mark.parametrize("delay", DELAYS)
def test_every_command_acts_from_its_arrival_to_the_next_one(where, delay, missed):
    """Arrivals are in order: a command that overtakes another waits for it, and replaces it at once."""
    t = told(100, DELAYS[delay], missed)
    done = run(HeldLoop(cart(), regulator(), where), t)
    assert done.completed == 100
    ours = np.hstack([done.x, done.controller[:, :1], done.command])
    np.testing.assert_allclose(ours, closed_form(t), rtol=0, atol=ROUND * 10)


def test_a_delay_that_grows_by_rounding_is_still_a_whole_number_of_periods(where):
    """3 · 0.1 s is 0.30000000000000004 s, and 0.1 s is taken from it three times."""
    done = run(HeldLoop(cart(), regulator(), where), told(12, 3.0))
    np.testing.assert_array_equal(done.command[:3], np.tile(FIRST_COMMAND, (3, 1)))
    np.testing.assert_array_equal(done.command[3:], done.signals[:-3, 2:])


def test_a_missed_period_changes_nothing_but_the_plant(where):
    t = told(40, 0.0, 0.5)
    done = run(HeldLoop(cart(), regulator(), where), t)
    missed = np.flatnonzero(t.timing[1:, 1] == 0) + 1
    assert missed.size > 10
    for what in (done.controller, done.command, done.signals):
        np.testing.assert_array_equal(what[missed], what[missed - 1])
    assert (done.x[missed] != done.x[missed - 1]).all()
    assert done.state.controller[0] == t.timing[:, 1].sum()


def test_before_the_law_has_run_it_has_said_nothing(where):
    t = told(5, 0.0)
    t.timing[:2, 1] = 0
    done = run(HeldLoop(cart(), regulator(), where), t)
    assert np.isnan(done.signals[:2]).all()
    assert np.isfinite(done.signals[2:]).all()
    np.testing.assert_array_equal(done.controller[:2], np.zeros((2, 3)))


def test_native_equals_machine(library):
    t = told(60, np.array(3.3), 0.2)
    ours, theirs = (run(HeldLoop(pendulum(), regulator(), at), t, 0.03) for at in (library, None))
    assert ours.completed == theirs.completed == 60
    for name in ("x", "quads", "controller", "command", "signals"):
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(waiting(ours.state), waiting(theirs.state), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(ours.state.x, theirs.state.x, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("chunks", [[1, 39], [7, 11, 22], [10, 10, 10, 10], [0, 40], [1] * 40])
def test_calls_in_a_row_are_one_call(where, chunks):
    """State goes in and comes out: to the last bit, with commands on their way and periods missed."""
    t, loop = told(40, np.array(3.3), 0.2), HeldLoop(pendulum(), regulator(), where)
    whole, parts, state = run(loop, t, 0.03, last=True), [], None
    for i, (first, count) in enumerate(zip(np.cumsum([0, *chunks[:-1]]), chunks, strict=True)):
        chunk = Scheduled(*(part[first : first + count] for part in t))
        parts.append(run(loop, chunk, 0.03, state, last=i == len(chunks) - 1))
        state = parts[-1].state
    for name in ("x", "quads", "controller", "command", "signals"):
        joined = np.vstack([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name))
    for ours, theirs in zip(state, whole.state, strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_the_state_that_went_in_is_not_touched(where):
    loop = HeldLoop(pendulum(), regulator(), where)
    state = run(loop, told(10, 1.5)).state
    before = [part.copy() for part in state]
    first, second = (run(loop, told(10, 1.5), state=state) for _ in range(2))
    for ours, kept in zip(state, before, strict=True):
        np.testing.assert_array_equal(ours, kept)
    np.testing.assert_array_equal(first.x, second.x)


def test_the_last_row_is_a_sample_without_a_period(where):
    """It runs the law and records; nothing moves after it."""
    t, loop = told(9, 0.0), HeldLoop(pendulum(), regulator(), where)
    done, longer = run(loop, t, last=True), run(loop, t)
    for name in ("x", "quads", "controller", "command", "signals"):
        np.testing.assert_array_equal(getattr(done, name), getattr(longer, name))
    np.testing.assert_array_equal(done.state.x, done.x[-1])
    np.testing.assert_array_equal(done.state.quads, done.quads[-1])
    assert (longer.state.x != done.state.x).all()
    assert done.state.controller[0] == done.completed == 9


@pytest.mark.parametrize("every", [1, 2, 5, 12, 13, 100])
def test_records_are_every_so_many_samples(where, every):
    t, loop = told(13, 1.7), HeldLoop(pendulum(), regulator(), where)
    full, thin = run(loop, t), run(loop, t, record_every=every)
    for name in ("x", "quads", "controller", "command", "signals"):
        np.testing.assert_array_equal(getattr(thin, name), getattr(full, name)[::every])
    np.testing.assert_array_equal(thin.state.x, full.state.x)
    assert thin.completed == 13


@pytest.mark.parametrize("delay", [0.0, 0.25, 2.75])
def test_the_plant_is_integrated_to_order_four_in_the_longest_step(where, delay):
    """State and quadratures, with commands that arrive between the samples; the law is off, the pushes are given."""
    t, loop = told(5, delay), HeldLoop(pendulum(), regulator(), where)
    gains = np.array([0.0, 0.0, 0.5])  # command 0.5 k, whatever the state

    def slope(_, y, u, push):
        return [*y[2:4], *((u + push) / MASS - 9 * np.sin(y[:2])), u @ y[2:4], push @ y[2:4], 1.0]

    y, reference = np.concatenate([START, np.zeros(3)]), []
    for k, row in enumerate(t.rows):
        reference.append(y)
        split = (delay - int(delay)) * PERIOD
        for begin, end, back in ((0.0, split, int(delay) + 1), (split, PERIOD, int(delay))):
            u = np.full(2, 0.5 * (k - back)) if k >= back else FIRST_COMMAND
            if end > begin:
                args = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14, "args": (u, row[:2])}
                y = solve_ivp(slope, (begin, end), y, **args).y[:, -1]
    errors = []
    for parts in (4, 8, 16, 32):
        done = run(loop, t, PERIOD / parts, gains=gains)
        errors.append(np.abs(np.hstack([done.x, done.quads]) - reference)[-1, :6])
    orders = np.log2(np.array(errors)[:-1] / np.array(errors)[1:])
    # Of errors h⁴ (1 + c h) with c h ≤ 0.15 at the finest step, log2 sees 0.1.
    assert np.median(orders[-1]) == pytest.approx(4, abs=0.1)
    assert errors[-1].max() < 1e-8


def test_steps_are_equal_and_none_is_longer_than_scheduled(where):
    loop, t = HeldLoop(pendulum(), regulator(), where), told(6, 0.5)

    def end(longest):
        return run(loop, t, longest).state.x

    half = PERIOD / 2  # the command arrives in the middle
    np.testing.assert_array_equal(end(half), end(10 * PERIOD))
    np.testing.assert_array_equal(end(half * (1 - 1e-14)), end(half))  # rounding makes no further step
    np.testing.assert_array_equal(end(half * 0.99), end(half * 0.5))
    np.testing.assert_array_equal(end(half * 0.34), end(half / 3))
    assert (end(half) != end(half / 2)).all()


def test_the_books_of_the_cart_close(where):
    """½ m v² = ∫ commandᵀv + ∫ pushᵀv, both integrands linear in time: to rounding, whatever the delays."""
    done = run(HeldLoop(cart(), regulator(), where), told(100, np.array(2.5), 0.2))
    kinetic = MASS * (done.x[:, 2:] ** 2).sum(axis=1) / 2
    np.testing.assert_allclose(kinetic - kinetic[0], done.quads[:, :2].sum(axis=1), atol=ROUND * 10)
    np.testing.assert_allclose(done.quads[:, 2], PERIOD * np.arange(100), atol=ROUND)


def test_a_state_that_leaves_the_finite_numbers_is_reported_with_its_sample(where):
    """x₀ = 1/(1 − t) is gone soon after t = 1 s, in period 10 or just after."""
    loop, t = HeldLoop(runaway(), regulator(), where), told(30, 0.0)
    t.rows[:] = 0
    begin = loop.start([1, 0, 0, 0], np.zeros(3), np.zeros(2))
    done = run(loop, t, PERIOD / 20, begin, np.zeros(3))
    assert 10 <= done.completed <= 11
    assert np.isfinite(done.x[: done.completed + 1]).all()
    assert np.isnan(done.x[done.completed + 1 :]).all()
    assert np.isnan(done.signals[done.completed + 1 :]).all()
    assert done.x[5, 0] == pytest.approx(2.0, rel=1e-5)
    assert done.quads.shape == (30, 0)


@pytest.mark.parametrize(("delay", "after"), [(0.0, 0), (1.4, 1), (3.0, 3)])
def test_a_command_that_is_no_number_stops_the_loop_when_it_acts(where, delay, after):
    t = told(12, delay)
    t.rows[4, 2] = np.nan
    done = run(HeldLoop(cart(), regulator(), where), t, record_every=2)
    assert done.completed == 4 + after
    recorded = np.arange(0, 12, 2) <= done.completed
    np.testing.assert_array_equal(np.isfinite(done.x).all(axis=1), recorded)


def test_no_rows_leave_all_as_it_was(where):
    loop = HeldLoop(cart(), regulator(), where)
    state = run(loop, told(3, 1.5)).state
    done = run(loop, told(0, 0.0), state=state)
    assert (done.x.shape, done.completed) == ((0, 4), 0)
    for ours, kept in zip(done.state, state, strict=True):
        np.testing.assert_array_equal(ours, kept)
