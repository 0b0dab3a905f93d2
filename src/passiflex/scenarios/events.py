"""The kinds of events of a reference that a scenario file may have, and what of them does not go together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from passiflex.scenarios.law_settings import AbstractLawSettings
from passiflex.scenarios.path import ViaPath
from passiflex.scenarios.reference import ZERO, AbstractReferenceEvent, Circle, Hold, Move, Step
from passiflex.scenarios.setpoint_rows import gain_mistake
from passiflex.scenarios.setpoints import Table

ReferenceEvent = Annotated[Step | Move | Circle | Hold | ViaPath | Table, Field(discriminator="kind")]
Found = list[tuple[tuple[str | int, ...], str]]
"""Mistakes, each with its place."""
NO_TURN = "a position task has no orientation; remove it"


def event_mistakes(
    events: Sequence[AbstractReferenceEvent], law: AbstractLawSettings | None, end: float, *, sampled: bool
) -> Found:
    """Return what of the events is out of order, or does not fit the law; `law` is None where it has mistakes."""
    found: Found = []
    for i, event in enumerate(events):
        got = f"got {event.at:g} s"
        if i and not event.at > events[i - 1].at:
            found.append(((i, "at"), f"needs to be later than the one before, {events[i - 1].at:g} s; {got}"))
        if not event.at < end:
            found.append(((i, "at"), f"needs to be earlier than the end, {end:g} s; {got}"))
        if law is not None and law.task == "position":
            found += [((i, *place), NO_TURN) for place in turning(event)]
        if isinstance(event, Table) and event.changes_gains and law is not None:
            if not sampled:
                found.append(
                    ((i, "table"), event.where("has gains, which need `control`; remove k.. and d.."))
                )
            if event.in_tool and any(k < 3 for k in law.stiffness.free):
                found.append(((i, "axes"), "a free translation is one of the world; remove axes: tool"))
            size = 3 if law.task == "position" else 6
            if mistake := gain_mistake(event.numbers, size, law.stiffness.free):
                found.append(((i, "table"), event.where(mistake)))
    return found


def turning(event: AbstractReferenceEvent) -> list[tuple[str | int, ...]]:
    """Return the entries of an event that turn the end effector."""
    if isinstance(event, ViaPath):
        return [("points", k, "turn") for k, point in enumerate(event.points) if point.turn != ZERO]
    if isinstance(event, Table):
        return [("table",)] if event.turns else []
    return [(name,) for name in ("turn", "turns") if getattr(event, name, ZERO) not in (ZERO, 0.0)]
