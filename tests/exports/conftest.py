"""Runs to export: a sampled one with a force, and ones that lack things."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from passiflex.simulation import Run
from worlds import ran


@pytest.fixture(scope="session")
def run() -> Run:
    """Return 0.3 s of the planar arm at 1 kHz, its reference moved and its hand pushed.

    The reference in force is another one everywhere, so that no export takes the one for the other.
    """
    force = {"from": 0.15, "to": 0.25, "force": [0, 0, 3]}
    data = ran(duration=0.3, forces=[force]).data.copy(deep=True)
    data["governed_position"] += 0.01
    turn = Rotation.from_rotvec([0.1, 0.2, 0.3]).as_matrix()
    data["governed_rotation"][:] = turn @ data["governed_rotation"].to_numpy()
    return Run(data)


@pytest.fixture(scope="session")
def damaged(run: Run) -> Run:
    """Return the run without description, robot and energies, with gaps in q, position and a torque."""
    data = run.data.drop_vars(["external_energy", "desired_rotation", "dtheta"]).copy(deep=True)
    data["q"][10:13, 1] = np.nan
    data["position"][20:25] = np.nan
    data["tau_m"][0, 0] = np.inf
    data.attrs |= {"robot_description": "", "robot": "somebody's <b>arm</b>", "scenario": ""}
    return Run(data)
