"""The reference governor: as far toward the wanted reference as the budget pays for, and no further."""

from __future__ import annotations

from typing import NamedTuple

import casadi as cs

from passiflex.control.task import AbstractTask
from passiflex.robots.arm import EndEffectorPose

HALVINGS = 12
"""Steps of the search for γ; it ends at most 1/4096 of the way short of what the budget pays for."""
SMALLEST = 1e-300
"""Keeps a quotient finite that is not used when its denominator is 0."""
HALF_TURN = 1e-12
"""So near to half a turn [rad] the axis is read off the symmetric part of the rotation."""


class Governed(NamedTuple):
    """What was granted: the new value, γ, and ΔU, the energy that the change stores [J].

    Its price is ΔU in a signed tank, |ΔU| in the paper's.
    """

    value: EndEffectorPose | cs.SX
    share: cs.SX
    cost: cs.SX


def govern_stiffness(
    task: AbstractTask,
    pose: EndEffectorPose,
    reference: EndEffectorPose,
    held: cs.SX,
    wanted: cs.SX,
    budget: cs.SX,
    signed: cs.SX,
) -> Governed:
    """Return K̂ + γ (K_x − K̂), with the largest γ in [0, 1] whose price stays within the budget [J].

    U is linear in the stiffness, so γ = budget / price where the price is larger.
    """
    whole = task.potential(pose, reference, wanted) - task.potential(pose, reference, held)
    price = _price(whole, signed)
    enough = price <= budget
    share = cs.if_else(enough, 1, budget / cs.fmax(price, SMALLEST))
    value = cs.if_else(enough, wanted, held + share * (wanted - held))
    return Governed(value, share, cs.if_else(enough, whole, share * whole))


def govern_pose(
    task: AbstractTask,
    pose: EndEffectorPose,
    held: EndEffectorPose,
    wanted: EndEffectorPose,
    stiffness: cs.SX,
    budget: cs.SX,
    signed: cs.SX,
) -> Governed:
    """Return x̂_d moved toward x_d by γ, with the largest γ found in [0, 1] whose price stays within the budget [J].

    The position moves on the straight line, the orientation by the shortest turn. If the whole way costs
    more than the budget, `HALVINGS` bisections look for γ from γ = 0, which costs nothing; what they return
    is always affordable. With γ = 1 the value is x_d to the last bit.
    """
    path = _path(task)
    constants = (*pose, *held, *wanted, stiffness)
    whole = task.potential(pose, wanted, stiffness) - task.potential(pose, held, stiffness)
    enough = _price(whole, signed) <= budget
    low, high, cost = cs.SX(0), cs.SX(1), cs.SX(0)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        at_middle = path(middle, *constants)[0]
        affordable = _price(at_middle, signed) <= budget
        low, high = cs.if_else(affordable, middle, low), cs.if_else(affordable, high, middle)
        cost = cs.if_else(affordable, at_middle, cost)
    _, position, rotation = path(low, *constants)
    value = EndEffectorPose(
        cs.if_else(enough, wanted.position, position), cs.if_else(enough, wanted.rotation, rotation)
    )
    return Governed(value, cs.if_else(enough, 1, low), cs.if_else(enough, whole, cost))


def _price(stored: cs.SX, signed: cs.SX) -> cs.SX:
    return cs.if_else(signed > 0, stored, cs.fabs(stored))


def _path(task: AbstractTask) -> cs.Function:
    """Return (γ, pose, held, wanted, K_x) → (ΔU, position, rotation) at the share γ of the way."""
    gamma = cs.SX.sym("gamma")
    poses = [EndEffectorPose(cs.SX.sym(f"p{i}", 3), cs.SX.sym(f"R{i}", 3, 3)) for i in range(3)]
    pose, held, wanted = poses
    stiffness = cs.SX.sym("K", task.size, task.size)
    relative = wanted.rotation @ held.rotation.T
    sine, axis = _sine_and_axis(relative)
    angle = gamma * cs.atan2(sine, (cs.trace(relative) - 1) / 2)
    first = cs.skew(axis) @ held.rotation
    second = cs.skew(axis) @ first
    point = EndEffectorPose(
        held.position + gamma * (wanted.position - held.position),
        held.rotation + cs.sin(angle) * first + (1 - cs.cos(angle)) * second,
    )
    cost = task.potential(pose, point, stiffness) - task.potential(pose, held, stiffness)
    return cs.Function("path", [gamma, *pose, *held, *wanted, stiffness], [cost, *point])


def _sine_and_axis(rotation: cs.SX) -> tuple[cs.SX, cs.SX]:
    """Return sin ψ and a unit axis, also for half a turn, where R + I = 2 u uᵀ, and for none, where any axis is."""
    turn = cs.inv_skew(rotation - rotation.T) / 2  # u sin ψ
    sine = cs.norm_2(turn)
    symmetric = rotation + cs.SX.eye(3)
    longest = symmetric[:, 0]
    for j in (1, 2):
        longest = cs.if_else(symmetric[j, j] > cs.mmax(cs.diag(symmetric)[:j]), symmetric[:, j], longest)
    return sine, cs.if_else(sine > HALF_TURN, turn / cs.fmax(sine, HALF_TURN), longest / cs.norm_2(longest))
