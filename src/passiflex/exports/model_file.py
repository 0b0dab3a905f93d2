"""The plant of a scenario, or a robot, as a model file for MuJoCo."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.engines.contact import contact_piece
from passiflex.engines.engine import contacts_of
from passiflex.engines.mjcf import RK4, Options, cut_inertias, mjcf
from passiflex.engines.mujoco_model import mujoco_model
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

    Return a line on each thing that is not in the file as it is: the inertia of a link that no body has, whose largest
    principal moment is cut to the sum of the others, as MuJoCo's compiler refuses it; and a damper that grows with the
    depth of a contact. `simulate` with the engine mujoco has both.

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
    """Return the text of the file, and the lines of `export_model`."""
    undamped: list[str] = []
    if isinstance(what, Problem):
        robot = what.law.robot
        numbers = robot.layout.unpack(what.plant[: robot.layout.size])
        start = what.q, what.theta
        contacts = contacts_of(what)
        options = Options(_step(robot, numbers, what.q), RK4, contact=bool(contacts))
        stiff = mujoco_model(robot, numbers, options, contacts) if contacts else None
        pieces = [contact_piece(name, contact, stiff) for name, contact in contacts.items()]
        text = mjcf(robot, numbers, options, pieces, start)
        undamped = [name for name, contact in contacts.items() if contact.crossing]
    else:
        robot, numbers = what, what.nominal()
        text = mjcf(robot, numbers, Options(_step(robot, numbers, np.zeros(robot.n)), RK4))
    remarks = [
        f"{line}; the largest is cut to the sum of the others" for line in cut_inertias(robot, numbers)
    ]
    return text, remarks + [f"the damper of {name!r} is left out" for name in undamped]


def _step(robot: FlexibleJointRobot, numbers: Mapping[str, Any], q: NDArray[np.float64]) -> float:
    """Return a step that resolves the joints' springs, as the native loop takes it."""
    plant = Plant(robot, ())
    x = np.concatenate([q, q, np.zeros(2 * robot.n)])
    u = np.zeros(robot.n + plant.environment.size)
    pole = fastest_pole(NativeFunction(plant.rhs), x, u, robot.layout.pack(numbers))
    return float(f"{RESOLVED * STABILITY_LIMIT / pole:.1e}")
