"""Runs to look at: small real ones of every kind, and made-up ones whose signals are known."""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import yaml

from passiflex.diagrams import KINDS
from passiflex.simulation import Run, parse_scenario, simulate

ARM = Path(__file__).parents[2] / "docs" / "examples" / "arm3.yaml"
PUSHED: dict[str, Any] = {
    "name": "pushed",
    "robot": str(ARM),
    "posture": [0.0, 0.7, -1.4],
    "law": {
        "type": "impedance",
        "task": "position",
        "gravity": "static",
        "shaped_stiffness": {"ratio": 2},
        "shaped_inertia": {"ratio": 0.5},
        "stiffness": {"translation": 60},
        "damping": {"translation": 20},
    },
    "reference": [
        {"at": 0.2, "kind": "step", "by": [0, 0, 0.05]},
        {"at": 0.6, "kind": "circle", "plane": ["x", "z"], "radius": 0.02, "period": 1},
    ],
    "forces": [{"from": 0.3, "to": 0.4, "force": [0, 0, 2]}],
    "duration": 1,
    "output_interval": 0.01,
}
RIGID = {
    "type": "rigid",
    "task": "position",
    "gravity": "model",
    "stiffness": {"translation": 60},
    "damping": {"translation": 20},
    "target_inertia": {"damping_ratio": 0.7},
    "motor_inertia": "carried",
}
CONTROL = {"rate": 1000, "delay": 0, "inner_loop": "plain", "external_torque": "none"}
DRAG = [{"from": 0.5, "to": 1, "viscous": 30}]
WALL = {
    "kind": "plane",
    "name": "wall",
    "point": [0, 0, 0.03],
    "normal": [0, 0, -1],
    "relative": True,
    "stiffness": 1e3,
}
LOAD = {"kind": "load", "mass": 0.3, "from": 0.4, "to": 0.8}
STOPS = {"kind": "end_stops", "lower": [-2, -2, -2], "upper": [2, 0.72, 2], "stiffness": 200}
_PLAIN = PUSHED["law"] | {"shaped_stiffness": {"ratio": 1}}
POOR = {"kind": "port", "initial": 0.13}


@lru_cache
def _simulated(text: str) -> Run:
    return simulate(parse_scenario(text))


def simulated(**changes: Any) -> Run:
    """Return the run of the small arm with these entries of its scenario changed; one of them each time."""
    return _simulated(yaml.safe_dump(PUSHED | changes))


def continuous() -> Run:
    return simulated()


def rigid() -> Run:
    return simulated(law=RIGID)


def touching() -> Run:
    """Return a sampled run whose hand comes to a wall that is above where it starts."""
    return simulated(law=_PLAIN, control=CONTROL, environment=[WALL], output_interval=0.001)


def laden() -> Run:
    """Return a sampled run with a load for a while, and a joint that comes to its end."""
    return simulated(law=_PLAIN, control=CONTROL, environment=[LOAD, STOPS], output_interval=0.001)


def held_back() -> Run:
    """Return a sampled run whose tank cannot pay for the step at once."""
    return simulated(law=_PLAIN, control=CONTROL, tank=POOR, drags=DRAG, output_interval=0.001)


EVERYWHERE = tuple(kind for kind in KINDS if kind != "contact")
"""Kinds of diagrams that there are of every run."""
KINDS_OF_RUN = {"continuous": continuous, "rigid": rigid, "sampled": held_back}


def altered(run: Run, **attributes: Any) -> Run:
    """Return a copy of a run that may be changed, with other attributes."""
    data = run.data.copy(deep=True)
    data.attrs |= attributes
    return Run(data)


def without(run: Run, *names: str) -> Run:
    return Run(run.data.drop_vars(list(names)))


def made_up(count: int = 40, joints: int = 7, **changes: Any) -> Run:
    """Return a sampled run of random signals: `changes` are signals or attributes."""
    rng = np.random.default_rng(count)
    time = np.linspace(0, 1, count)
    signals: dict[str, Any] = {
        name: ("time", rng.normal(size=count))
        for name in (
            "link_kinetic_energy", "shaped_kinetic_energy", "shaped_spring_energy", "cartesian_spring_energy",
            "potential_energy", "gravity_storage", "compensated_energy", "tank_energy", "joint_energy",
            "reference_energy", "granted_energy", "drawn_energy", "refilled_energy", "spilled_energy",
            "external_energy", "motor_energy", "joint_loss_energy", "friction_energy",
            "external_power", "motor_power", "joint_power", "joint_loss_power", "friction_power",
        )
    }  # fmt: skip
    zero = np.zeros(count)
    signals |= dict.fromkeys(("governed_time", "latched"), ("time", zero))
    signals |= dict.fromkeys(("reference_share", "stiffness_share"), ("time", zero + 1))
    for name in ("position", "desired_position", "governed_position"):
        signals[name] = (("time", "axis"), rng.normal(size=(count, 3)))
    for name in ("rotation", "desired_rotation"):
        signals[name] = (("time", "axis", "column"), np.tile(np.eye(3), (count, 1, 1)))
    for name in ("tau_m", "tau_a"):
        signals[name] = (("time", "joint"), rng.normal(size=(count, joints)), {"units": "N m"})
    signals["torque_limit"] = ("joint", np.linspace(1, 3, joints), {"units": "N m"})
    attributes = {
        "name": "made up", "law": "ImpedanceLaw", "has_tank": 1, "control_period": 0.001, "failure": "",
        "events": json.dumps([]), "scenario": "",
    }  # fmt: skip
    for name, value in changes.items():
        if name in signals:
            signals[name] = (signals[name][0], value, *signals[name][2:])
        else:
            attributes[name] = value
    return Run(xr.Dataset(signals, {"time": time}, attributes))
