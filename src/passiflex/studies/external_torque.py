"""What the choice of τ_e costs: the truth, a wrench sensor, a momentum observer, or nothing at all."""

from __future__ import annotations

from typing import Any

import numpy as np

from passiflex.metrics.numbers import rms
from passiflex.metrics.steps import displacement
from passiflex.passivity import audit
from passiflex.scenarios.control_settings import Control
from passiflex.scenarios.forces import Force
from passiflex.scenarios.gain_settings import ShapedInertia, ShapedStiffness
from passiflex.scenarios.law_settings import ImpedanceSettings
from passiflex.scenarios.sensor_settings import SensorSettings
from passiflex.simulation import Run, Scenario, resolve, simulate_problem
from passiflex.studies.paper import Report, shipped_scenario
from passiflex.studies.summary import plain

CHOICES: dict[str, dict[str, Any]] = {
    "true": {"external_torque": "true"},
    "measured_100_hz": {"external_torque": "measured"},
    "observer_100_hz": {"external_torque": "observer", "observer_bandwidth": 100.0},
    "observer_20_hz": {"external_torque": "observer", "observer_bandwidth": 20.0},
    "none": {"external_torque": "none"},
}
STIFFENING, LIGHTENING = 1.5, 0.3
"""K_e/K and B_e/B, stable at 1 kHz without delay. With K_e = K, K_F of (6) is zero, and τ_e is not used at all."""
PUSH = Force.model_validate({"from": 0.5, "to": 1.5, "force": [0, 20.0, 0]})
DURATION = 4.0


def external_torque_scenario(**control: Any) -> Scenario:
    """Return a push of 20 N on the sampled robot at rest, without noise, with this choice of τ_e."""
    scenario = shipped_scenario("fig1_sampled")
    assert isinstance(scenario.law, ImpedanceSettings)
    shaping = {
        "shaped_stiffness": ShapedStiffness(ratio=STIFFENING),
        "shaped_inertia": ShapedInertia(ratio=LIGHTENING),
    }
    changes: dict[str, Any] = {
        "name": f"external_torque_{control['external_torque']}",
        "law": scenario.law.model_copy(update=shaping),
        "control": Control(rate=1000.0, **control),
        "sensors": SensorSettings(wrench_bandwidth=100.0),
        "noise": None,
        "reference": (),
        "forces": (PUSH,),
        "duration": DURATION,
    }
    return scenario.model_copy(update=changes)


def external_torque_table(report: Report = lambda text: None) -> dict[str, dict[str, Any]]:
    """Return for each choice how far the pushed arm is from where it would be if the law knew τ_e, and the energies."""
    runs: dict[str, Run] = {}
    for name, choice in CHOICES.items():
        report(f"external torque: {name.replace('_', ' ')}")
        runs[name] = simulate_problem(resolve(external_torque_scenario(**choice)))
    known = displacement(runs["true"]["position"])[:, 1]
    return {name: plain(_numbers(run, known)) for name, run in runs.items()}


def _numbers(run: Run, known: np.ndarray) -> dict[str, Any]:
    moved, result = displacement(run["position"])[:, 1], audit(run)
    peak = np.abs(known).max()
    return {
        "peak_y": np.abs(moved).max(),
        "rms_to_known": rms(moved - known) / peak,
        "port_energy": run["joint_energy"][-1],
        "tank_energy_end": run["tank_energy"][-1],
        "margin": result.margin,
        "verdict": result.verdict,
    }
