"""What is measured of each sample: verdict, energies at the ports, effort, and the response."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.control.gain_design import target_inertia
from passiflex.metrics.closed_form import ideal_displacement
from passiflex.metrics.contact import contact_numbers, surfaces_of
from passiflex.metrics.numbers import rms
from passiflex.metrics.steps import StepWindow, displacement, step_numbers
from passiflex.passivity import Audit, audit
from passiflex.passivity.ledger import Signals
from passiflex.problems.problem import Problem, SampledProblem

Array = NDArray[np.float64]

IDEAL_RATIO = 0.7
"""ζ of the ideal mass-spring-damper, which gives it its mass."""


class Measure(NamedTuple):
    """One number of a sample: its unit, which end is the bad one, and what it says."""

    unit: str
    worst: Literal["low", "high"]
    meaning: str


ENERGIES = {
    "external_energy": "that the environment gave",
    "motor_energy": "that the motors gave",
    "joint_energy": "that went to the links through the joints",
    "reference_energy": "that the moving reference put into the Cartesian spring",
}
MEASURES = {
    "margin": Measure("J", "low", "least of what law and motors may still give to the links"),
    "overdraft": Measure("J", "high", "largest energy given beyond what was there"),
    "decided_at": Measure("s", "low", "when the verdict was decided"),
    "claimed_beyond_true": Measure(
        "J",
        "high",
        "most that the tank claims beyond what is there; in continuous time, error of the law's books",
    ),
    "measurement_bound": Measure(
        "J",
        "high",
        "at the end, most that the tank may claim beyond what is there; not finite without control",
    ),
    "integration_error": Measure("J", "high", "largest residual of the links' balance"),
    **{name: Measure("J", "high", f"at the end, {text}") for name, text in ENERGIES.items()},
    "tank_energy_end": Measure("J", "low", "level of the tank at the end"),
    "tank_energy_min": Measure("J", "low", "lowest recorded level of the tank"),
    "governed_share": Measure("1", "high", "share of the time in which the reference was held back"),
    "fell_back_at": Measure("s", "low", "when the fallback took over; not finite if it did not"),
    "torque_peak": Measure("N m", "high", "largest motor torque"),
    "torque_share": Measure("1", "high", "the same as a share of the joint's limit"),
    "velocity_share": Measure("1", "high", "largest link velocity as a share of the joint's limit"),
    "joint_limit_margin": Measure("rad", "low", "least distance to the end of a joint's range"),
    "contact_force_peak": Measure("N", "high", "largest force of a surface on the hand"),
    "contact_impulse": Measure("N s", "high", "force of the surfaces over time, whatever its direction"),
    "contact_energy": Measure("J", "high", "most energy that the surfaces had had from the hand"),
    "contact_bounces": Measure("1", "high", "how often the hand left a surface"),
    "tracking_rms": Measure("m", "high", "distance of the end effector from x_d"),
    "overshoot": Measure("1", "high", "beyond the step, as a share of it"),
    "settling_time": Measure("s", "high", "until the response stays within 2 % of the step"),
    "offset_before_step": Measure("m", "high", "motion along the step before it, without its sign"),
    "rms_to_msd": Measure(
        "1",
        "high",
        "distance to the ideal mass-spring-damper, as a share of the step; of a hand that nothing touches",
    ),
    "end_time": Measure("s", "low", "simulated time; shorter than the duration if the run ended early"),
}
"""What can be kept and asked for, by name."""
OF_CONTACT = tuple(name for name in MEASURES if name.startswith("contact_"))
"""Those of a scenario with surfaces."""


def with_unit(measure: str) -> str:
    """Return the name of a measure as people read it, with its unit."""
    unit = MEASURES[measure].unit
    return measure.replace("_", " ") + ("" if unit == "1" else f" [{unit}]")


SIGNALS = (
    "position", "desired_position", "q", "dq", "tau_m",
    "link_kinetic_energy", "motor_kinetic_energy", "joint_spring_energy", "potential_energy",
    "external_energy", "motor_energy", "joint_energy", "joint_loss_energy", "friction_energy", "reference_energy",
    "external_power", "motor_power", "joint_power", "joint_loss_power", "friction_power",
    "tank_energy", "law_storage", "measured_port_energy", "spilled_energy",
    "carried_energy", "compensated_energy", "shaped_kinetic_energy", "shaped_spring_energy", "cartesian_spring_energy",
    "gravity_storage", "governed_time", "latched", "read_time", "measurement_bound",
)  # fmt: skip
"""What is recorded of a sampled run for it, beside `contact_signals`."""


def measures(
    problem: Problem, window: StepWindow | None, run: Signals, audited: Audit | None = None
) -> dict[str, float | str]:
    """Return verdict, what decided it, why the run failed, and the numbers of `MEASURES`; of contact with surfaces.

    `audited` is the run's audit, if it has been made already.
    """
    result, robot, end = audited or audit(run), problem.law.robot, run.time[-1]
    torque = _reached(run, "highest_torque", np.abs(run["tau_m"]).max(axis=0))
    speed = _reached(run, "highest_speed", np.abs(run["dq"]).max(axis=0))
    lowest, highest = (
        _reached(run, "lowest_q", run["q"].min(axis=0)),
        _reached(run, "highest_q", run["q"].max(axis=0)),
    )
    low, high = robot.position_limit.T
    numbers: dict[str, float | str] = {
        "verdict": result.verdict,
        "decided_by": result.term,
        "failure": run.failure,
        "margin": result.margin,
        "overdraft": result.overdraft,
        "decided_at": result.time,
        "claimed_beyond_true": result.books_error,
        "measurement_bound": run["measurement_bound"][-1] if run.sampled else math.nan,
        "integration_error": result.integration_error,
        **{name: run[name][-1] for name in ENERGIES},
        "tank_energy_end": run["tank_energy"][-1] if run.has_tank else math.nan,
        "tank_energy_min": run["tank_energy"].min() if run.has_tank else math.nan,
        **_governor(run),
        "torque_peak": torque.max(),
        "torque_share": (torque / robot.torque_limit).max(),
        "velocity_share": (speed / robot.velocity_limit).max(),
        "joint_limit_margin": min((lowest - low).min(), (high - highest).min()),
        **contact_numbers(surfaces_of(problem), run),
        "tracking_rms": rms(np.linalg.norm(run["position"] - run["desired_position"], axis=1)),
        **_response(problem, window, run),
        "end_time": end,
    }
    return {name: v if isinstance(v, str) else float(v) for name, v in numbers.items()}


def _reached(run: Signals, noted: str, rows: Array) -> Array:
    """Return how far each joint went (n,): as the loop noted it, or else by the rows."""
    try:
        return run[noted]
    except KeyError:
        return rows


def _governor(run: Signals) -> dict[str, float]:
    if not run.sampled:
        return {"governed_share": math.nan, "fell_back_at": math.nan}
    latched, end = run["latched"] > 0, run.time[-1]
    fell = _reached(run, "fallback_time", np.array(run.time[latched.argmax()] if latched.any() else np.inf))
    return {
        "governed_share": run["governed_time"][-1] / end if end else 0.0,
        "fell_back_at": float(fell) if np.isfinite(fell) else math.nan,
    }


def _response(problem: Problem, window: StepWindow | None, run: Signals) -> dict[str, float]:
    """Return the numbers of the step; not finite where there is none, and a run that ended early did not settle."""
    if window is None or run.failure:
        missing = dict.fromkeys(("overshoot", "offset_before_step", "rms_to_msd"), math.nan)
        return missing | {"settling_time": math.nan if window is None else math.inf}
    moved = displacement(run["position"])
    numbers = step_numbers(run.time, moved, _ideal(problem, len(run.time)), window)
    numbers["offset_before_step"] = abs(numbers["offset_before_step"])
    changing = isinstance(problem, SampledProblem) and problem.gain_changes
    touched = any(e.acts and e.books.outside for e in problem.elements)  # which the ideal knows nothing of
    return numbers | ({"rms_to_msd": math.nan} if changing or touched else {})


MOST_IDEALS = 64
_ideals: dict[tuple[object, ...], Array] = {}


def _ideal(problem: Problem, count: int) -> Array:
    """Return the ideal's displacement at the rows of a run; samples that differ in the robot only share it."""
    gains = problem.law.layout.unpack(problem.gains)
    stiffness, damping = gains["stiffness"], gains["damping"]
    inertia = target_inertia(stiffness, damping, IDEAL_RATIO)
    moving = [e for e in problem.events if e.motion is not None]
    key = (
        inertia.tobytes(), stiffness.tobytes(), damping.tobytes(), problem.output_interval, count,
        *((e.time, e.motion is not None, e.F_e.tobytes()) for e in problem.events),
        *(np.asarray(v).tobytes() for e in moving if e.motion for v in e.motion.values()),
    )  # fmt: skip
    found = _ideals.get(key)  # another thread may forget it in the meantime
    if found is None:
        found = ideal_displacement(
            inertia, stiffness, damping, problem.events, problem.output_interval, count
        )
        if len(_ideals) >= MOST_IDEALS:
            _ideals.clear()
        _ideals[key] = found
    return found
