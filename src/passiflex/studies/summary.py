"""The numbers of `summary.json`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.metrics.msd import IdealResponse
from passiflex.metrics.numbers import largest_rise, rms
from passiflex.metrics.steps import StepWindow, displacement, step_numbers, step_window
from passiflex.passivity import audit, claimed_balance
from passiflex.scenarios.reference import Circle
from passiflex.simulation import Run
from passiflex.studies.paper import Case

Array = NDArray[np.float64]

SETTLED_CIRCLE = 4.0
"""The circle is judged from this long after its beginning [s], as its start is a transient."""


def summarise(case: Case) -> dict[str, Any]:
    """Return the numbers of one case, ready for JSON: what is not finite is null."""
    turning = any(isinstance(e, Circle) for e in case.scenario.reference)
    numbers = _circle(case) if turning else _steps(case)
    return plain(numbers)


def response_numbers(
    time: Array, motion: Array, ideal: IdealResponse, window: StepWindow
) -> dict[str, float]:
    """Return the numbers of the step, and the peak in y of one response (N, 3) m after it."""
    peak = float(np.abs(motion[time >= window.end, 1]).max(initial=0.0))
    return step_numbers(time, motion, ideal.displacement, window) | {"peak_y": peak}


def _steps(case: Case) -> dict[str, Any]:
    window, ideal = step_window(case.scenario), case.msd["msd"]
    assert window is not None
    out: dict[str, Any] = {}
    for name, response in case.msd.items():
        out[name] = response_numbers(response.time, response.displacement, ideal, window) | {
            "verdict": "passive"
            if response.largest_rise <= 10 * response.ledger_residual + 1e-12
            else "violated",
            "ledger_residual": response.ledger_residual,
        }
    for name, run in case.runs.items():
        out[name] = response_numbers(run.time, displacement(run["position"]), ideal, window) | _audited(run)
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
