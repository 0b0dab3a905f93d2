"""A robot looked over once: how far it reaches, what it weighs, what its motors hold, how its joints swing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import casadi as cs
import numpy as np

from passiflex.robots.arm import SerialArm
from passiflex.robots.bodies import Array
from passiflex.robots.chain import SerialChain
from passiflex.robots.flexible import FlexibleJointRobot

POSTURES = 256
"""Drawn within the limits: for the largest weight that a joint holds, and the slowest swing."""
ENDLESS = np.pi
"""Half the range [rad, m] of a joint without limits."""
TIGHT, LAVISH = 1.0, 50.0
"""Shares of its torque limit that a joint's weight may take, and how many times it may be that of all joints."""
ALIKE, PLACED = 4, 10.0
"""From how many joints on equal torque limits look like placeholders, where all are so many times the weight's."""
LIGHTEST, HEAVIEST = 0.2, 500.0
"""[kg] Between which arms weigh."""


class OnceOver(NamedTuple):
    """What a look at the robot gives.

    Attributes
    ----------
    reach: Farthest that the end effector is from the first joint, in the postures that were drawn [m].
    mass: Of all that moves [kg].
    weight: Largest gravity torque of each joint [N m, N].
    swing: Lowest frequency with which the joint springs let the robot swing, and at which joint: motors held [Hz].
    resonance: The same with the motors free: what a torque loop must know [Hz].
    """

    reach: float
    mass: float
    weight: Array
    swing: float
    swings: int
    resonance: float


def bounded(limits: Array) -> Array:
    """Return the limits of joints (n, 2), with half a turn [rad] or that many metres where there are none nearer."""
    return np.clip(limits, -ENDLESS, ENDLESS)


def postures_of(chain: SerialChain, limits: Array, count: int = POSTURES) -> Array:
    """Return zero, and postures drawn within the limits (count + 1, n)."""
    low, high = bounded(limits).T
    middle = np.clip(0.0, low, high)
    return np.vstack([middle, np.random.default_rng(0).uniform(low, high, (count, chain.n))])


def weights(chain: SerialChain, limits: Array) -> Array:
    """Return the gravity torque of each joint in the postures that are looked at (p, n) [N m, N]."""
    arm = SerialArm(chain)
    p, m = arm.layout.symbols("p")
    q = cs.SX.sym("q", arm.n)
    f = cs.Function("weight", [q, p], [arm.gravity_torque(q, m)])
    numbers = arm.layout.pack(arm.nominal())
    return np.array([np.array(f(at, numbers)).ravel() for at in postures_of(chain, limits)])


def once_over(robot: FlexibleJointRobot) -> OnceOver:
    """Return what a look at a robot gives."""
    chain, arm = robot.arm.chain, robot.arm
    p, m = arm.layout.symbols("p")
    q = cs.SX.sym("q", arm.n)
    pose = arm.pose(q, m).position
    f = cs.Function("look", [q, p], [pose, arm.mass_matrix(q, m)])
    numbers, base = arm.layout.pack(arm.nominal()), np.array(chain.joints[0].xyz)
    reach, swings = 0.0, []
    for at in postures_of(chain, robot.position_limit):
        position, M = (np.array(part) for part in f(at, numbers))
        reach = max(reach, float(np.linalg.norm(position.ravel() - base)))
        held, modes = np.linalg.eigh(_scaled(M, robot.joint_stiffness))
        free = np.linalg.eigvalsh(_freed(M, robot))
        swings.append((held[-1] ** -0.5, int(np.argmax(np.abs(modes[:, -1]))), np.sqrt(free[robot.n])))
    slowest, joint, _ = min(swings)
    return OnceOver(
        reach=reach,
        mass=sum(body.mass for body in chain.bodies),
        weight=np.abs(weights(chain, robot.position_limit)).max(axis=0),
        swing=slowest / (2 * np.pi),
        swings=joint,
        resonance=min(free for *_, free in swings) / (2 * np.pi),
    )


def _scaled(M: Array, K: Array) -> Array:
    """Return K^(-1/2) M K^(-1/2), whose largest eigenvalue is the slowest swing's 1/ω²."""
    return np.asarray(M / np.sqrt(np.outer(K, K)))


def _freed(M: Array, robot: FlexibleJointRobot) -> Array:
    """Return the symmetric matrix whose eigenvalues are the ω² of links and free motors; n of them are 0."""
    n, K = robot.n, np.diag(robot.joint_stiffness)
    stiff = np.block([[K, -K], [-K, K]])
    mass = np.block([[M, np.zeros((n, n))], [np.zeros((n, n)), np.diag(robot.motor_inertia)]])
    root = np.linalg.inv(np.linalg.cholesky(mass))
    return np.asarray(root @ stiff @ root.T)


def oddities(robot: FlexibleJointRobot, seen: OnceOver) -> Iterator[str]:
    """Yield a sentence on what looks wrong, beside the `doubts` that a robot file is warned of."""
    joints, limit = robot.arm.chain.joints, robot.torque_limit
    for joint, most, own in zip(joints, limit, seen.weight, strict=True):
        if np.isfinite(most) and own > TIGHT * most:
            yield f"joint {joint.name!r} cannot hold the arm: its weight takes {own:.3g} of {most:.3g}"
    loaded = seen.weight > 1e-3 * seen.weight.max()
    if np.isfinite(limit).all() and (limit[loaded] > LAVISH * seen.weight[loaded]).all():
        yield "all torque limits are many times what the arm weighs: are they the motors' own?"
    elif len(limit) >= ALIKE and np.ptp(limit) == 0 and (limit > PLACED * seen.weight).all():
        yield f"all torque limits are {limit[0]:g}, many times what the weight takes: are they placeholders?"
    for joint, fastest in zip(joints, robot.velocity_limit, strict=True):
        if joint.velocity == 0 and np.isinf(fastest):
            yield f"joint {joint.name!r} has a speed limit of 0 in its URDF, which is taken for none"
    if not np.isfinite(limit).any():
        yield "no joint has a torque limit: torques are not judged by it"
    if not LIGHTEST < seen.mass < HEAVIEST:
        yield f"the arm weighs {seen.mass:.3g} kg: are masses in grams, or missing?"
