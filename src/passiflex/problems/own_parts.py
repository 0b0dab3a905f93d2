"""Parts that somebody brings: a law, a tank, elements, in place of those of a scenario or beside them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from numpy.typing import ArrayLike

from passiflex.control.law import AbstractLaw
from passiflex.elements import AbstractElement
from passiflex.errors import ArgumentError, ValueRangeError
from passiflex.loops.closed_loop import ClosedLoop
from passiflex.loops.plant import Plant
from passiflex.loops.recorded import instant_parts, sample_parts
from passiflex.problems.own_part_checks import (
    check_element,
    check_law,
    check_motion,
    check_sensor,
    check_storage,
    check_tank,
)
from passiflex.problems.problem import Problem, SampledProblem
from passiflex.problems.timeline import with_motions
from passiflex.sampled.sensors import AbstractSensorEffect
from passiflex.sampled.tank import AbstractTank
from passiflex.scenarios.reference import AbstractReferenceEvent

OWN = "# With parts that no scenario has: "
"""How the text of a problem with such parts begins: it cannot be made again from that alone."""


def with_parts(
    problem: Problem,
    *,
    law: AbstractLaw | None = None,
    gains: Mapping[str, ArrayLike] | None = None,
    tank: AbstractTank | None = None,
    elements: Sequence[AbstractElement] = (),
    sensors: Sequence[AbstractSensorEffect] = (),
    reference: Sequence[AbstractReferenceEvent] = (),
) -> Problem:
    """Return the problem with parts of the caller's own.

    Parameters
    ----------
    law: In place of the scenario's, for the same robot; its gains are those of the scenario that have their names.
    gains: Of the law, by name, in place of the scenario's or beside them.
    tank: In place of the scenario's, with its settings.
    elements: What touches the robot beside the rest.
    sensors: What the readings of a sampled run go through, after its own sensors.
    reference: Motions of the reference, each from its instant on, among those of the scenario.

    Raises
    ------
    ValueRangeError
        For another robot's law, or one in a matched loop, an element with inputs or more than one port, two of one
        name or with a signal's, a tank or sensors in continuous time, or a motion beyond the run.
    ArgumentError
        For what is no such part, as its class.
    NameUnknownError, SizeError
        For gains that the law does not have, or lacks.
    """
    lists = {"elements": elements, "sensor effects": sensors, "motions of the reference": reference}
    for name, given in lists.items():
        if not isinstance(given, Sequence):
            raise ArgumentError(given, f"a list of {name}")
    kinds: list[tuple[Any, type]] = [(law, AbstractLaw), (tank, AbstractTank)]
    kinds += [(element, AbstractElement) for element in elements]
    kinds += [(effect, AbstractSensorEffect) for effect in sensors]
    kinds += [(event, AbstractReferenceEvent) for event in reference]
    for part, kind in kinds:
        if not isinstance(part, kind | None):
            raise ArgumentError(part, f"an instance of {kind.__name__}, from a class of your own")
        _require_hash(part)
    changed = problem
    if law is not None:
        changed = _with_law(changed, law, dict(gains or {}))
    elif gains:
        raise ValueRangeError("gains are those of a law of one's own", got=", ".join(gains), needs="law=")
    if tank is not None:
        changed = _with_tank(changed, tank)
    if elements:
        changed = _with_elements(changed, tuple(elements))
    if sensors:
        changed = _with_sensors(changed, tuple(sensors))
    if reference:
        changed = _with_reference(changed, reference)
    own = [part for part in (law, tank, *elements, *sensors, *reference) if part is not None]
    if not own:
        return problem
    if isinstance(changed, SampledProblem):
        sample_parts(changed.loop)
    else:
        instant_parts(ClosedLoop(changed.law, changed.elements))
    said = f"{OWN}{', '.join(type(part).__name__ for part in own)}.\n"
    return dataclasses.replace(changed, text=said + problem.text)


def parts_said(text: str) -> str:
    """Return the parts of somebody's own that the text of a problem names."""
    first = text.partition("\n")[0]
    return first.removeprefix(OWN).removesuffix(".") if first.startswith(OWN) else ""


def _require_hash(part: object) -> None:
    """Raise ArgumentError for a part whose code could not be found again: it is kept by what the part is."""
    try:
        hash(part)
    except TypeError:
        needs = "a class that can be hashed, with numbers or tuples as attributes"
        raise ArgumentError(part, needs, "@dataclass(frozen=True)") from None


def _with_law(problem: Problem, law: AbstractLaw, gains: dict[str, Any]) -> Problem:
    if law.robot is not problem.law.robot:
        needs = f"that of the scenario, FlexibleJointRobot.load({problem.law.robot.name!r})"
        raise ValueRangeError("the law is for another robot", got=law.robot.name, needs=needs)
    check_law(law, problem)
    own = {f.name for f in law.layout}
    before, numbers = problem.parts, problem.numbers
    values: dict[str, dict[str, Any]] = {part: before.unpack(part, numbers) for part in before.layouts}
    for part in {"gains", "fallback"} & values.keys():
        values[part] = {name: value for name, value in values[part].items() if name in own} | gains
    if isinstance(problem, SampledProblem):
        if not problem.controller.inner.takes(law):
            needs = "`inner_loop: plain`, as the matched one takes the paper's law apart"
            raise ValueRangeError("the law cannot be matched", got=type(law).__name__, needs=needs)
        controller = dataclasses.replace(problem.controller, law=law)
        changed: Problem = dataclasses.replace(problem, law=law, controller=controller)
    else:
        changed = dataclasses.replace(problem, law=law)
    changed = dataclasses.replace(changed, numbers=changed.parts.pack(values))
    check_storage(changed)
    return changed


def _with_tank(problem: Problem, tank: AbstractTank) -> Problem:
    if not isinstance(problem, SampledProblem):
        raise ValueRangeError("a tank of one's own is for sampled loops", needs="a scenario with `control`")
    if problem.controller.tank is None:
        raise ValueRangeError("the scenario has no tank", needs="`tank: {}`, for its settings")
    check_tank(tank)
    return dataclasses.replace(problem, controller=dataclasses.replace(problem.controller, tank=tank))


def _with_elements(problem: Problem, elements: tuple[AbstractElement, ...]) -> Problem:
    n = problem.law.robot.n
    for e in elements:
        check_element(e, n)
    plant = Plant(problem.law.robot, (*problem.elements, *elements))
    _ = plant.energies, plant.state  # which refuse two of one name
    before, numbers = problem.parts, problem.numbers
    values: dict[str, dict[str, Any]] = {part: before.unpack(part, numbers) for part in before.layouts}
    for e in elements:
        values["plant"] |= e.numbers(n)
    changed = dataclasses.replace(problem, elements=plant.elements)
    return dataclasses.replace(changed, numbers=changed.parts.pack(values))


def _with_sensors(problem: Problem, effects: tuple[AbstractSensorEffect, ...]) -> Problem:
    if not isinstance(problem, SampledProblem):
        raise ValueRangeError("sensors of one's own are for sampled loops", needs="a scenario with `control`")
    for effect in effects:
        check_sensor(effect, problem.law.robot.n)
    return dataclasses.replace(problem, effects=(*problem.effects, *effects))


def _with_reference(problem: Problem, events: Sequence[AbstractReferenceEvent]) -> Problem:
    """Return the problem with further motions: each begins where the reference is by then."""
    times = {e.time for e in problem.events if e.motion is not None} - {0.0}
    for event in events:
        if not 0 <= event.at < problem.duration or event.at in times:
            needs = f"from 0 to before the end, {problem.duration:g} s, when no other motion begins"
            raise ValueRangeError("a motion of the reference", got=f"at {event.at:g} s", needs=needs)
        times.add(event.at)
        check_motion(event, problem.home)
    return dataclasses.replace(problem, events=with_motions(problem.events, events))
