"""A sampled loop whose plant somebody else moves: what it senses, what pushes it, and what passes its ports."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

import casadi as cs

from passiflex.loops.compiled import structure
from passiflex.loops.plant import Plant
from passiflex.loops.sampled_loop import SampledLoop
from passiflex.native import NativeFunction, compile_functions

_built: dict[Hashable, MovedLoop] = {}


@dataclass(frozen=True, eq=False)
class MovedLoop:
    """The functions of a loop, one call each, for whoever moves its plant; all numbers are run-time inputs.

    Attributes
    ----------
    sense: (x, environment, p) → what there is to be measured.
    law: (measured, c, row without environment, p without the plant's) → (c, command, signals).
    push: (x, environment, p) → what the elements do to the links and to the motors (2 n,) [N m].
    passed: (x before, x after, [command, environment], p, h) → what passed the ports in a step of h seconds [J].
    look, glance: Of the witness.
    """

    loop: SampledLoop
    sense: NativeFunction
    law: NativeFunction
    push: NativeFunction
    passed: NativeFunction
    look: NativeFunction
    glance: NativeFunction


def moved_loop(loop: SampledLoop) -> MovedLoop:
    """Return the functions; from the process, the cache on disk, or compiled now."""
    key = structure(loop)
    if key not in _built:
        functions = [loop.sense, loop.law_alone, push(loop.plant), passed(loop.plant), *loop.watch]
        library = compile_functions(functions)
        _built[key] = MovedLoop(loop, *(NativeFunction(f, library) for f in functions))
    return _built[key]


def push(plant: Plant) -> cs.Function:
    """Return (x, environment, p) → the torques of what touches the robot: on the links, then on the motors."""
    x, (s, environment) = cs.SX.sym("x", plant.state.size), plant.environment.symbols("s")
    p, m = plant.parameters.symbols("p")
    touched = plant.touched(x, environment, m)
    return cs.Function("push", [x, s, p], [cs.densify(cs.vertcat(*touched))], {"cse": True})


def passed(plant: Plant) -> cs.Function:
    """Return (x before, x after, u, p, h) → the energies that passed in a step.

    By Simpson's rule, with what is in the middle from the cubic through both ends and their rates, by the plant's own
    equations: an error of order h⁵ where the step has no jump, whoever took it.
    """
    rhs = plant.rhs
    before, after = cs.SX.sym("before", plant.state.size), cs.SX.sym("after", plant.state.size)
    inputs, numbers, h = cs.SX.sym("u", rhs.size1_in(1)), cs.SX.sym("p", rhs.size1_in(2)), cs.SX.sym("h")
    (first, begin), (last, end) = rhs(before, inputs, numbers), rhs(after, inputs, numbers)
    middle = rhs((before + after) / 2 + h / 8 * (first - last), inputs, numbers)[1]
    energies = h / 6 * (begin + 4 * middle + end)
    return cs.Function("passed", [before, after, inputs, numbers, h], [cs.densify(energies)], {"cse": True})
