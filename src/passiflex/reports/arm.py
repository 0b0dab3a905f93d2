"""What a page says of an arm: its kinematics, and solids to draw it with."""

from __future__ import annotations

from typing import Any

import numpy as np

from passiflex.robots import SerialChain
from passiflex.robots.bodies import rotation_of
from passiflex.robots.solids import solids

SAME = 1e-6
"""Frames that are nearer to each other than this [m] look the same."""


def same_kinematics(one: SerialChain | None, other: SerialChain | None) -> bool:
    """Return whether the same joint angles give the same picture."""
    if one is None or other is None or [j.kind for j in one.joints] != [j.kind for j in other.joints]:
        return False
    return np.allclose(_geometry(one), _geometry(other), rtol=0, atol=SAME)


def _geometry(chain: SerialChain) -> np.ndarray:
    """Return all lengths [m], axes and rotations in one row."""
    parts = [part for joint in chain.joints for part in (joint.xyz, rotation_of(joint.rpy), joint.axis)]
    return np.concatenate([np.ravel(part) for part in (*parts, chain.tip_xyz, chain.tip_rotation)])


def arm_header(chain: SerialChain) -> dict[str, Any]:
    """Return joints, end effector and solids, in SI units; rotations row by row."""
    return {
        "joints": [
            {
                "name": joint.name,
                "kind": joint.kind,
                "xyz": _numbers(joint.xyz),
                "rotation": _numbers(rotation_of(joint.rpy)),
                "axis": _numbers(joint.axis),
            }
            for joint in chain.joints
        ],
        "tip": {"xyz": _numbers(chain.tip_xyz), "rotation": _numbers(chain.tip_rotation)},
        "solids": [
            [
                {
                    "kind": solid.kind,
                    "start": _numbers(solid.start),
                    "end": _numbers(solid.end),
                    "radius": round(float(solid.radius), 9),
                    "part": solid.part,
                }
                for solid in body
            ]
            for body in solids(chain)
        ],
    }


def _numbers(values: Any) -> list[float]:
    """Return numbers that are exact to a picometre, without a negative zero."""
    return [float(v) + 0.0 for v in np.round(np.ravel(values), 12)]
