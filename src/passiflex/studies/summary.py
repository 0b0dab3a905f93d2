"""The numbers of `summary.json`."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.passivity import audit, claimed_balance
from passiflex.simulation import Run, Scenario
from passiflex.simulation.scenario import Circle, Step
from passiflex.studies.metrics import largest_rise, overshoot, rms, settling_time
from passiflex.studies.msd import IdealResponse
from passiflex.studies.paper import Case

Array = NDArray[np.float64]

SETTLED_CIRCLE = 4.0
"""The circle is judged from this long after its beginning [s], as its start is a transient."""


class StepWindow(NamedTuple):
    """The step of a scenario: size [m] along z, and the time in which it is looked at [s]."""

    size: float
    begin: float
    end: float


def step_window(scenario: Scenario) -> StepWindow:
    """Return the first step of a scenario, until the next event of any kind."""
    step = next(e for e in scenario.reference if isinstance(e, Step))
    times = [e.at for e in scenario.reference] + [t for f in scenario.forces for t in (f.start, f.end)]
    return StepWindow(step.by[2], step.at, min([t for t in times if t > step.at] + [scenario.duration]))


def summarise(case: Case) -> dict[str, Any]:
    """Return the numbers of one case, ready for JSON: what is not finite is null."""
    turning = any(isinstance(e, Circle) for e in case.scenario.reference)
    numbers = _circle(case) if turning else _steps(case)
    return plain(numbers)


def displacement(run: Run) -> Array:
    """Return the end effector's motion since the start, (N, 3) m."""
    position = run["position"]
    return position - position[0]


def step_numbers(time: Array, motion: Array, ideal: IdealResponse, window: StepWindow) -> dict[str, float]:
    """Return overshoot, settling time, peak in y and distance to the ideal of one response (N, 3) m."""
    start = max(int(np.searchsorted(time, window.begin)) - 1, 0)
    z = motion[:, 2] - motion[start, 2]  # from where the step finds the robot
    inside = (time >= window.begin) & (time < window.end)
    return {
        "overshoot": overshoot(time, z, window.size, window.begin, window.end),
        "settling_time": settling_time(time, z, window.size, window.begin, window.end),
        "peak_y": float(np.abs(motion[time >= window.end, 1]).max(initial=0.0)),
        "offset_before_step": motion[start, 2],
        "rms_to_msd": rms((z - ideal.displacement[: time.size, 2])[inside]) / abs(window.size),
    }


def _steps(case: Case) -> dict[str, Any]:
    window, ideal = step_window(case.scenario), case.msd["msd"]
    out: dict[str, Any] = {}
    for name, response in case.msd.items():
        out[name] = step_numbers(response.time, response.displacement, ideal, window) | {
            "verdict": "passive"
            if response.largest_rise <= 10 * response.ledger_residual + 1e-12
            else "violated",
            "ledger_residual": response.ledger_residual,
        }
    for name, run in case.runs.items():
        out[name] = step_numbers(run.time, displacement(run), ideal, window) | _audited(run)
        if name == "proposed":
            out[name] |= _effort(run)
    return out


def _circle(case: Case) -> dict[str, Any]:
    run = case.runs["proposed"]
    total = claimed_balance(run).total
    begin = next(e.at for e in case.scenario.reference if isinstance(e, Circle)) + SETTLED_CIRCLE
    error = (run["position"] - run["desired_position"])[run.time >= begin, 1:]
    return {
        "total_energy_start": total[0],
        "total_energy_end": total[-1],
        "total_energy_rise": largest_rise(total),
        "reference_rms": rms(np.linalg.norm(error, axis=1)),
        **_effort(run),
        **_audited(run),
    }


def _effort(run: Run) -> dict[str, float]:
    return {
        "tank_energy_end": run["tank_energy"][-1],
        "tank_energy_min": run["tank_energy"].min(),
        "supplied_energy": run["external_energy"][-1],
        "motor_torque_peak": np.abs(run["tau_m"]).max(),
        "joint_limit_margin": min(
            (run["q"] - run["lower_position_limit"]).min(), (run["upper_position_limit"] - run["q"]).min()
        ),
    }


def _audited(run: Run) -> dict[str, Any]:
    result = audit(run)
    return {
        "verdict": result.verdict,
        "ledger_residual": result.ledger_residual,
        "integration_error": result.integration_error,
        "margin": result.margin,
        "books_error": result.books_error,
        "decided_at": result.time,
        "decided_by": result.term,
    }


def plain(value: Any) -> Any:
    """Return the value ready for JSON: what is not finite is null."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, str):
        return value
    return float(value) if math.isfinite(value) else None
