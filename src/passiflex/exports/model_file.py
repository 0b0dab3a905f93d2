"""The plant of a scenario, or a robot, as a model file for MuJoCo."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.engines.mjcf import RK4, Options, cut_inertias, mjcf
from passiflex.files import OutputError, whole_file
from passiflex.loops.plant import Plant
from passiflex.native import NativeFunction, fastest_pole
from passiflex.native.stability import STABILITY_LIMIT
from passiflex.problems.problem import Problem
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.simulation.simulate_sampled import RESOLVED

ENDING = ".xml"


def export_model(what: FlexibleJointRobot | Problem, path: str | Path) -> list[str]:
    """Write the MJCF of a robot, or of the plant of a problem with its tool, payload and deviations and its start.

    Return a line on each link whose inertia no body has, and that MuJoCo's compiler would refuse: there the largest
    principal moment is cut to the sum of the others. `simulate` with the engine mujoco runs on the exact ones.

    Raises
    ------
    OutputError
        If the path does not end in .xml.
    """
    path = Path(path)
    if path.suffix != ENDING:
        raise OutputError("the file of a model", got=str(path), needs=f"a name that ends in {ENDING}")
    text, cut = model_text(what)
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return cut


def model_text(what: FlexibleJointRobot | Problem) -> tuple[str, list[str]]:
    """Return the text of the file, and a line on each inertia that was cut."""
    if isinstance(what, Problem):
        robot = what.law.robot
        numbers = robot.layout.unpack(what.plant[: robot.layout.size])
        start = what.q, what.theta
        text = mjcf(robot, numbers, Options(_step(robot, numbers, what.q), RK4), start=start)
    else:
        robot, numbers = what, what.nominal()
        text = mjcf(robot, numbers, Options(_step(robot, numbers, np.zeros(robot.n)), RK4))
    return text, cut_inertias(robot, numbers)


def _step(robot: FlexibleJointRobot, numbers: Mapping[str, Any], q: NDArray[np.float64]) -> float:
    """Return a step that resolves the joints' springs, as the native loop takes it."""
    plant = Plant(robot, ())
    x = np.concatenate([q, q, np.zeros(2 * robot.n)])
    u = np.zeros(robot.n + plant.environment.size)
    pole = fastest_pole(NativeFunction(plant.rhs), x, u, robot.layout.pack(numbers))
    return float(f"{RESOLVED * STABILITY_LIMIT / pole:.1e}")
