"""A closed loop in native code, built once per structure and shared within the process."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from functools import lru_cache

import casadi as cs

from passiflex.loops.closed_loop import ClosedLoop
from passiflex.loops.plant import Elements
from passiflex.loops.sampled_loop import SampledLoop
from passiflex.native import (
    DRIVER,
    HELD_LOOP_DRIVER,
    FixedStep,
    HeldLoop,
    NativeFunction,
    compile_functions,
    load_external,
)
from passiflex.robots.arm import SerialArm
from passiflex.sampled.controller import SampledController
from passiflex.sampled.sensors import AbstractSensorEffect
from passiflex.sampled.tanks import TANKS

CVODES_DERIVATIVES = {"fd_method": "forward", "is_diff_in": [True, False, False]}
"""CVODES needs ∂ẋ/∂x only, and one-sided differences are enough for its Newton iteration."""

_built: dict[Hashable, CompiledLoop] = {}

_built_sampled: dict[tuple[object, ...], CompiledSampledLoop] = {}


@dataclass(frozen=True, eq=False)
class CompiledLoop:
    """A closed loop and its compiled functions; all numbers are run-time inputs.

    Attributes
    ----------
    loop: The symbolic closed loop.
    rhs: (x, u, p) → (ẋ, powers), as a CasADi function for CVODES.
    fixed_step: The same, under held inputs.
    outputs: (x, u, p) → recorded signals.
    law: The control law alone.
    """

    loop: ClosedLoop
    rhs: cs.Function
    fixed_step: FixedStep
    outputs: NativeFunction
    law: NativeFunction


def compiled_loop(loop: ClosedLoop) -> CompiledLoop:
    """Return the compiled functions of a loop; from the process, the cache on disk, or compiled now."""
    key = _urdf(loop.law.robot.arm), loop.law.structure, _structures(loop.elements)
    if key not in _built:
        _built[key] = _compile(loop)
    return _built[key]


@dataclass(frozen=True, eq=False)
class CompiledSampledLoop:
    """A sampled loop and its compiled functions; all numbers are run-time inputs.

    Attributes
    ----------
    loop: The symbolic loop.
    held: The loop through time.
    plant, control, outputs, row: Its functions, for arrays.
    """

    loop: SampledLoop
    held: HeldLoop
    plant: NativeFunction
    control: NativeFunction
    outputs: NativeFunction
    row: NativeFunction


def compiled_sampled_loop(loop: SampledLoop) -> CompiledSampledLoop:
    """Return the compiled functions of a loop; from the process, the cache on disk, or compiled now."""
    key = structure(loop)
    if key not in _built_sampled:
        functions = [loop.plant.rhs, loop.control, loop.outputs, loop.period.function]
        library = compile_functions([*functions, *loop.watch], driver=HELD_LOOP_DRIVER)
        native = [NativeFunction(f, library) for f in functions]
        held = HeldLoop(loop.plant.rhs, loop.control, library, loop.watch)
        _built_sampled[key] = CompiledSampledLoop(loop, held, *native)
    return _built_sampled[key]


def interpreted_sampled_loop(loop: SampledLoop) -> CompiledSampledLoop:
    """Return the same without compiling anything: for a few evaluations of a loop that nobody runs yet."""
    if structure(loop) in _built_sampled:
        return compiled_sampled_loop(loop)
    return _interpreted(loop.controller, loop.elements, loop.effects)


@lru_cache(maxsize=8)
def _interpreted(
    controller: SampledController, elements: Elements, effects: tuple[AbstractSensorEffect, ...]
) -> CompiledSampledLoop:
    loop = SampledLoop(controller, elements, effects)
    functions = [loop.plant.rhs, loop.control, loop.outputs, loop.period.function]
    held = HeldLoop(loop.plant.rhs, loop.control, None)
    return CompiledSampledLoop(loop, held, *(NativeFunction(f) for f in functions))


def structure(loop: SampledLoop) -> tuple[object, ...]:
    """Return what the code of a sampled loop depends on; loops that agree in it share compiled code."""
    controller, law, tank = loop.controller, loop.controller.law, loop.controller.tank
    of_tank = type(tank) if tank is None or type(tank) in TANKS.values() else tank
    return (
        _urdf(law.robot.arm), law.structure, of_tank, controller.external, controller.inner, controller.actions,
        controller.compensates, controller.held_task, controller.readings, _structures(loop.elements), loop.effects,
    )  # fmt: skip


def _structures(elements: Elements) -> tuple[Hashable, ...]:
    return tuple(e.structure for e in elements)


@lru_cache(maxsize=64)
def _urdf(arm: SerialArm) -> str:
    """Return the text that two arms of the same structure have in common; kept, as a campaign asks for each sample."""
    return arm.chain.to_urdf()


def _compile(loop: ClosedLoop) -> CompiledLoop:
    library = compile_functions([loop.rhs, loop.outputs, loop.watch, loop.law_function], driver=DRIVER)
    return CompiledLoop(
        loop=loop,
        rhs=load_external("rhs", library, **CVODES_DERIVATIVES) if library else loop.rhs,
        fixed_step=FixedStep(loop.rhs, library, loop.watch),
        outputs=NativeFunction(loop.outputs, library),
        law=NativeFunction(loop.law_function, library),
    )
