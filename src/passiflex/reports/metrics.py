"""The verdict on a run in a sentence, and the table of what was measured of all runs on a page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from passiflex.errors import PassiflexError
from passiflex.loops.witness import ROUND_OFF
from passiflex.metrics.measures import MEASURES, measures
from passiflex.metrics.steps import step_window
from passiflex.passivity import Audit, audit_if_possible
from passiflex.runs.run_arm import problem_of
from passiflex.simulation import Run

WORDS = {
    "verdict": "did law and motors ever give the links more than was there?",
    "decided_by": "what took most of the energy when the verdict was decided",
}
OF_JOINTS = {
    "torque_peak": "torque_limit",
    "joint_limit_margin": "lower_position_limit",
}
"""Measures of joint quantities, and the signal of the run that has their unit: joints turn or slide."""


def verdict_header(run: Run, result: Audit) -> dict[str, Any]:
    """Return the verdict with its evidence; times in s, energies in J."""
    worst = result.margin_time
    return {
        "verdict": result.verdict,
        "sentence": sentence(result, worst),
        "time": result.time,
        "margin": result.margin,
        "worst_time": worst,
        "term": result.term,
        "remedy": result.remedy if result.verdict == "violated" else "",  # otherwise the sentence has it
    }


def sentence(result: Audit, worst: float) -> str:
    """Return the verdict as a person would say it; the margin was least at the time `worst` [s]."""
    most = f"most of the energy went to: {result.term}"
    if result.verdict == "passive":
        return (
            "Passive: law and motors never gave the links more energy than there was. "
            f"The least that was left is {_joules(result.margin)}, at {result.time:.4g} s; by then {most}."
        )
    if result.verdict == "violated":
        return (
            f"Violated: first at {result.time:.4g} s, the links had been given more energy than there was, "
            f"{_joules(result.overdraft)} too much at {worst:.4g} s. When it began, {most}."
        )
    return f"Inconclusive: {result.remedy}. The least that was left is {_joules(result.margin)}, at {worst:.4g} s."


def _joules(energy: float) -> str:
    """Return an energy for a reader; what is round-off of 1 J is 0."""
    return f"{energy:.4g} J" if abs(energy) > ROUND_OFF else "0 J"


def metrics_header(
    runs: Sequence[Run], labels: Sequence[str], audits: Sequence[Audit | None] | None = None
) -> dict[str, Any]:
    """Return one row for each measure that any of the runs has; what is not there is null.

    `audits` are those of the runs, if they have been made already.
    """
    made = [audit_if_possible(run) for run in runs] if audits is None else audits
    columns = [_measured(run, result) for run, result in zip(runs, made, strict=True)]
    rows = []
    for name in (*WORDS, *MEASURES):
        values = [_shown(column.get(name, math.nan)) for column in columns]
        if any(value is not None for value in values):
            unit, meaning = (
                (_unit(name, runs[0]), MEASURES[name].meaning) if name in MEASURES else ("", WORDS[name])
            )
            rows.append({"name": name.replace("_", " "), "unit": unit, "meaning": meaning, "values": values})
    return {"columns": list(labels), "rows": rows}


def _measured(run: Run, result: Audit | None) -> dict[str, float | str]:
    """Return all measures; of a run that does not fit a robot of today, what its audit says.

    Where somebody's own part took part, no ideal and no step of the scenario is what it is to be held against.
    """
    if result is None:
        return {"end_time": float(run.time[-1])}
    scenario = run.scenario
    try:
        problem = None if scenario is None else problem_of(run, scenario)
        if (
            scenario is not None
            and problem is not None
            and problem.law.robot.n == run.data.sizes.get("joint")
        ):
            window = None if run.own_parts else step_window(scenario)
            return measures(problem, window, run, result)
    except (PassiflexError, KeyError):  # the robot's file is gone, or a signal is missing
        pass
    return {
        "verdict": result.verdict,
        "decided_by": result.term,
        "margin": result.margin,
        "overdraft": result.overdraft,
        "decided_at": result.time,
        "claimed_beyond_true": result.books_error,
        "integration_error": result.integration_error,
        "end_time": float(run.time[-1]),
    }


def _unit(name: str, run: Run) -> str:
    signal = OF_JOINTS.get(name)
    unit = run.data[signal].attrs.get("units") if signal in run.data else None
    unit = MEASURES[name].unit if unit is None else str(unit)
    return "" if unit == "1" else unit


def _shown(value: float | str) -> float | str | None:
    if isinstance(value, str):
        return value
    if math.isnan(value):
        return None
    return value if math.isfinite(value) else ("∞" if value > 0 else "−∞")
