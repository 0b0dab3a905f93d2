"""Numbers of a robot that are possible but can hardly be meant: at the other end of a gear, a thousand times off."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.robots.bodies import matrix
from passiflex.robots.chain import SerialChain
from passiflex.robots.frames import world_frames
from passiflex.robots.urdf_parts import listed

Array = NDArray[np.float64]

MOTOR_SIDE = 1 / 200
"""Share of what a joint moves below which a motor's inertia looks as if its gear were forgotten: of 1:15 or more."""
SLOWEST, FASTEST = 0.7, 150.0
"""[Hz] between which the slowest joint spring of an arm carries its links; from 1 to 100 is what arms have."""
BENDING = {"revolute": (1e-4, 1.0, "rad"), "prismatic": (1e-7, 0.02, "m")}
"""Between which the largest torque bends a joint: 0.003 to 0.06 rad, and 1e-5 to 1e-2 m, are what arms have."""
ROUNDED = 0.01
"""Share by which a limit may go beyond that of the URDF: it may have been rounded."""


def doubts(robot: Any) -> Iterator[str]:
    """Yield a sentence on each thing of a `RobotDescription` that contradicts its links, or can hardly be meant."""
    moved, joints = moved_inertia(robot.chain), robot.chain.joints
    small = np.flatnonzero(robot.motor_inertia < MOTOR_SIDE * moved)
    if small.size:
        i = int(small[np.argmin(robot.motor_inertia[small] / moved[small])])
        unit = "kg" if joints[i].kind == "prismatic" else "kg m^2"
        yield (
            f"motor_inertia of {listed(repr(joints[k].name) for k in small)} is far below what the joint moves: "
            f"{robot.motor_inertia[i]:.3g} against {moved[i]:.3g} {unit} at {joints[i].name!r}; "
            "it counts behind the gear, as rotor inertia times the square of the ratio"
        )
    yield from _springs(robot, moved)
    yield from _contradictions(robot)


def _springs(robot: Any, moved: Array) -> Iterator[str]:
    """Yield a sentence on a joint stiffness that does not fit what the joint moves, or what its motor can do.

    Links that weigh little swing fast, so that only the slowest spring can be too hard by its swing; by what its
    motor's largest torque bends it, each can.
    """
    joints = robot.chain.joints
    swing = np.sqrt(robot.stiffness) / np.sqrt(moved) / (2 * np.pi)  # of each factor: the ratio may overflow
    slowest = int(np.argmin(swing))
    if not SLOWEST <= swing[slowest] <= FASTEST:
        soft = swing[slowest] < SLOWEST
        yield (
            f"joint_stiffness of {joints[slowest].name!r} is very {'soft' if soft else 'hard'}: "
            f"{robot.stiffness[slowest]:.3g} lets its links swing at {swing[slowest]:.2g} Hz"
            f"{'' if soft else ', and those of all others faster'}; is it 1000 times off?"
        )
        return
    least, most, units = zip(*(BENDING[j.kind] for j in joints), strict=True)
    bent = robot.torque_limit / robot.stiffness
    odd = np.flatnonzero(np.isfinite(bent) & ((bent < least) | (bent > most)))
    if odd.size:
        i = int(odd[0])
        yield (
            f"joint_stiffness of {listed(repr(joints[k].name) for k in odd)} does not fit the motor: the largest "
            f"torque, {robot.torque_limit[i]:.3g}, bends {joints[i].name!r} by {bent[i]:.2g} {units[i]}; "
            "is one of them 1000 times off?"
        )


def moved_inertia(chain: SerialChain) -> Array:
    """Return what each joint moves at q = 0, the diagonal of M: kg m^2, or kg where it slides."""
    frames = world_frames(chain, np.zeros((1, chain.n)))
    position, rotation = frames.position[0, 1:-1], frames.rotation[0, 1:-1]
    out = np.zeros(chain.n)
    for i, joint in enumerate(chain.joints):
        axis = rotation[i] @ joint.axis
        for R, origin, body in zip(rotation[i:], position[i:], chain.bodies[i:], strict=True):
            arm = np.cross(axis, origin + R @ body.com - position[i])
            turning = axis @ R @ matrix(body.inertia) @ R.T @ axis + body.mass * (arm @ arm)
            out[i] += body.mass if joint.kind == "prismatic" else turning
    return out


def _contradictions(robot: Any) -> Iterator[str]:
    """Yield a sentence on each limit that goes beyond the one in the URDF; zeros stand for none there."""
    joints = robot.chain.joints
    for entry, ours, theirs in (
        ("torque_limit", robot.torque_limit, [j.effort for j in joints]),
        ("velocity_limit", robot.velocity_limit, [j.velocity for j in joints]),
    ):
        for joint, own, other in zip(joints, ours, theirs, strict=True):
            if other > 0 and own > other * (1 + ROUNDED):
                yield f"{entry} of joint {joint.name!r} contradicts the URDF: {own:g} against {other:g}"
                break
    for joint, (low, high) in zip(joints, robot.position_limit, strict=True):
        slack = ROUNDED * (joint.upper - joint.lower)
        if np.isfinite(slack) and not joint.lower - slack <= low < high <= joint.upper + slack:
            bounds = f"{low:g} to {high:g} against {joint.lower:g} to {joint.upper:g}"
            yield f"position_limit of joint {joint.name!r} contradicts the URDF: {bounds}"
            break
