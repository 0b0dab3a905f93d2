"""A sampled loop whose plant somebody else moves: what it senses, what pushes it, and what passes its ports."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

import casadi as cs

from passiflex.loops.compiled import structure
from passiflex.loops.plant import Plant
from passiflex.loops.sampled_loop import SampledLoop
from passiflex.native import NativeFunction, compile_functions

WEIGHTS = (1 / 6, 1 / 3, 1 / 3, 1 / 6)
"""Of the stages of the classical Runge-Kutta method."""
NODES = (0.0, 0.5, 0.5, 1.0)
"""When they are, as shares of the step; each goes on from the one before."""

_built: dict[Hashable, MovedLoop] = {}


@dataclass(frozen=True, eq=False)
class MovedLoop:
    """The functions of a loop, one call each, for whoever moves its plant; all numbers are run-time inputs.

    Attributes
    ----------
    sense: (x, environment, p) → what there is to be measured.
    law: (measured, c, row without environment, p without the plant's) → (c, command, signals).
    push: (moving, environment, p) → what the elements do to the motors and to the links (2 n,) [N m], and the rate of
        their states.
    passed: (moving at each stage, [command, environment], p, h) → what passed the ports in a step of h seconds [J], by
        the classical Runge-Kutta rule.

    `moving` is (θ, q, θ̇, q̇, states of elements).
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
    """Return (moving, environment, p) → the torques of what touches the robot, motors first, and its states' rate."""
    moving, (s, environment) = cs.SX.sym("moving", plant.state.size), plant.environment.symbols("s")
    p, m = plant.parameters.symbols("p")
    x, n = _state(plant, moving), plant.robot.n
    links, motors = plant.touched(x, environment, m)
    rate = plant.state.stack(plant.flow(x, cs.SX.zeros(n), environment, m).rate)[4 * n :]
    out = [cs.densify(cs.vertcat(motors, links)), cs.densify(rate)]
    return cs.Function("push", [moving, s, p], out, {"cse": True})


def passed(plant: Plant) -> cs.Function:
    """Return (moving at each stage, [command, environment], p, h) → the energies that passed in a step."""
    n = plant.robot.n
    stages, h = cs.SX.sym("stages", len(WEIGHTS) * plant.state.size), cs.SX.sym("h")
    command, (s, environment) = cs.SX.sym("command", n), plant.environment.symbols("s")
    p, m = plant.parameters.symbols("p")
    energies = cs.SX.zeros(plant.energies.size)
    for weight, moving in zip(WEIGHTS, cs.vertsplit(stages, plant.state.size), strict=True):
        powers = plant.flow(_state(plant, moving), command, environment, m).powers
        energies += weight * plant.energies.stack(powers)
    inputs = [stages, cs.vertcat(command, s), p, h]
    return cs.Function("passed", inputs, [cs.densify(h * energies)], {"cse": True})


def _state(plant: Plant, moving: cs.SX) -> cs.SX:
    """Return the state of a plant."""
    n = plant.robot.n
    theta, q, dtheta, dq = cs.vertsplit(moving[: 4 * n], n)
    return cs.vertcat(q, theta, dq, dtheta, moving[4 * n :])
