"""The paper's three simulations: the proposed law, the baseline in both variants, and the ideal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from passiflex.control.gain_design import target_inertia
from passiflex.control.law import ImpedanceLaw
from passiflex.errors import NameUnknownError
from passiflex.metrics.msd import IdealResponse, ideal_response
from passiflex.problems.natural_inertia import natural_inertia
from passiflex.scenarios.gain_settings import TargetInertia
from passiflex.scenarios.law_settings import ImpedanceSettings, RigidSettings
from passiflex.simulation import Problem, Run, Scenario, parse_scenario, resolve, simulate_problem

FIGURES = ("fig1", "fig2", "fig3")
TARGET_RATIO = 0.7
"""ζ of the desired mass-spring-damper and of the baseline."""

Report = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Case:
    """One scenario with all that is drawn for it.

    Attributes
    ----------
    name: As in `summary.json`: fig1, fig1_static, fig3_noise_free, ...
    scenario: The proposed law's scenario.
    runs: `proposed`, and where compared `baseline` and `baseline_motor_aware`.
    msd: The ideal response, by the inertia: `msd` (3.40 kg for the paper's gains), `msd_natural` (Λ).
    """

    name: str
    scenario: Scenario
    runs: dict[str, Run]
    msd: dict[str, IdealResponse]


def shipped_scenario(name: str) -> Scenario:
    """Return a scenario of the package by name.

    Raises
    ------
    NameUnknownError
        If there is no such scenario.
    """
    folder = resources.files("passiflex.studies") / "scenarios"
    known = sorted(f.name.removesuffix(".yaml") for f in folder.iterdir() if f.name.endswith(".yaml"))
    if name not in known:
        raise NameUnknownError("scenario", name, known)
    return parse_scenario((folder / f"{name}.yaml").read_text(encoding="utf-8"), source=f"{name}.yaml")


def with_baseline(scenario: Scenario, *, motor_aware: bool) -> Scenario:
    """Return the scenario with the rigid baseline in place of the proposed law, gains alike."""
    law = scenario.law
    assert isinstance(law, ImpedanceSettings)
    rigid = RigidSettings(
        type="rigid",
        task=law.task,
        gravity="robot" if law.gravity == "robot" else "model",
        stiffness=law.stiffness,
        damping=law.damping,
        null_space_damping=law.null_space_damping,
        regularisation=law.regularisation,
        target_inertia=TargetInertia(damping_ratio=TARGET_RATIO),
        motor_inertia="carried" if motor_aware else "ignored",
    )
    suffix = "_baseline_motor_aware" if motor_aware else "_baseline"
    return scenario.model_copy(update={"name": scenario.name + suffix, "law": rigid, "tank": None})


def with_gravity(scenario: Scenario, gravity: str) -> Scenario:
    """Return the scenario with another gravity choice, and a name that says so."""
    law = scenario.law.model_copy(update={"gravity": gravity})
    return scenario.model_copy(update={"name": f"{scenario.name}_{gravity}", "law": law})


def without_noise(scenario: Scenario) -> Scenario:
    """Return the scenario without noise, and a name that says so."""
    return scenario.model_copy(update={"name": f"{scenario.name}_noise_free", "noise": None})


def run_case(scenario: Scenario, *, compared: bool, report: Report = lambda text: None) -> Case:
    """Run a scenario, and beside it the baselines (if `compared`) and the ideal."""
    report(f"{scenario.name}: proposed")
    problem = resolve(scenario)
    runs = {"proposed": simulate_problem(problem)}
    if compared:
        for name, aware in (("baseline", False), ("baseline_motor_aware", True)):
            report(f"{scenario.name}: {name.replace('_', ' ')}")
            runs[name] = simulate_problem(resolve(with_baseline(scenario, motor_aware=aware)))
    return Case(scenario.name, scenario, runs, ideals(problem, runs["proposed"].time))


def figure_cases(figure: str, report: Report = lambda text: None) -> Iterator[Case]:
    """Yield the cases of a figure: as in the paper, then with gravity in plant and law.

    Raises
    ------
    NameUnknownError
        If there is no such figure.
    """
    if figure not in FIGURES:
        raise NameUnknownError("figure", figure, FIGURES)
    scenario = shipped_scenario(figure)
    compared = figure != "fig2"
    variants = [scenario, with_gravity(scenario, "static")]
    if scenario.noise:
        variants.append(without_noise(scenario))
    for variant in variants:
        yield run_case(variant, compared=compared, report=report)


def ideals(problem: Problem, time: NDArray[np.float64]) -> dict[str, IdealResponse]:
    """Return the ideal responses, for 3.40 kg and for Λ(q₀), at instants that cover a problem's events."""
    assert isinstance(problem.law, ImpedanceLaw)
    gains = problem.law.layout.unpack(problem.gains)
    stiffness, damping = gains["stiffness"], gains["damping"]
    inertias = {
        "msd": target_inertia(stiffness, damping, TARGET_RATIO),
        "msd_natural": natural_inertia(problem),
    }
    return {
        name: ideal_response(inertia, stiffness, damping, problem.events, time)
        for name, inertia in inertias.items()
    }
