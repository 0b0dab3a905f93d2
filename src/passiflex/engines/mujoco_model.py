"""The compiled model of MuJoCo that a robot runs on, with its numbers exact to the last one."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from passiflex.engines.contact import Contact, contact_piece, stiffen
from passiflex.engines.mjcf import Options, link_body, mjcf, possible
from passiflex.extras import MissingExtraError, imported
from passiflex.robots.bodies import matrix
from passiflex.robots.flexible import FlexibleJointRobot

OLDEST = 4
NOTHING: Mapping[str, Contact] = MappingProxyType({})


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
    robot: FlexibleJointRobot,
    numbers: Mapping[str, Any],
    options: Options,
    contacts: Mapping[str, Contact] = NOTHING,
) -> Any:
    """Return the `MjModel` of `mjcf`, with contacts by name.

    Inertias that MuJoCo's compiler refuses are put in afterwards, and so are the stiffnesses of contacts.
    """
    mujoco = mujoco_module()
    pieces = [contact_piece(name, contact) for name, contact in contacts.items()]
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
    for name, contact in contacts.items():
        stiffen(model, name, contact)
    return model
