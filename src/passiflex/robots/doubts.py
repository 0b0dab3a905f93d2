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
ODD = 200
"""How many times a number of one joint is that of the others, or they that of it, where neither can be meant."""
POSTURES = 16
"""In which it is looked for what a joint moves: a roll joint of a straight arm moves next to nothing."""
ROUNDED = 0.01
"""Share by which a limit may go beyond that of the URDF: it may have been rounded."""


def doubts(robot: Any) -> Iterator[str]:
    """Yield a sentence on each thing of a `RobotDescription` that contradicts its links, or can hardly be meant."""
    moved, joints = moved_inertia(robot.chain, _postures(robot)).max(axis=0), robot.chain.joints
    small = np.flatnonzero(
        (robot.motor_inertia < MOTOR_SIDE * moved)
        | (_of_its_kind(robot.motor_inertia, robot.chain) < 1 / ODD)
    )
    if small.size:
        i = int(small[np.argmin(robot.motor_inertia[small] / moved[small])])
        unit = "kg" if joints[i].kind == "prismatic" else "kg m^2"
        yield (
            f"motor_inertia of {listed(repr(joints[k].name) for k in small)} is far below what the joint moves: "
            f"{robot.motor_inertia[i]:.3g} against {moved[i]:.3g} {unit} at {joints[i].name!r}; "
            "it counts behind the gear, as rotor inertia times the square of the ratio"
        )
    yield from _springs(robot)
    yield from _contradictions(robot)


def _springs(robot: Any) -> Iterator[str]:
    """Yield a sentence on a joint stiffness that fits neither what the joint moves, nor its motor, nor the others.

    Links that weigh little swing fast, so that only the slowest spring can be too hard by its swing; by what its
    motor's largest torque bends it, and beside the others, each can.
    """
    joints, moved = robot.chain.joints, moved_inertia(robot.chain)[0]
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
        return
    share = _of_its_kind(robot.stiffness, robot.chain)
    odd = np.flatnonzero((share > ODD) | (share < 1 / ODD))
    if odd.size:
        yield (
            f"joint_stiffness of {listed(repr(joints[k].name) for k in odd)} is far from that of the others: "
            f"{', '.join(f'{k:.3g}' for k in robot.stiffness)}; is it 1000 times off?"
        )


def moved_inertia(chain: SerialChain, q: Array | None = None) -> Array:
    """Return what each joint moves, the diagonal of M (N, n): kg m^2, or kg where it slides.

    Parameters
    ----------
    q: Postures (N, n); zero, alone, if left out.
    """
    frames = world_frames(chain, np.zeros((1, chain.n)) if q is None else q)
    position, rotation = frames.position[:, 1:-1], frames.rotation[:, 1:-1]
    out = np.zeros((len(position), chain.n))
    for i, joint in enumerate(chain.joints):
        axis = rotation[:, i] @ joint.axis
        for k, body in enumerate(chain.bodies[i:], start=i):
            arm = np.cross(axis, position[:, k] + rotation[:, k] @ body.com - position[:, i])
            seen = np.einsum("pij,pi->pj", rotation[:, k], axis)  # the axis in the axes of the body
            turning = np.einsum("pi,ij,pj->p", seen, matrix(body.inertia), seen) + body.mass * (arm**2).sum(
                axis=1
            )
            out[:, i] += body.mass if joint.kind == "prismatic" else turning
    return out


def _postures(robot: Any) -> Array:
    """Return postures to look at: zero, where many arms are straight, and some drawn within the limits."""
    low, high = np.clip(robot.position_limit, -np.pi, np.pi).T
    drawn = np.random.default_rng(0).uniform(low, high, (POSTURES, robot.chain.n))
    return np.vstack([np.zeros(robot.chain.n), drawn])


def _of_its_kind(values: Array, chain: SerialChain) -> Array:
    """Return each joint's value as a share of the median of the other joints of its kind; 1 if it is the only one."""
    kinds = np.array([joint.kind for joint in chain.joints])
    out = np.ones(chain.n)
    for i, kind in enumerate(kinds):
        others = values[(kinds == kind) & (np.arange(chain.n) != i)]
        out[i] = values[i] / np.median(others) if others.size else 1.0
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
