"""The compiled model of MuJoCo that a robot runs on, with its numbers exact to the last one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from passiflex.engines.mjcf import Options, Piece, link_body, mjcf, possible
from passiflex.extras import MissingExtraError, imported
from passiflex.robots.bodies import matrix
from passiflex.robots.flexible import FlexibleJointRobot

OLDEST = 4


def mujoco_module() -> Any:
    """Return the module `mujoco`.

    Raises
    ------
    MissingExtraError
        If it is not installed, or too old.
    """
    mujoco = imported("mujoco", "mujoco", "the engine mujoco")
    require_recent(mujoco.__version__)
    return mujoco


def require_recent(version: str) -> None:
    """Refuse a version of MuJoCo that has other rules."""
    if int(version.partition(".")[0]) < OLDEST:
        needs, try_ = f"{OLDEST}.0 or newer", "pip install --upgrade 'passiflex[mujoco]'"
        raise MissingExtraError("the engine mujoco needs a newer MuJoCo", got=version, needs=needs, try_=try_)


def mujoco_model(
    robot: FlexibleJointRobot, numbers: Mapping[str, Any], options: Options, pieces: Sequence[Piece] = ()
) -> Any:
    """Return the `MjModel` of `mjcf`, with inertias that MuJoCo's compiler refuses put in afterwards."""
    mujoco = mujoco_module()
    model = mujoco.MjModel.from_xml_string(mjcf(robot, numbers, options, pieces))
    changed = False
    for i in range(robot.n):
        inertia = link_body(numbers, i).inertia
        if possible(inertia) is inertia:
            continue
        moments, axes = np.linalg.eigh(matrix(inertia))
        axes *= np.sign(np.linalg.det(axes))
        x, y, z, w = Rotation.from_matrix(axes).as_quat()
        body = model.body(f"link_{i + 1}").id
        model.body_inertia[body], model.body_iquat[body] = moments, [w, x, y, z]
        changed = True
    if changed:
        model.body_sameframe[:] = 0
        mujoco.mj_setConst(model, mujoco.MjData(model))
    return model
