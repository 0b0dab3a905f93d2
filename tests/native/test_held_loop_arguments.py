"""What a loop under held commands refuses, and in which words."""

import casadi as cs
import numpy as np
import pytest

from native.carts import FIRST_COMMAND, GAINS, START, cart, regulator, run, told
from passiflex.errors import CompilerError, SizeError, ValueRangeError
from passiflex.native import DRIVER, HeldLoop, compile_functions, find_compiler


def late(delay):
    """Return the timing of three samples."""
    return np.tile([delay, 1.0], (3, 1))


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"rows": np.ones(4)}, SizeError, r"rows; got \(4,\); needs shape \(samples, 4\)"),
        ({"rows": np.ones((3, 5))}, SizeError, r"rows; got \(3, 5\)"),
        ({"timing": np.ones((2, 2))}, SizeError, r"timing; got \(2, 2\); needs shape \(3, 2\)"),
        ({"timing": np.ones(3)}, SizeError, r"timing; got \(3,\)"),
        ({"p_plant": [1, 2]}, SizeError, r"p_plant; got \(2,\); needs shape \(1,\)"),
        ({"p_control": [1.0]}, SizeError, r"p_control; got \(1,\); needs shape \(3,\)"),
        ({"period": 0.0}, ValueRangeError, "period; got 0.0; needs a positive time in s"),
        ({"period": np.nan}, ValueRangeError, "period; got nan"),
        ({"longest": -1.0}, ValueRangeError, "longest; got -1.0; needs a positive time in s"),
        ({"longest": np.inf}, ValueRangeError, "longest; got inf"),
        ({"record_every": 0}, ValueRangeError, "record_every; got 0; needs a whole number, at least 1"),
        ({"record_every": 1.5}, ValueRangeError, "record_every; got 1.5"),
        (
            {"timing": late(-0.1)},
            ValueRangeError,
            "delay of a command; got -0.1 to -0.1 s; needs 0 to 61 periods",
        ),
        ({"timing": late(62.0)}, ValueRangeError, "delay of a command; got 62.0 to 62.0 s"),
        ({"timing": late(np.nan)}, ValueRangeError, "delay of a command; got nan"),
    ],
)
def test_wrong_arguments_are_named(change, error, message):
    loop = HeldLoop(cart(), regulator())
    right = {"rows": np.ones((3, 4)), "timing": late(0.0), "p_plant": [1.0], "p_control": GAINS}
    right |= {"state": loop.start(START, np.zeros(3), FIRST_COMMAND), "period": 1.0, "longest": 1.0}
    loop.advance(**right, record_every=np.int64(2))
    with pytest.raises(error, match=message):
        loop.advance(**(right | change))


@pytest.mark.parametrize(("part", "size"), [("x", 4), ("controller", 3), ("command", 2)])
def test_a_start_needs_the_sizes_of_the_loop(part, size):
    right = {"x": START, "controller": np.zeros(3), "command": FIRST_COMMAND}
    with pytest.raises(SizeError, match=rf"{part}; got \(1,\); needs shape \({size},\)"):
        HeldLoop(cart(), regulator()).start(**(right | {part: [0.0]}))


def test_a_state_of_another_loop_is_refused():
    loop = HeldLoop(cart(), regulator())
    state = loop.start(START, np.zeros(3), FIRST_COMMAND)
    for name in state._fields:
        with pytest.raises(SizeError, match=rf"{name} of the state; got \(99,\)"):
            run(loop, told(2, 0.0), state=state._replace(**{name: np.zeros(99)}))


def test_functions_of_another_form_are_refused():
    x, u, p, c = (cs.SX.sym(name, 4) for name in "xupc")
    sparse = cs.vertcat(x[:3], cs.SX(1, 1))
    plant, law = cs.Function("f", [x, u, p], [x, x]), cs.Function("g", [x, c, u, p], [c, u[:2], x])
    HeldLoop(plant, law)
    others = [
        (cs.Function("f", [x, u], [x, x]), law),
        (cs.Function("f", [x, u, p], [sparse, x]), law),
        (cs.Function("f", [x, u, p], [x[:3], x]), law),
        (cs.Function("f", [x, u, p], [x, cs.horzcat(x, x)]), law),
        (plant, cs.Function("g", [x, c, u, p], [c[:3], u[:2], x])),
        (plant, cs.Function("g", [x, c, u, p], [c, sparse, x])),
        (plant, cs.Function("g", [x, c, u, p], [c, cs.vertcat(u, u), x])),
        (plant, cs.Function("g", [x, c, cs.SX.sym("w"), p], [c, c[:2], x])),
        (plant, cs.Function("g", [x, c, u, p], [c, u[:2]])),
    ]
    for wrong in others:
        with pytest.raises(SizeError, match="plant and control do not fit"):
            HeldLoop(*wrong)


def test_a_library_without_the_driver_is_refused(monkeypatch, tmp_path):
    if find_compiler() is None:
        pytest.skip("no compiler")
    monkeypatch.setenv("PASSIFLEX_CACHE", str(tmp_path))
    without = compile_functions([cart(), regulator()], driver=DRIVER)
    with pytest.raises(CompilerError, match="no routine 'passiflex_held_loop'; needs the driver"):
        HeldLoop(cart(), regulator(), without)
