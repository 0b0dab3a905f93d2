"""How the conclusions move with what the paper does not print: posture, K, D, link model, circle."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from passiflex.files import require_writable, whole_file
from passiflex.metrics.msd import ideal_response
from passiflex.metrics.numbers import largest_rise
from passiflex.metrics.steps import displacement, step_numbers, step_window
from passiflex.passivity import audit, claimed_balance
from passiflex.plotting.figures import save_figure
from passiflex.plotting.sensitivity import Sweep, draw_sensitivity
from passiflex.robots import FlexibleJointRobot
from passiflex.scenarios.reference import Circle
from passiflex.simulation import Scenario, resolve, simulate_problem
from passiflex.studies.paper import TARGET_RATIO, Report, shipped_scenario, with_baseline

POSTURES = {
    "chosen": (0.0, 0.6, 0.0, -1.2, 0.0, 1.0, 0.0),
    "low": (0.0, 1.0, 0.0, -1.2, 0.0, 0.9, 0.0),
    "far": (0.0, 0.9, 0.0, -0.7, 0.0, 0.6, 0.0),
    "near": (0.0, 0.3, 0.0, -1.8, 0.0, 1.0, 0.0),
    "turned": (0.5, 0.6, -0.6, -1.3, 0.4, 1.1, 0.3),
}
STIFFNESSES = (4_000.0, 7_000.0, 10_000.0, 15_000.0)
DAMPINGS = (1.0, 2.0, 5.0, 10.0)
LINK_MODELS = ("iiwa14", "iiwa14_stuerz")
CIRCLES = ((0.05, 4.0), (0.10, 8.0), (0.10, 4.0), (0.10, 3.0), (0.15, 4.0))


class Variant(NamedTuple):
    """One point of a sweep: its label, its scenario, and the robot in its place."""

    sweep: str
    label: str
    scenario: Scenario
    robot: FlexibleJointRobot


def run_sensitivity(folder: Path, report: Report = lambda text: None) -> list[Path]:
    """Run all sweeps, write sensitivity.png, .pdf and .json into `folder`, and return the paths."""
    require_writable(folder)
    steps = _collect(step_variants(), _step_point, report)
    circles = _collect(circle_variants(), _circle_point, report)
    paths = save_figure(draw_sensitivity(steps, circles), folder / "sensitivity")
    numbers = {s.name: dict(zip(s.labels, _rows(s), strict=True)) for s in steps + circles}
    with whole_file(folder / "sensitivity.json") as temporary:
        temporary.write_text(json.dumps(numbers, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return [*paths, folder / "sensitivity.json"]


def step_variants() -> Iterator[Variant]:
    """Yield Fig. 1 with another posture, K, D and link model in turn."""
    base = shipped_scenario("fig1")
    base = base.model_copy(update={"duration": 22.0})
    robot = FlexibleJointRobot.load(base.robot)
    for label, posture in POSTURES.items():
        yield Variant("posture", label, base.model_copy(update={"posture": posture}), robot)
    for K in STIFFNESSES:
        other = dataclasses.replace(robot, joint_stiffness=np.full(robot.n, K))
        yield Variant("K [N m/rad]", f"{K:g}", base, other)
    for D in DAMPINGS:
        other = dataclasses.replace(robot, joint_damping=np.full(robot.n, D))
        yield Variant("D [N m s/rad]", f"{D:g}", base, other)
    for name in LINK_MODELS:
        yield Variant("link model", name.removeprefix("iiwa14_"), base, FlexibleJointRobot.load(name))


def circle_variants() -> Iterator[Variant]:
    """Yield Fig. 2 with other circles and other postures."""
    base = shipped_scenario("fig2")
    robot = FlexibleJointRobot.load(base.robot)
    for radius, period in CIRCLES:
        reference = tuple(
            e.model_copy(update={"radius": radius, "period": period}) if isinstance(e, Circle) else e
            for e in base.reference
        )
        label = f"{radius:g} m\n{period:g} s"
        yield Variant("circle", label, base.model_copy(update={"reference": reference}), robot)
    for label, posture in POSTURES.items():
        yield Variant("posture (circle)", label, base.model_copy(update={"posture": posture}), robot)


def _collect(
    variants: Iterator[Variant], measure: Callable[[Variant], dict[str, float]], report: Report
) -> list[Sweep]:
    sweeps: dict[str, Sweep] = {}
    for v in variants:
        report(f"sensitivity: {v.sweep} {v.label}".replace("\n", ", "))
        point = measure(v)
        sweep = sweeps.setdefault(v.sweep, Sweep(v.sweep, [], {name: [] for name in point}))
        sweep.labels.append(v.label)
        for name, value in point.items():
            sweep.values[name].append(value)
    return list(sweeps.values())


def _step_point(v: Variant) -> dict[str, float]:
    from passiflex.control.gain_design import target_inertia

    problem = resolve(v.scenario, v.robot)
    proposed = simulate_problem(problem)
    baseline = simulate_problem(resolve(with_baseline(v.scenario, motor_aware=False), v.robot))
    gains = problem.law.layout.unpack(problem.gains)
    inertia = target_inertia(gains["stiffness"], gains["damping"], TARGET_RATIO)
    ideal = ideal_response(inertia, gains["stiffness"], gains["damping"], problem.events, proposed.time)
    window = step_window(v.scenario)
    assert window is not None
    point = {}
    for name, run in (("proposed", proposed), ("baseline", baseline)):
        numbers = step_numbers(run.time, displacement(run["position"]), ideal.displacement, window)
        for quantity in ("overshoot", "settling_time", "rms_to_msd"):
            point[f"{name} {quantity}"] = numbers[quantity]
    point["margin"] = audit(proposed).margin
    return point


def _circle_point(v: Variant) -> dict[str, float]:
    run = simulate_problem(resolve(v.scenario, v.robot))
    return {
        "tank_energy_min": float(run["tank_energy"].min()),
        "total_energy_rise": largest_rise(claimed_balance(run).total),
        "margin": audit(run).margin,
    }


def _rows(sweep: Sweep) -> list[dict[str, float | None]]:
    return [
        {name: values[i] if math.isfinite(values[i]) else None for name, values in sweep.values.items()}
        for i in range(len(sweep.labels))
    ]
