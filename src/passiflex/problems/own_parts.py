"""Parts that somebody brings: a law, a tank, elements, in place of those of a scenario or beside them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import casadi as cs
from numpy.typing import ArrayLike

from passiflex.control.law import AbstractLaw, ImpedanceLaw
from passiflex.errors import ArgumentError, ValueRangeError
from passiflex.loops.elements import AbstractElement, Effect, Touch
from passiflex.problems.problem import Problem
from passiflex.robots.flexible import RobotState
from passiflex.sampled.matched_loop import MatchedInnerLoop
from passiflex.sampled.tank import AbstractTank


def with_parts(
    problem: Problem,
    *,
    law: AbstractLaw | None = None,
    gains: Mapping[str, ArrayLike] | None = None,
    tank: AbstractTank | None = None,
    elements: Sequence[AbstractElement] = (),
) -> Problem:
    """Return the problem with parts of the caller's own.

    Parameters
    ----------
    law: In place of the scenario's, for the same robot; its gains are those of the scenario that have their names.
    gains: Of the law, by name, in place of the scenario's or beside them.
    tank: In place of the scenario's, with its settings.
    elements: What touches the end effector beside the rest; their numbers are their own, so they have no parameters.

    Raises
    ------
    ValueRangeError
        For another robot's law, or one in a matched loop, elements with parameters or on the motors, or a tank or
        elements in continuous time.
    ArgumentError
        For what is no such part, as its class.
    NameUnknownError, SizeError
        For gains that the law does not have, or lacks.
    """
    if not isinstance(elements, Sequence):
        raise ArgumentError(elements, "a list of elements")
    kinds = (law, AbstractLaw), (tank, AbstractTank), *((element, AbstractElement) for element in elements)
    for part, kind in kinds:
        if not isinstance(part, kind | None):
            raise ArgumentError(part, f"an instance of {kind.__name__}, from a class of your own")
    changed = problem
    if law is not None:
        changed = _with_law(changed, law, dict(gains or {}))
    elif gains:
        raise ValueRangeError("gains are those of a law of one's own", got=", ".join(gains), needs="law=")
    if tank is not None or elements:
        changed = _touched(changed, tank, tuple(elements))
    own = [part for part in (law, tank, *elements) if part is not None]
    if not own:
        return problem
    said = f"# With parts that no scenario has: {', '.join(type(part).__name__ for part in own)}.\n"
    return dataclasses.replace(changed, configuration=said + problem.configuration)


def _with_law(problem: Problem, law: AbstractLaw, gains: dict[str, Any]) -> Problem:
    if law.robot is not problem.law.robot:
        needs = f"that of the scenario, FlexibleJointRobot.load({problem.law.robot.name!r})"
        raise ValueRangeError("the law is for another robot", got=law.robot.name, needs=needs)
    own = {f.name for f in law.layout}

    def packed(old: Mapping[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in old.items() if name in own} | gains

    numbers = packed(problem.law.layout.unpack(problem.gains))
    changed = dataclasses.replace(problem, law=law, gains=law.layout.pack(numbers))
    s = problem.sampling
    if s is None:
        return changed
    if isinstance(s.controller.inner, MatchedInnerLoop) and not isinstance(law, ImpedanceLaw):
        needs = "`inner_loop: plain`, as the matched one takes the paper's law apart"
        raise ValueRangeError("the law cannot be matched", got=type(law).__name__, needs=needs)
    before, controller = s.loop.parameters, dataclasses.replace(s.controller, law=law)
    values = {name: before.unpack(name, s.numbers) for name in before._fields}
    values["gains"], values["fallback"] = packed(values["gains"]), packed(values["fallback"])
    after = dataclasses.replace(s, controller=controller)
    return dataclasses.replace(
        changed, sampling=dataclasses.replace(after, numbers=after.loop.parameters.pack(**values))
    )


def _touched(problem: Problem, tank: AbstractTank | None, elements: tuple[AbstractElement, ...]) -> Problem:
    s = problem.sampling
    if s is None:
        raise ValueRangeError(
            "a tank or elements of one's own are for sampled loops", needs="a scenario with `control`"
        )
    if tank is not None and s.controller.tank is None:
        raise ValueRangeError("the scenario has no tank", needs="`tank: {}`, for its settings")
    n = problem.law.robot.n
    if wrong := [e for e in elements if e.parameters(n).size or e.inputs().size]:
        got = ", ".join(type(e).__name__ for e in wrong)
        raise ValueRangeError(
            "an element of one's own has parameters", got=got, needs="attributes of its own"
        )
    if wrong := [e for e in elements if e.booked or not _effect(e, n).motor.is_zero()]:
        got = ", ".join(type(e).__name__ for e in wrong)
        needs = "a force or a moment on the end effector: the ledger of the motors knows their friction only"
        raise ValueRangeError("an element of one's own touches the motors", got=got, needs=needs)
    controller = dataclasses.replace(s.controller, tank=tank or s.controller.tank)
    sampling = dataclasses.replace(s, controller=controller, elements=(*s.elements, *elements))
    return dataclasses.replace(problem, sampling=sampling)


def _effect(element: AbstractElement, n: int) -> Effect:
    """Return what an element does, in symbols."""
    x = RobotState(*(cs.SX.sym(name, n) for name in RobotState._fields))
    at = Touch(x, cs.SX.sym("velocity", 3), cs.SX.sym("spin", 3))
    return element.act(at, SimpleNamespace(), SimpleNamespace())
