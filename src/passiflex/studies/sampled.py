"""The sampled world: the tasks of Figs. 1 and 2 at 1 kHz on a robot with real sensors and motors."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.diagrams import Viewed
from passiflex.files import require_writable
from passiflex.metrics.msd import IdealResponse
from passiflex.metrics.numbers import rms
from passiflex.metrics.steps import displacement, step_window
from passiflex.passivity import Audit, audit, port_tank
from passiflex.plotting.figures import save_figure
from passiflex.plotting.sampled import SampledPanel, draw_sampled
from passiflex.reports import write_report
from passiflex.scenarios.environment import Drag
from passiflex.scenarios.law_settings import ImpedanceSettings
from passiflex.scenarios.motor_settings import MotorSettings
from passiflex.scenarios.reference import Circle
from passiflex.scenarios.tank_settings import TankSettings
from passiflex.simulation import Problem, Run, Scenario, resolve, simulate_problem
from passiflex.studies.external_torque import external_torque_table
from passiflex.studies.paper import Report, ideals, shipped_scenario
from passiflex.studies.summary import SETTLED_CIRCLE, plain, response_numbers

TASKS = ("fig1", "fig2")
DRAG = Drag.model_validate({"kind": "drag", "from": 0.0, "to": 1.0, "viscous": 5.0, "dry": 2.0})
"""What a polishing end effector feels; its times are set by the task."""
SAVED = 5
"""One of so many rows is written to the file of a run that reached its end."""


class Variant(NamedTuple):
    """One way of running a task: its title, and what it makes of the shipped sampled scenario."""

    title: str
    change: Callable[[Scenario], Scenario]


def _changed(scenario: Scenario, **parts: Any) -> Scenario:
    return scenario.model_copy(update=parts)


def _paper_gains(scenario: Scenario, tank: str, motors: MotorSettings) -> Scenario:
    """Return the scenario with the paper's gains and inner loop, a tank of another kind, and these motors."""
    printed = shipped_scenario(scenario.name.removesuffix("_sampled")).law
    assert isinstance(printed, ImpedanceSettings)
    assert scenario.control is not None
    control = _changed_section(
        scenario.control, inner_loop="plain", external_torque="measured", allow_unstable=True
    )
    tank_settings = TankSettings.model_validate({"kind": tank, "initial": 2.0}).completed("port")
    return _changed(scenario, law=printed, control=control, tank=tank_settings, motors=motors)


def _changed_section(section: Any, **parts: Any) -> Any:
    return section.model_copy(update=parts)


def _with_drag(scenario: Scenario) -> Scenario:
    """Return the scenario with a drag from the middle of the circle's first turns to the end."""
    start = next((e.at for e in scenario.reference if isinstance(e, Circle)), 0.0)
    drag = _changed_section(DRAG, start=start, end=scenario.duration)
    return _changed(scenario, environment=(drag,))


LIMITED = MotorSettings(torque_limit="robot")
VARIANTS: dict[str, Variant] = {
    "paper": Variant(
        "paper's gains and tank", lambda s: _paper_gains(s, "paper", MotorSettings(torque_limit="none"))
    ),
    "paper_limited": Variant(
        "paper's gains and tank,\ntorque limits", lambda s: _paper_gains(s, "paper", LIMITED)
    ),
    "paper_port": Variant(
        "paper's gains, port tank,\nlimits, fallback", lambda s: _paper_gains(s, "port", LIMITED)
    ),
    "recommended": Variant("recommended gains,\nport tank", lambda s: s),
    "recommended_drag": Variant("recommended gains,\nport tank, drag", _with_drag),
}

PAGES = {"fig1": ("recommended", "paper_limited"), "fig2": ("recommended_drag", "recommended")}
"""What the page of a task shows, and what beside it."""


@dataclass(frozen=True, eq=False)
class SampledCase:
    """One task run one way.

    Attributes
    ----------
    name: As in `summary.json`: fig1_sampled_paper, ...
    scenario, run, audit: What was run, what came out, what it means.
    ideal: The ideal mass-spring-damper at the run's instants.
    """

    name: str
    variant: Variant
    scenario: Scenario
    run: Run
    audit: Audit
    ideal: IdealResponse


def sampled_cases(task: str, report: Report = lambda text: None) -> Iterator[SampledCase]:
    """Yield the cases of fig1 or fig2; the drag is for the circle only, where the reference has to pay for it."""
    shipped = shipped_scenario(f"{task}_sampled")
    for key, variant in VARIANTS.items():
        if key == "recommended_drag" and task == "fig1":
            continue
        scenario = variant.change(shipped)
        name = f"{shipped.name}_{key}"
        report(f"{shipped.name}: {variant.title.replace(chr(10), ' ')}")
        problem = resolve(_changed(scenario, name=name))
        run = simulate_problem(problem)
        ideal = ideals(problem, _instants(problem))["msd"]
        yield SampledCase(name, variant, scenario, run, audit(run), ideal)


def _instants(problem: Problem) -> NDArray[np.float64]:
    """Return all instants that a whole run of the problem has rows at."""
    count = int(problem.duration / problem.output_interval + 1e-9)
    return np.arange(count + 1, dtype=np.float64) * problem.output_interval


def summarise_sampled(case: SampledCase) -> dict[str, Any]:
    """Return the numbers of one case, ready for JSON."""
    run, result = case.run, case.audit
    latched = np.flatnonzero(run["latched"] > 0)
    numbers: dict[str, Any] = {
        "motor_torque_peak": np.abs(run["tau_m"]).max(),
        "lowest_true_level": result.margin,
        "overdraft": result.overdraft,
        "lowest_claimed_level": run["lowest_level"].min(),
        "highest_claimed_level": run["tank_energy"].max(),
        "claimed_beyond_true": result.books_error,
        "governed_share": run["governed_time"][-1] / run.time[-1],
        "latched_at": run.time[latched[0]] if latched.size else math.nan,
        "verdict": result.verdict,
        "decided_at": result.time,
        "integration_error": result.integration_error,
        "failure": run.failure,
    }
    return plain(_distance(case) | numbers)


def _distance(case: SampledCase) -> dict[str, float]:
    """Return the distance to the ideal after the step, or to the circle's reference once it has settled."""
    run, scenario = case.run, case.scenario
    circle = next((e for e in scenario.reference if isinstance(e, Circle)), None)
    if run.failure:
        return {"reference_rms" if circle else "rms_to_msd": math.nan}
    if circle:
        late = run.time >= circle.at + SETTLED_CIRCLE
        error = (run["position"] - run["desired_position"])[late, 1:]
        return {"reference_rms": rms(np.linalg.norm(error, axis=1))}
    window = step_window(scenario)
    assert window is not None
    return response_numbers(run.time, displacement(run["position"]), case.ideal, window)


def reproduce_sampled(folder: Path, report: Report = lambda text: None) -> tuple[list[Path], dict[str, Any]]:
    """Run the study, write its figure and runs into `folder`; return the paths, and the part of the summary."""
    require_writable(folder)
    written: list[Path] = []
    summary: dict[str, Any] = {}
    panels: dict[str, list[SampledPanel]] = {task: [] for task in TASKS}
    for task in TASKS:
        shown: dict[str, Viewed] = {}
        for case in sampled_cases(task, report):
            summary[case.name] = summarise_sampled(case)
            panels[task].append(_panel(case))
            kept = case.run if case.run.failure else case.run.every(SAVED)
            written.append(kept.save(folder / f"{case.name}.nc"))
            shown[case.name.removeprefix(f"{task}_sampled_")] = Viewed(
                case.run, case.variant.title.replace("\n", " ")
            )
        first, *others = (shown[key] for key in PAGES[task])
        written.append(write_report(first.run, folder / f"{task}_sampled.html", others))
    summary["external_torque"] = external_torque_table(report)
    report("sampled: drawing")
    paths = save_figure(draw_sampled(list(panels.values()), CONDITIONS), folder / "sampled")
    return [*paths, *written], summary


def _panel(case: SampledCase) -> SampledPanel:
    run = case.run
    circle = any(isinstance(e, Circle) for e in case.scenario.reference)
    start = run["position"][0]
    return SampledPanel(
        title=case.variant.title,
        verdict=f"{case.audit.verdict}"
        + (f", {case.audit.overdraft:.3g} J too much" if case.audit.overdraft else ""),
        time=run.time,
        motion=run["position"][:, 2] - start[2],
        goal=run["desired_position"][:, 2] - start[2]
        if circle
        else case.ideal.displacement[: run.time.size, 2],
        goal_name="reference" if circle else "msd",
        claimed=run["tank_energy"],
        true=port_tank(run),
        governed=np.diff(run["governed_time"], prepend=0.0) > 0,
        latched=run["latched"] > 0,
    )


CONDITIONS = (
    "iiwa14 at 1 kHz, each command one period late; q to 0.01°, θ to 0.0001°, velocities from differences (200 Hz), "
    "noise 0.2 (N m)² on τ_a\n"
    "paper's gains: K_e = 10 K, B_e = 0.01 B, continuous law at the samples; recommended: K_e = K, "
    "B_e of each joint by recommend for ±20 %, matched inner loop\n"
    "drag: 5 N s/m and 2 N against the end effector's motion from 7 s on"
)
