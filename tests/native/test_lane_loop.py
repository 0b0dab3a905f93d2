"""Several loops in lanes: each does what `HeldLoop` does with it, whatever goes on beside it."""

from __future__ import annotations

import dataclasses

import casadi as cs
import numpy as np
import pytest

from native.carts import FIRST_COMMAND, PERIOD, START, cart, pendulum, regulator, runaway
from native.lane_carts import ROBOTS, Robot, alone, functions, side_by_side, truth, waiting
from passiflex.errors import CompilerError, SizeError, ValueRangeError
from passiflex.native import (
    HELD_LOOP_DRIVER,
    Change,
    HeldLoop,
    LaneFunctions,
    LaneInputs,
    LaneLoop,
    LoopState,
    compile_functions,
    find_compiler,
)

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no compiler")

ROUND = 1e-12
"""Forty periods of sums of ten terms, in loops that forget; measured 1e-14."""
PARTS = ("x", "quads", "controller", "command", "signals")


@pytest.fixture(scope="module")
def library():
    return compile_functions([cart(), pendulum(), runaway(), regulator()], driver=HELD_LOOP_DRIVER)


@pytest.fixture(scope="module", params=[8, 4, 2, 1])
def lanes(request):
    return LaneLoop(functions(pendulum()), request.param)


@pytest.fixture(scope="module")
def eight():
    return LaneLoop(functions(pendulum()), 8)


@pytest.fixture(scope="module")
def wild():
    """Return lanes of a plant that may reach infinity; it has no quadratures."""
    return LaneLoop(functions(runaway()), 8)


def groups(width):
    return [ROBOTS[i : i + width] for i in range(0, 8, width)]


def close(ours, theirs):
    """Compare to the largest value of each column."""
    for a, b in zip(ours.reshape(-1, ours.shape[-1]).T, theirs.reshape(-1, theirs.shape[-1]).T, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=ROUND * max(1e-3, np.nanmax(np.abs(b), initial=0)))


def check(loop, held, robots, count=40, chunks=(), **how):
    """Compare all lanes with the loops alone, their whole state after it included."""
    values, parts = side_by_side(loop, robots, count, chunks, **how)
    at, every = loop.instant, how.get("record_every", 1)
    for lane, robot in enumerate(robots):
        theirs = alone(held, robot, count, **how)
        for name in PARTS:
            close(values[:, at[name], lane], getattr(theirs, name))
        rows = robot.rows(count)[::every]
        close(values[:, at["row"], lane], rows)
        f = truth().map(len(rows))
        gains = np.tile(robot.gains[:, None], len(rows))
        close(values[:, at["truth"], lane], f(theirs.x.T, theirs.command.T, rows[:, :2].T, gains).full().T)
        assert parts[-1].completed[lane] == (chunks or (count,))[-1]
        after, end = parts[-1].state, theirs.state
        close(after.y[:, lane][None], np.concatenate([end.x, end.quads])[None])
        close(after.controller[:, lane][None], end.controller[None])
        close(after.signals[:, lane][None], end.signals[None])
        if not how.get("last"):
            close(waiting(after, lane)[None], end.line[: 3 + 3 * int(end.line[0])][None])
    return values, parts


def test_each_lane_does_what_it_would_alone(lanes, library) -> None:
    """Delays of no, a part of, and several periods, missed ones, steps of any length, in lanes beside each other."""
    for robots in groups(lanes.width):
        check(lanes, HeldLoop(pendulum(), regulator(), library), robots)


def test_on_a_cart_every_hold_is_visible(library) -> None:
    """The longest step plays no part in what comes out: an arrival at a wrong instant does."""
    check(LaneLoop(functions(cart()), 8), HeldLoop(cart(), regulator(), library), ROBOTS)


@pytest.mark.parametrize(
    "how", [{"last": True}, {"record_every": 4}, {"last": True, "record_every": 7}, {"record_every": 100}]
)
def test_last_sample_and_records_are_as_alone(eight, library, how) -> None:
    check(eight, HeldLoop(pendulum(), regulator(), library), ROBOTS, **how)


@pytest.mark.parametrize("chunks", [[1, 39], [7, 11, 22], [20, 20], [0, 40], [1] * 40])
def test_calls_in_a_row_are_one_call(eight, chunks) -> None:
    """To the last bit: what is on its way, what was told last, and the time go from one to the next."""
    whole, [once] = side_by_side(eight, ROBOTS, last=True)
    values, parts = side_by_side(eight, ROBOTS, chunks=chunks, last=True)
    np.testing.assert_array_equal(values, whole)
    for name in ("y", "controller", "signals", "scheduled"):
        np.testing.assert_array_equal(getattr(parts[-1].state, name), getattr(once.state, name))
    for lane in range(8):
        np.testing.assert_array_equal(waiting(parts[-1].state, lane), waiting(once.state, lane))


def test_each_call_begins_with_a_record(eight) -> None:
    whole, _ = side_by_side(eight, ROBOTS)
    values, _ = side_by_side(eight, ROBOTS, chunks=[7, 1, 32], record_every=4.0)
    np.testing.assert_array_equal(values, whole[[0, 4, 7, *range(8, 40, 4)]])


def test_what_is_kept_is_what_was_asked_for(eight) -> None:
    whole, _ = side_by_side(eight, ROBOTS)
    kept = np.array([5, 0, 5, eight.instant["row"].stop - 1])
    np.testing.assert_array_equal(side_by_side(eight, ROBOTS, kept=kept)[0], whole[:, kept])
    assert side_by_side(eight, ROBOTS, kept=kept[:0])[0].shape == (40, 0, 8)


def test_what_went_in_is_not_touched(eight) -> None:
    _, [first] = side_by_side(eight, ROBOTS, 10)
    before = [part.copy() for part in first.state]
    inputs = LaneInputs(10, [], np.ones((5, 2, 8)), np.ones((5, 2, 8)))
    once, twice = (
        eight.advance(
            first.state, inputs, np.ones((1, 8)), np.ones((3, 8)), PERIOD, np.full(8, PERIOD), np.arange(4)
        )
        for _ in range(2)
    )
    np.testing.assert_array_equal(once.values, twice.values)
    for ours, kept in zip(first.state, before, strict=True):
        np.testing.assert_array_equal(ours, kept)


# Neighbours


def test_a_lane_does_not_depend_on_place_or_neighbours(eight) -> None:
    """Bit for bit: among others, in any order, and eight times the same."""
    whole, _ = side_by_side(eight, ROBOTS)
    for order in (np.arange(8)[::-1], np.roll(np.arange(8), 3), np.random.default_rng(1).permutation(8)):
        values, _ = side_by_side(eight, [ROBOTS[i] for i in order])
        np.testing.assert_array_equal(values, whole[:, :, order])
    for lane, robot in enumerate(ROBOTS):
        values, _ = side_by_side(eight, [robot] * 8)
        np.testing.assert_array_equal(values, np.repeat(whole[:, :, lane : lane + 1], 8, axis=2))


def test_a_lane_does_not_depend_on_how_many_there_are(eight, lanes) -> None:
    """Vectors to the last bit; of one lane, the compiler may join other products and sums."""
    whole, _ = side_by_side(eight, ROBOTS)
    narrow = np.concatenate([side_by_side(lanes, robots)[0] for robots in groups(lanes.width)], axis=2)
    if lanes.width == 1:
        close(narrow, whole)
    else:
        np.testing.assert_array_equal(narrow, whole)


@pytest.mark.parametrize("wrong", [np.inf, np.nan, 1e308, 1e6])
@pytest.mark.parametrize("lane", [0, 5])
def test_what_is_no_number_stays_in_its_lane(eight, wrong, lane) -> None:
    """Also where sin is asked of the C library because of a neighbour."""
    whole, _ = side_by_side(eight, ROBOTS)
    robots = list(ROBOTS)
    robots[lane] = dataclasses.replace(robots[lane], begin=np.array([wrong, 0, wrong, 0]))
    values, [done] = side_by_side(eight, robots)
    others = np.arange(8) != lane
    np.testing.assert_array_equal(values[:, :, others], whole[:, :, others])
    assert (done.completed[others] == 40).all()
    if not np.isfinite(wrong):
        assert done.completed[lane] == 0


RUNAWAYS = tuple(
    Robot(seed, gains=np.zeros(3), begin=np.array([begin, 0, 0, 0]), delay=delay, longest=0.005, push=0.0)
    for seed, (begin, delay) in enumerate(
        [(1.0, 0.0), (0.4, 1.5), (-1.0, 0.0), (2.1, 0.4), (0.9, 0.0), (0.0, 3.0), (-0.3, 0.0), (0.26, 0.3)]
    )
)
"""x₀ = 1/(1/begin − t): four of them are gone within 4 s."""


def test_a_lane_that_leaves_the_finite_numbers_says_when(wild, library) -> None:
    held = HeldLoop(runaway(), regulator(), library)
    values, [done] = side_by_side(wild, RUNAWAYS)
    for lane, robot in enumerate(RUNAWAYS):
        theirs = alone(held, robot)
        assert done.completed[lane] == theirs.completed
        end = theirs.completed + 1
        # Near the pole x₀ grows as 1/ε does, and errors with its square
        ours, other = values[:end, wild.instant["x"], lane], theirs.x[:end]
        ordinary = np.abs(other[:, 0]) < 100
        np.testing.assert_allclose(ours[ordinary], other[ordinary], rtol=1e-9)
        assert np.isfinite(ours).all()
    assert sorted(done.completed)[3:] == [40] * 5 or (done.completed < 40).sum() >= 4
    assert len(set(done.completed)) >= 4


def test_it_is_said_once_and_again_in_each_piece(wild) -> None:
    """A lane that is gone stays so: it has done no sample of the next chunk."""
    whole, [once] = side_by_side(wild, RUNAWAYS)
    values, parts = side_by_side(wild, RUNAWAYS, chunks=[15, 0, 25])
    np.testing.assert_array_equal(values, whole)
    gone = once.completed < 15
    assert gone.any()
    np.testing.assert_array_equal(parts[0].completed, np.where(gone, once.completed, 15))
    np.testing.assert_array_equal(parts[2].completed, np.where(gone, 0, once.completed - 15))


def test_when_all_are_gone_the_loop_ends(wild) -> None:
    """What was not reached is no number."""
    robots = [RUNAWAYS[0], RUNAWAYS[3]] * 4
    values, [done] = side_by_side(wild, robots)
    end = done.completed.max()
    assert end < 15
    assert np.isfinite(values[: done.completed.min() + 1, :4]).all()
    assert np.isnan(values[end + 1 :]).all()
    assert not np.isnan(values[end, :, 0]).all()


def test_a_lane_that_waits_for_others_stands_still(wild, library) -> None:
    """One step of Runge-Kutta takes it to 4e292, where its slope overflows: it is gone a period later, as alone."""
    quick = Robot(gains=np.zeros(3), begin=np.array([1e20, 0, 0, 0]), push=0.0)
    values, [done] = side_by_side(wild, [quick, *RUNAWAYS[1:]])
    theirs = alone(HeldLoop(runaway(), regulator(), library), quick)
    assert theirs.completed == 1
    assert done.completed[0] == 1
    np.testing.assert_allclose(values[1, :4, 0], theirs.x[1], rtol=1e-12)


# Edges


def test_a_loop_of_almost_nothing(library) -> None:
    """No memory, signals, environment, chance, truth, and nothing told: dx/dt = −x under commands that do nothing."""
    x, u, p = cs.SX.sym("x", 1), cs.SX.sym("u", 1), cs.SX.sym("p", 0)
    none = cs.SX(0, 1)
    loop = LaneLoop(
        LaneFunctions(
            cs.Function("bare", [x, u, p], [-x + 0 * u, none]),
            cs.Function("law", [x, none, none, p], [none, cs.SX.zeros(1), none]),
            cs.Function("row", [cs.SX.sym("time"), none, none], [none]),
            cs.Function("truth", [x, u, none, p], [none]),
        ),
        4,
    )
    begin = [
        LoopState(np.array([x0]), np.zeros(0), np.zeros(0), np.zeros(loop.n_line), np.zeros(0))
        for x0 in range(4)
    ]
    nothing = np.zeros((0, 4))
    inputs = LaneInputs(0, [], np.zeros((11, 0, 4)), np.tile([[0.0], [1.0]], (11, 1, 4)))
    done = loop.advance(loop.start(begin), inputs, nothing, nothing, 0.1, np.full(4, 0.01), np.array([0]))
    np.testing.assert_allclose(done.values[10, 0], np.arange(4) / np.e, rtol=1e-9)


def test_no_periods_leave_all_as_it_was(eight) -> None:
    _, [done] = side_by_side(eight, ROBOTS, 10)
    kept = np.arange(3)
    inputs = LaneInputs(10, [], np.zeros((0, 2, 8)), np.zeros((0, 2, 8)))
    none = eight.advance(done.state, inputs, np.ones((1, 8)), np.ones((3, 8)), PERIOD, np.ones(8), kept)
    assert none.values.shape == (0, 3, 8)
    for ours, before in zip(none.state, done.state, strict=True):
        np.testing.assert_array_equal(ours, before)


def test_a_line_may_be_as_long_as_alone(eight, library) -> None:
    robots = [Robot(i, gains=np.array([0.1, 0.1, 0.001]), delay=61.9 - i, jitter=i) for i in range(8)]
    check(eight, HeldLoop(pendulum(), regulator(), library), robots, 130)


def good(loop):
    """Return arguments that `advance` takes."""
    state = loop.start(
        [LoopState(START, np.zeros(loop.n_q), np.zeros(3), line(loop), np.zeros(loop.n_z))] * loop.width
    )
    inputs = LaneInputs(0, [], np.zeros((5, 2, 8)), np.ones((5, 2, 8)) * PERIOD)
    rest = {"period": PERIOD, "longest": np.full(8, PERIOD), "kept": np.arange(4)}
    return {
        "state": state,
        "inputs": inputs,
        "p_plant": np.ones((1, 8)),
        "p_control": np.ones((3, 8)),
        **rest,
    }


def line(loop):
    return np.concatenate([[0], FIRST_COMMAND, np.zeros(loop.n_line - 3)])


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("p_plant", np.ones(8), r"p_plant; got \(8,\); needs shape \(1, 8\)"),
        ("p_control", np.ones((8, 3)), r"p_control; got \(8, 3\); needs shape \(3, 8\)"),
        ("longest", np.ones(4), r"longest; got \(4,\); needs shape \(8,\)"),
        ("drawn", np.zeros((5, 8, 2)), r"drawn; got \(5, 8, 2\); needs shape \(5, 2, 8\)"),
        ("timing", np.zeros((4, 2, 8)), r"timing; got \(4, 2, 8\); needs shape \(5, 2, 8\)"),
        ("y", np.zeros((4, 8)), r"y; got \(4, 8\); needs shape \(7, 8\)"),
    ],
)
def test_arguments_of_another_shape_are_refused(eight, name, value, words) -> None:
    arguments = good(eight)
    for part in ("state", "inputs"):
        if name in arguments[part]._fields:
            arguments[part] = arguments[part]._replace(**{name: value})
            break
    else:
        arguments[name] = value
    with pytest.raises(SizeError, match=words):
        eight.advance(**arguments)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("period", 0.0, r"period; got 0.0; needs a positive time in s"),
        ("longest", np.array([*[1.0] * 7, 0.0]), r"longest; got .*; needs positive times in s"),
        ("longest", np.array([*[1.0] * 7, np.nan]), r"longest; got .*; needs positive times in s"),
        ("record_every", 0, r"record_every; got 0; needs a whole number, at least 1"),
        ("record_every", 1.5, r"record_every; got 1.5; needs a whole number, at least 1"),
        ("kept", np.array([0, 1000]), r"kept; got .*; needs numbers of a sample"),
        ("kept", np.array([-1]), r"kept; got .*; needs numbers of a sample"),
        ("timing", np.full((5, 2, 8), -1.0), r"delay of a command; got .*; needs 0 to 61 periods"),
        ("timing", np.full((5, 2, 8), 62 * PERIOD), r"delay of a command; got .*; needs 0 to 61 periods"),
        ("timing", np.full((5, 2, 8), np.nan), r"delay of a command; got .*; needs 0 to 61 periods"),
        ("changes", [Change(0, 8, np.zeros(3))], r"lane of a change; got 8; needs below 8"),
        ("changes", [Change(0, -1, np.zeros(3))], r"lane of a change; got -1; needs below 8"),
        ("changes", [Change(0, 1, np.zeros(2))], r"scheduled in a change; got \(2,\); needs shape \(3,\)"),
    ],
)
def test_arguments_out_of_range_are_refused(eight, name, value, words) -> None:
    """The native loop would write where nobody asked it to, or never come back."""
    arguments = good(eight)
    eight.advance(**arguments)
    if name in arguments["inputs"]._fields:
        arguments["inputs"] = arguments["inputs"]._replace(**{name: value})
    else:
        arguments[name] = value
    with pytest.raises((SizeError, ValueRangeError), match=words):
        eight.advance(**arguments)


def test_functions_that_do_not_fit_are_refused() -> None:
    f, x = functions(pendulum()), cs.SX.sym("x", 4)
    time, drawn = cs.SX.sym("time"), cs.SX.sym("drawn", 2)
    longer = cs.Function("row", [time, x, drawn], [cs.vertcat(x, 1)])
    flat = cs.Function("row", [time, x, drawn.T], [x])
    u, s, p = cs.SX.sym("u", 2), cs.SX.sym("s", 2), cs.SX.sym("p", 3)
    sparse = cs.Function("truth", [x, u, s, p], [cs.vertcat(cs.SX(1, 1), u)])
    other = cs.Function("truth", [x, u, cs.SX.sym("s", 3), p], [u])
    for name, wrong in (("row", longer), ("row", flat), ("truth", sparse), ("truth", other)):
        with pytest.raises(SizeError, match=f"{name} does not fit|control does not fit"):
            LaneLoop(f._replace(**{name: wrong}), 4)


@pytest.mark.parametrize("width", [0, 3, 16, -1])
def test_other_numbers_of_lanes_than_registers_have_are_refused(width) -> None:
    with pytest.raises(ValueRangeError, match=rf"number of lanes; got {width}; needs one of 1, 2, 4, 8"):
        LaneLoop(functions(pendulum()), width)


def test_a_state_for_each_lane(eight) -> None:
    with pytest.raises(SizeError, match=r"states; got 1; needs one for each of 8 lanes"):
        eight.start([LoopState(START, np.zeros(3), np.zeros(3), line(eight), np.zeros(5))])


def test_without_a_compiler_there_are_no_lanes(monkeypatch) -> None:
    monkeypatch.setenv("PASSIFLEX_COMPILER", "none")
    with pytest.raises(CompilerError, match=r"no C compiler"):
        LaneLoop(functions(pendulum()), 8)


def test_zig_makes_the_same_lanes(monkeypatch, eight) -> None:
    pytest.importorskip("ziglang")
    whole, _ = side_by_side(eight, ROBOTS)
    monkeypatch.setenv("PASSIFLEX_COMPILER", "zig")
    close(side_by_side(LaneLoop(functions(pendulum()), 8), ROBOTS)[0], whole)
