"""What a watch is shown: every sample and every step, each once, with its own time; whatever records are kept."""

from __future__ import annotations

import casadi as cs
import numpy as np
import pytest

from native.carts import FIRST_COMMAND, PERIOD, START, cart, regulator, run, told
from native.lane_carts import ROBOTS, functions
from native.watches import LEAST, SIZE, step_watch, watch
from passiflex.errors import SizeError
from passiflex.native import (
    DRIVER,
    HELD_LOOP_DRIVER,
    Change,
    FixedStep,
    HeldLoop,
    LaneInputs,
    LaneLoop,
    Refinement,
    Watched,
    compile_functions,
    find_compiler,
)

P = np.array([0.0, 0.5])


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    if find_compiler() is None:
        pytest.skip("no compiler")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PASSIFLEX_CACHE", str(tmp_path_factory.mktemp("cache")))
        return compile_functions([cart(), regulator(), *watch()], driver=HELD_LOOP_DRIVER)


@pytest.fixture(params=["compiled", "machine"])
def loop(request):
    where = request.getfixturevalue("library") if request.param == "compiled" else None
    return HeldLoop(cart(), regulator(), where, watch())


def test_it_sees_what_is_recorded_and_the_step_to_the_next(loop):
    """One step in a period: the glances are at the next rows, the looks at the rows; all sums are those of the rows."""
    t = told(30, 0.0)
    done = run(loop, t, last=True, p_watch=P)
    w, rows = done.state.watched, np.hstack([done.command, done.controller, done.signals])
    times = np.arange(30) * PERIOD
    assert list(w[:2]) == [30, 29]
    assert w[2] == pytest.approx(times.sum() + times[1:].sum(), rel=1e-14)
    assert w[4] == pytest.approx(min(0.0, (done.x[:, 0] - LEAST).min()), rel=1e-14)
    assert w[5] == pytest.approx(0.5 * rows.sum(), rel=1e-12)
    assert w[6] == pytest.approx(0.5 * done.x[1:, 2].sum(), rel=1e-12)


@pytest.mark.parametrize("delay", [0.0, 0.35, 1.0, 2.6])
def test_it_is_told_the_time(loop, delay):
    """∫ 1 dt of the plant is the time, in the middle of a period as well; and so many steps there are."""
    done = run(loop, told(40, delay), longest=0.03, p_watch=P)
    parts = [PERIOD] if delay in (0.0, 1.0) else [0.35 * PERIOD, 0.65 * PERIOD]
    if delay == 2.6:
        parts = [0.6 * PERIOD, 0.4 * PERIOD]
    steps = sum(int(np.ceil(part / 0.03 - 1e-9)) for part in parts)
    before = 2 if delay == 2.6 else 0  # periods in which nothing arrives
    whole = int(np.ceil(PERIOD / 0.03 - 1e-9))
    assert done.state.watched[0] == 40
    assert done.state.watched[1] == before * whole + (40 - before) * steps
    assert done.state.watched[3] < 1e-12


@pytest.mark.parametrize("every", [1, 7])
def test_pieces_and_records_change_nothing(loop, every):
    t = told(42, 1.4, 0.2)
    whole = run(loop, t, longest=0.04, p_watch=P).state.watched
    state = loop.start(START, np.zeros(3), FIRST_COMMAND)
    for first in range(0, 42, 14):
        chunk = type(t)(t.rows[first : first + 14], t.timing[first : first + 14])
        state = run(loop, chunk, 0.04, state, record_every=every, first=first, p_watch=P).state
    np.testing.assert_allclose(state.watched, whole, rtol=1e-14, atol=1e-14)


def test_nobody_looks_unless_the_watch_is_told_its_numbers(loop):
    done = run(loop, told(5, 0.0))
    np.testing.assert_array_equal(done.state.watched, np.zeros(SIZE))
    with pytest.raises(SizeError, match=r"p_watch; got \(3,\); needs shape \(2,\)"):
        run(loop, told(5, 0.0), p_watch=np.zeros(3))


@pytest.mark.skipif(find_compiler() is None, reason="no compiler")
@pytest.mark.parametrize("width", [1, 4, 8])
def test_each_lane_is_seen_as_it_is_alone(width, library):
    """Other delays, steps and missed periods beside it; the second chunk goes on where the first ended."""
    lanes = LaneLoop(functions(cart())._replace(watch=watch()), width)
    held, robots = HeldLoop(cart(), regulator(), library, watch()), ROBOTS[:width]
    state = lanes.start([held.start(r.begin, np.zeros(3), FIRST_COMMAND) for r in robots])
    drawn, timing = (np.stack(part, axis=-1) for part in zip(*(r.chance(40) for r in robots), strict=True))
    changes = [Change(k, lane, numbers) for lane, r in enumerate(robots) for k, numbers in r.told()]
    p_plant, p_control = np.array([[r.mass for r in robots]]), np.stack([r.gains for r in robots], axis=1)
    longest, p_watch = np.array([r.longest for r in robots]), np.tile(P[:, None], width)
    for first, size in ((0, 15), (15, 25)):
        here, inside = slice(first, first + size), [c for c in changes if first <= c.period < first + size]
        inputs = LaneInputs(first, inside, drawn[here], timing[here])
        state = lanes.advance(
            state, inputs, p_plant, p_control, PERIOD, longest, np.arange(1), p_watch=p_watch
        ).state
    for lane, r in enumerate(robots):
        alone = held.advance(
            held.start(r.begin, np.zeros(3), FIRST_COMMAND), r.rows(40), r.chance(40)[1],
            [r.mass], r.gains, PERIOD, r.longest, p_watch=P,
        )  # fmt: skip
        np.testing.assert_allclose(state.watched[:, lane], alone.state.watched, rtol=1e-11, atol=1e-12)
    with pytest.raises(SizeError, match=r"p_watch; got \(0, .*\); needs shape \(2, "):
        lanes.advance(state, inputs, p_plant, p_control, PERIOD, longest, np.arange(1))


def test_a_watch_that_does_not_fit_is_refused():
    look = watch().look
    seen = [look.sx_in(i) for i in range(look.n_in())]
    shorter = cs.Function("look", seen, [cs.SX.zeros(SIZE - 1)])
    with pytest.raises(SizeError, match=r"look does not fit; got .*needs dense columns of sizes"):
        LaneLoop(functions(cart())._replace(watch=watch()._replace(look=shorter)), 1)


def sums():
    """Return dx/dt = u, dquad/dt = x₀."""
    x, u, p = cs.SX.sym("x", 2), cs.SX.sym("u", 2), cs.SX.sym("p", 0)
    return cs.Function("sums", [x, u, p], [u, x[0]])


@pytest.fixture(params=["compiled", "machine"])
def stepper(request, tmp_path_factory):
    library = None
    if request.param == "compiled":
        if find_compiler() is None:
            pytest.skip("no compiler")
        library = compile_functions([sums(), step_watch()], driver=DRIVER)
    return FixedStep(sums(), library, step_watch())


@pytest.mark.parametrize("refine", [None, Refinement(2, 3)])
def test_fixed_steps_are_seen_at_the_start_and_at_every_end(stepper, refine):
    """x₀ = t by u = (1, 0): the sum of all that is seen is known in closed form, the times with it."""
    held, begin = np.tile([1.0, 0.0], (3, 1)), 10.0
    watched = Watched(np.zeros(3), np.array([2.0]), begin)
    done = stepper.advance([0, 0], [0], held, [], 0.4, 4, refine=refine, watched=watched)
    lengths = [0.1] * 4 if refine is None else [0.1 / 3] * 6 + [0.1] * 2
    times = np.concatenate([[0.0], np.cumsum(np.tile(lengths, 3))])
    seen = times + times**2 / 2 + 1 + 2
    np.testing.assert_allclose(done.watched, [times.size, (begin + times).sum(), seen.sum()], rtol=1e-13)
    rows = np.column_stack([times, np.zeros_like(times), times**2 / 2])
    again = stepper.watch_rows(watched, begin + times, rows, held[0])
    np.testing.assert_allclose(again, done.watched, rtol=1e-13)


def test_fixed_steps_are_not_seen_by_nobody(stepper):
    assert stepper.advance([0, 0], [0], np.ones((2, 2)), [], 0.1).watched.size == 0
    wrong = Watched(np.zeros(2), np.zeros(1)), Watched(np.zeros(3), np.zeros(2))
    for watched, name in zip(wrong, ("memory", "parameters"), strict=True):
        with pytest.raises(SizeError, match=f"{name} of the watch"):
            stepper.advance([0, 0], [0], np.ones((2, 2)), [], 0.1, watched=watched)
