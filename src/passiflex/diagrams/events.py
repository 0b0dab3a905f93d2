"""When something happened in a run: what its scenario asked for, and what governor and fallback did."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from passiflex.diagrams.panel import Array, Mark, Span
from passiflex.runs.run import Run
from passiflex.scenarios.environment import labelled
from passiflex.scenarios.scenario import Scenario

GOVERNED = ("reference", "stiffness")
"""What the governor may hold back; its share is the signal NAME_share."""
APART = 0.05
"""Two stretches of the governor that are less than this [s] apart are shown as one."""


def marks_of(run: Run) -> tuple[Mark, ...]:
    """Return the instants at which something happened, in the order of time: reference, forces, gains, fallback."""
    marks, scenario = [], run.scenario
    if scenario is not None:
        marks += [Mark(e.at, e.words()) for e in scenario.reference]
        marks += [Mark(s.start, s.label) for s in _forces(scenario)]
        marks += [Mark(g.at, "gains change") for g in scenario.gain_changes]
    marks += [Mark(s.start, s.label) for s in _fallback(run)]
    end = _end(run)
    return tuple(sorted((m for m in marks if m.time <= end), key=lambda m: m.time))


def spans_of(run: Run) -> tuple[Span, ...]:
    """Return the stretches in which a force acted, the reference was held back, or the law had fallen back."""
    scenario, end = run.scenario, _end(run)
    forces = _forces(scenario) if scenario is not None else []
    inside = [s._replace(end=min(s.end, end)) for s in forces if s.start < end]
    changing = scenario is None or scenario.gains_change
    return (*inside, *_governed(run, GOVERNED if changing else GOVERNED[:1]), *_fallback(run))


def _end(run: Run) -> float:
    return float(run.time[-1])


def _forces(scenario: Scenario) -> list[Span]:
    """Return what acts on the end effector, is held or exerted by it, for some time."""
    spans = []
    for f in scenario.forces:
        times = [t for acting in f.acting(scenario.duration) for t in acting[:2]]
        spans.append(Span(times[0], times[-1], f.words(), "force"))
    spans += [Span(f.start, f.end, "feed-forward wrench", "force") for f in scenario.feedforward]
    there = ((*entry.lasts, label) for label, entry in labelled(scenario.environment).items())
    return spans + [Span(*entry, "force") for entry in there if math.isfinite(entry[1])]


def _governed(run: Run, names: tuple[str, ...]) -> list[Span]:
    """Return when the reference or the stiffness was held back; each stretch lasts until the row after it.

    Parameters
    ----------
    names: What was to change at all: the share of a stiffness that stays as it is says nothing.
    """
    held = np.zeros(run.time.size, dtype=bool)
    for name in names:
        held |= _held_back(run, name)
    if "governed_time" in run.data:  # also between the rows of a thinned file
        held[1:] |= np.diff(run["governed_time"]) > 0
    joined: list[tuple[float, float]] = []
    for start, end in _stretches(run.time, held):
        if joined and start - joined[-1][1] < APART:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((start, end))
    return [Span(start, end, _what_was_held(run, names, start, end), "governor") for start, end in joined]


def _held_back(run: Run, name: str) -> NDArray[np.bool_]:
    share = f"{name}_share"
    return run[share] < 1 if share in run.data else np.zeros(run.time.size, dtype=bool)


def _what_was_held(run: Run, names: tuple[str, ...], start: float, end: float) -> str:
    inside = (run.time >= start) & (run.time <= end)
    found = [name for name in names if (_held_back(run, name) & inside).any()]
    return f"{' and '.join(found or GOVERNED[:1])} held back"


def _fallback(run: Run) -> list[Span]:
    if "latched" not in run.data or not (run["latched"] > 0).any():
        return []
    start = float(run.time[(run["latched"] > 0).argmax()])
    return [Span(start, _end(run), "fallen back", "fallback")]


def _stretches(time: Array, held: Array) -> list[tuple[float, float]]:
    """Return start and end [s] of each stretch of rows that are held."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]).astype(int)))
    ends = np.minimum(edges[1::2], time.size - 1)
    return [(float(time[i]), float(time[j])) for i, j in zip(edges[::2], ends, strict=True)]
