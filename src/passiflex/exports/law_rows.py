"""Rows for the self-test of an exported law: what a robot might say, and what Python commands then."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from passiflex.control.posture import posture
from passiflex.onboard import Controller, Sensed, Setpoint

Array = NDArray[np.float64]

ROWS = 1000
ASKED = 700
"""Rows with a setpoint; then none comes, and the watch acts."""
SILENT = (500, 504)
"""Rows in between without a finite reading."""
SWING, ROUND = 0.02, 3.0
"""How far the joints move [rad], and how often in all rows."""


def test_rows(controller: Controller, start: Sensed) -> Iterator[str]:
    """Yield lines of numbers in hexadecimal, to the last bit: readings, setpoint, torque, level of the tank.

    The joints swing, readings flicker, periods jitter, some readings are none.
    """
    rng, law = np.random.default_rng(0), controller.law
    robot, model = law.robot, law.robot.layout.unpack(controller.problem.model)
    for i in range(ROWS):
        said = _said(i, start, rng)
        elapsed = controller.period * (1.0 if i == 0 else float(rng.choice([0.9, 1.0, 1.0, 1.1])))
        if i == 0:
            controller.start(said)
            home = posture(robot, controller.problem.q, model).pose
        asked = None
        if i < ASKED:
            way = 0.03 * np.sin(np.array([0.01, 0.013, 0.017]) * i)
            asked = Setpoint(home.position + way, home.rotation, np.r_[1e-2 * np.cos(0.01 * i), np.zeros(5)])
        torque = controller.step(said, asked, elapsed)
        words = [float(v).hex() for v in controller.inputs["said"]]
        words.append("0x1p+0" if asked else "0x0p+0")
        if asked is not None:
            told = controller.asked
            words += [float(v).hex() for name in TOLD for v in told[name].ravel()]
        words += [float(v).hex() for v in (*torque, controller.report.level)]
        yield " ".join(words) + "\n"


TOLD = ("position", "rotation", "velocity")


def _said(i: int, start: Sensed, rng: np.random.Generator) -> Sensed:
    if SILENT[0] <= i < SILENT[1]:
        return Sensed(*(None if v is None else np.full_like(v, np.nan) for v in start))
    swing = SWING * np.sin(2 * np.pi * ROUND * i / ROWS)
    return Sensed(
        *(None if v is None else np.asarray(v) + swing + 1e-6 * rng.normal(size=np.shape(v)) for v in start)
    )
