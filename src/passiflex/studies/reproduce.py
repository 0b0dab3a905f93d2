"""Reproduce the paper: run, draw, sum up, write."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.diagrams import Viewed
from passiflex.errors import NameUnknownError
from passiflex.files import require_writable, whole_file
from passiflex.metrics.steps import displacement
from passiflex.origin import package_version, source_commit
from passiflex.passivity import claimed_balance
from passiflex.plotting.figures import CircleColumn, Series, StepColumn, draw_circle, draw_steps, save_figure
from passiflex.reports import write_report
from passiflex.reports.viewer import read_viewer
from passiflex.robots import FlexibleJointRobot
from passiflex.scenarios.forces import Force
from passiflex.scenarios.law_settings import ImpedanceSettings
from passiflex.simulation import Scenario
from passiflex.studies.contact import reproduce_contact
from passiflex.studies.grip import reproduce_grip
from passiflex.studies.hands import reproduce_hands
from passiflex.studies.paper import FIGURES, Case, Report, figure_cases
from passiflex.studies.policy import reproduce_policy
from passiflex.studies.polishing import reproduce_polishing
from passiflex.studies.sampled import reproduce_sampled
from passiflex.studies.summary import summarise
from passiflex.studies.uncertainty import reproduce_uncertainty
from passiflex.studies.walls import reproduce_walls
from passiflex.studies.written import Written

STUDIES: dict[str, Callable[[Path, Report], Written]] = {
    "contact": reproduce_contact,
    "grip": reproduce_grip,
    "hands": reproduce_hands,
    "policy": reproduce_policy,
    "polishing": reproduce_polishing,
    "sampled": reproduce_sampled,
    "uncertainty": reproduce_uncertainty,
    "walls": reproduce_walls,
}
"""Studies beyond the paper's figures: each writes its figure and pages into a folder, and returns its numbers."""
TITLES = {
    "robot": "gravity: the robot's own compensation\n(as in the paper)",
    "static": "gravity in plant and law\n(static compensation by the law's model)",
}


def reproduce(
    figures: Sequence[str], folder: Path, report: Report = lambda text: None
) -> dict[str, list[Path]]:
    """Run the given figures, and return what was written into `folder`, by figure.

    The paper's three if none is given; those of `STUDIES` are ours.

    Each figure gives a PNG, a PDF, its runs as netCDF and a page to look at one of them; all give their part
    of `summary.json`, which keeps what earlier calls wrote about other figures of the same version.

    Raises
    ------
    NameUnknownError
        For a figure that there is not.
    """
    for name in figures:
        if name not in (*FIGURES, *STUDIES):
            raise NameUnknownError("figure", name, (*FIGURES, *STUDIES))
    require_writable(folder)
    read_viewer()  # better missed before the work than after
    written: dict[str, list[Path]] = {}
    summary: dict[str, Any] = {}
    for name in figures or FIGURES:
        if name in STUDIES:
            written[name], numbers = STUDIES[name](folder, report)
            summary |= numbers
            continue
        cases = list(figure_cases(name, report))
        summary |= {case.name: summarise(case) for case in cases}
        report(f"{name}: drawing and writing")
        drawing = _draw(name, [case for case in cases if not case.name.endswith("noise_free")])
        written[name] = [*save_figure(drawing, folder / name), _write_page(name, cases[0], folder)]
        for case in cases:
            for law, run in case.runs.items():
                written[name].append(run.save(folder / f"{case.name}_{law}.nc"))
    written["summary"] = [_write_summary(folder / "summary.json", summary)]
    return written


def _write_page(name: str, case: Case, folder: Path) -> Path:
    """Write the page on the proposed law's run, with the others beside it."""
    proposed, *others = (Viewed(run, law.replace("_", " ")) for law, run in case.runs.items())
    return write_report(proposed.run, folder / f"{name}.html", others)


def conditions(scenario: Scenario) -> str:
    """Return the conditions of a figure in a few lines, to stand beside it."""
    law, tank, robot = scenario.law, scenario.tank, FlexibleJointRobot.load(scenario.robot)
    assert isinstance(law, ImpedanceSettings)
    assert tank is not None
    angles = ", ".join(f"{a:g}" for a in scenario.posture)
    K, D = _common(robot.joint_stiffness), _common(robot.joint_damping)
    K_x, D_x = _common(np.diag(law.stiffness.full())), _common(np.diag(law.damping.full()))
    return (
        f"{scenario.robot}, q₀ = [{angles}] rad, K = {K} N m/rad{_assumed(robot, 'joint_stiffness')}, "
        f"D = {D} N m s/rad{_assumed(robot, 'joint_damping')}\n"
        f"K_e = {law.shaped_stiffness.ratio:g} K, B_e = {law.shaped_inertia.ratio:g} B, "
        f"k_ns = {law.null_space_damping:g} 1/s, K_x = {K_x}, D_x = {D_x} (SI, all directions), "
        f"tank {tank.initial:g} J, {tank.accounting} accounting\n"
        f"{_task(scenario)}"
    )


def _task(scenario: Scenario) -> str:
    """Return what reference and forces do, in words."""
    words = [said for e in scenario.reference if (said := e.in_full())]
    words += [
        f"force {list(f.force)} N from {f.start:g} s to {f.end:g} s"
        for f in scenario.forces
        if isinstance(f, Force)
    ]
    errors = {k.replace("_", " "): v for k, v in scenario.model_errors.model_dump().items() if v}
    if errors:
        words.append("law's model: " + ", ".join(f"{k} {v:+.0%}" for k, v in errors.items()))
    if scenario.noise:
        n = scenario.noise
        words.append(f"noise on τ_a: {n.torque_variance:g} (N m)², held {n.hold:g} s, seed {scenario.seed}")
    return textwrap.fill("; ".join(words), 130)


def _assumed(robot: FlexibleJointRobot, name: str) -> str:
    return " (assumed)" if robot.sources[name].startswith("assumed") else ""


def _common(values: NDArray[np.float64]) -> str:
    return f"{values[0]:g}" if np.ptp(values) == 0 else ", ".join(f"{v:g}" for v in values)


def _draw(name: str, cases: list[Case]) -> Any:
    text = conditions(cases[0].scenario)
    if name == "fig2":
        return draw_circle([_circle_column(case) for case in cases], text)
    return draw_steps([_step_column(case) for case in cases], text)


def _title(case: Case) -> str:
    return TITLES[case.scenario.law.gravity]


def _step_column(case: Case) -> StepColumn:
    curves = {name: Series(run.time, displacement(run["position"])) for name, run in case.runs.items()}
    curves |= {name: Series(r.time, r.displacement) for name, r in case.msd.items()}
    return StepColumn(_title(case), curves)


def _circle_column(case: Case) -> CircleColumn:
    run = case.runs["proposed"]
    total = claimed_balance(run).total
    return CircleColumn(
        title=_title(case),
        time=run.time,
        position=run["position"],
        reference=run["desired_position"],
        energies={"total": total, "robot": total - run["tank_energy"], "tank": run["tank_energy"]},
        joints=run["q"],
    )


def _write_summary(path: Path, cases: dict[str, Any]) -> Path:
    source = {"version": package_version(), "commit": source_commit()}
    kept: dict[str, Any] = {}
    try:
        earlier = json.loads(path.read_text(encoding="utf-8"))
        kept = earlier if earlier.get("source") == source else {}
    except (OSError, ValueError, AttributeError):
        pass
    everything = {"source": source, **{k: v for k, v in kept.items() if k != "source"}, **cases}
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(everything, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return path
