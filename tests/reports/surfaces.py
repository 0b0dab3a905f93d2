"""Runs with surfaces of every shape, and what strange files may say of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import yaml

from passiflex.simulation import Run, parse_scenario, simulate

HARD = {"stiffness": 2e4, "dissipation": 0.5}
SURFACES: list[dict[str, Any]] = [
    {"kind": "plane", "name": "wall", "point": [0.05, 0, 0], "normal": [-1, 0, 0], "relative": True, "friction": 0.3},
    {
        "kind": "sphere", "name": "ball", "centre": [-0.1, 0.1, 0.3], "radius": 0.06, "relative": True,
        "motion": [{"at": 0, "kind": "move", "by": [0, 0, 0.1], "duration": 0.9}],
    },
    {"kind": "cylinder", "name": "post", "centre": [0.4, 0.5, 0], "radius": 0.05},
    {
        "kind": "box", "name": "crate", "centre": [0.4, -0.4, 0.15], "size": [0.2, 0.3, 0.3],
        "rotation_vector": [0, 0, 0.5],
    },
]  # fmt: skip
WORLD: dict[str, Any] = {
    "name": "wall",
    "robot": "iiwa14",
    "posture": [0, 0.6, 0, -1.2, 0, 1.0, 0],
    "law": {
        "type": "impedance",
        "task": "pose",
        "stiffness": {"translation": 500, "rotation": 30},
        "damping": {"ratio": 0.7},
        "shaped_stiffness": {"ratio": 1},
        "shaped_inertia": {"ratio": 0.3},
    },
    "control": {"rate": "1 kHz"},
    "tank": {"initial": "2 J"},
    "hand": {"radius": "20 mm"},
    "environment": [surface | HARD for surface in SURFACES],
    "reference": [{"at": 0.1, "kind": "move", "by": [0.1, 0, 0], "duration": 0.4}],
    "duration": 1,
}


@lru_cache
def touching() -> Run:
    """Return a second of an arm that comes to a wall; a ball moves, a post and a crate stand beside it."""
    return simulate(parse_scenario(yaml.safe_dump(WORLD)))


def said(**changes: Any) -> Run:
    """Return the run with other entries in what it says of its wall."""
    wall, *others = WORLD["environment"]
    told = WORLD | {"environment": [wall | changes, *others]}
    return Run(touching().data.assign_attrs(scenario=yaml.safe_dump(told)))


def _renamed() -> Run:
    """Return the run with HTML for the name of a surface."""
    html = "<img src=x onerror=window.hacked=1>"
    data = touching().data
    return Run(data.rename({f"wall_{signal}": f"{html}_{signal}" for signal in ("force", "depth")}))


def _lost() -> Run:
    data = touching().data.copy(deep=True)
    for name in ("wall_force", "wall_depth", "ball_place"):
        data[name][100:] = np.nan
    data["crate_force"][...] = 1e300
    return Run(data)


def _many() -> Run:
    data = touching().data
    more = {f"more{i}_{signal}": data[f"wall_{signal}"] for i in range(40) for signal in ("force", "depth")}
    return Run(data.assign(more))


MISTOLD: dict[str, Callable[[], Run]] = {
    "far": lambda: said(point=[1e200, 0, 0], relative=False, normal=[1e-9, 1, 0]),
    "no direction": lambda: said(normal=[1e-320, 0, 0]),
    "endless direction": lambda: said(normal=[1e300, 1e300, 0]),
    "no scenario": lambda: Run(touching().data.assign_attrs(scenario="")),
    "no position": lambda: Run(touching().data.drop_vars("position")),
    "no place": lambda: Run(touching().data.drop_vars("ball_place")),
    "a name of HTML": _renamed,
    "gaps": _lost,
    "many": _many,
}
