"""Scenarios of the planar arm; sampled ones one change away from a plain one: ideal sensors and motors, no delay."""

from __future__ import annotations

from typing import Any

import numpy as np
import yaml

from passiflex.runs.sound import NOTED
from passiflex.simulation import Run, Scenario, parse_scenario, simulate

PERIOD = 1e-3
PLAIN = """\
name: planar
robot: planar2r
posture: [0.5, 0.8]
law:
  type: impedance
  task: position
  gravity: robot
  shaped_stiffness: {ratio: 1}
  shaped_inertia: {ratio: 0.3}
  stiffness: {translation: 200}
  damping: {translation: 40}
control: {rate: 1000, external_torque: 'true'}
tank: {kind: port, initial: 2}
reference:
  - {at: 0.1, kind: step, by: [0, 0, 0.05]}
duration: 0.6
output_interval: 0.001
"""
"""At 1 kHz its loop is stable with K_e = K from 0.041 B on without delay, from 0.091 B on with one period."""
PLANAR = """\
name: planar
robot: planar2r
posture: [0.5, 0.8]
law:
  type: impedance
  task: position
  gravity: robot
  shaped_stiffness: {ratio: 2}
  shaped_inertia: {ratio: 0.5}
  stiffness: {translation: 60}
  damping: {translation: 20}
reference: [{at: 0.1, kind: step, by: [0, 0, 0.05]}]
duration: 0.5
output_interval: 0.01
"""
"""A step in continuous time, half a second of 51 rows."""


def planar_text(**changes: Any) -> str:
    """Return the planar arm's scenario in continuous time with other entries; None takes one out."""
    return yaml.safe_dump(merged(yaml.safe_load(PLANAR), changes), sort_keys=False)


def merged(data: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Return the data with entries replaced, mappings completed, and what is None left out."""
    out = dict(data)
    for name, value in changes.items():
        if value is None:
            out.pop(name, None)
        elif isinstance(value, dict) and isinstance(out.get(name), dict):
            out[name] = merged(out[name], value)
        else:
            out[name] = plain(value)
    return out


def plain(value: Any) -> Any:
    """Return a value without anything of NumPy."""
    if isinstance(value, dict):
        return {name: plain(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value


def world(**changes: Any) -> Scenario:
    """Return the plain scenario with these changes."""
    return parse_scenario(yaml.safe_dump(merged(yaml.safe_load(PLAIN), changes)))


def ran(**changes: Any) -> Run:
    """Return the run of the plain scenario with these changes."""
    return simulate(world(**changes))


def same(one: Run, other: Run) -> bool:
    """Return whether two runs are the same to the last bit."""
    assert set(one.data) == set(other.data)
    return all(np.array_equal(one[name], other[name], equal_nan=True) for name in map(str, one.data))


def books(run: Run) -> np.ndarray:
    """Return T + S + Σw + Σspilled [J], constant for the port tank, over time."""
    terms = ("tank_energy", "law_storage", "measured_port_energy", "spilled_energy")
    return np.sum([run[term] for term in terms], axis=0)


def by_rows(run: Run) -> Run:
    """Return the run as a file of before has it: nothing was noted between its rows."""
    return Run(run.data.drop_vars([name for name in NOTED if name in run.data]))
