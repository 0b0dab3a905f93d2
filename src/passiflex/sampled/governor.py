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
    way = _way(task, pose, held, wanted, stiffness)
    whole = task.potential(pose, wanted, stiffness) - task.potential(pose, held, stiffness)
    enough = _price(whole, signed) <= budget
    low = cs.SX(0)
    for k in range(1, HALVINGS + 1):
        step = 2.0**-k
        affordable = _price(way.cost(low + step), signed) <= budget
        low += step * affordable
    reached = way.point(low)
    value = EndEffectorPose(
        *(cs.if_else(enough, there, short) for there, short in zip(wanted, reached, strict=True))
    )
    return Governed(value, cs.if_else(enough, 1, low), cs.if_else(enough, whole, way.cost(low)))


def _price(stored: cs.SX, signed: cs.SX) -> cs.SX:
    return cs.fmax(stored, cs.if_else(signed > 0, 1, -1) * stored)


class _Way(NamedTuple):
    """The way from one reference to another: straight, and by the shortest turn.

    A point on it is linear in (γ, sin γψ, 1 − cos γψ), and a potential is quadratic in a point: what it costs to come
    as far as γ takes as many products as these three have, however many the potential takes.

    Attributes
    ----------
    begin, straight, first, second: x̂_d, then what γ, sin γψ and 1 − cos γψ add to its position and its axes.
    angle: ψ [rad].
    slope, curvature: First and second derivatives of ΔU by the three, (3,) and (3, 3) [J].
    """

    begin: EndEffectorPose
    straight: cs.SX
    first: cs.SX
    second: cs.SX
    angle: cs.SX
    slope: cs.SX
    curvature: cs.SX

    def _coordinates(self, share: cs.SX) -> cs.SX:
        return cs.vertcat(share, cs.sin(share * self.angle), 1 - cs.cos(share * self.angle))

    def point(self, share: cs.SX) -> EndEffectorPose:
        """Return the reference at γ."""
        gamma, sine, versine = cs.vertsplit(self._coordinates(share))
        return EndEffectorPose(
            self.begin.position + gamma * self.straight,
            self.begin.rotation + sine * self.first + versine * self.second,
        )

    def cost(self, share: cs.SX) -> cs.SX:
        """Return ΔU at γ [J]."""
        z, C = self._coordinates(share), self.curvature
        rising = (C[i, i] / 2 * z[i] + sum(C[i, j] * z[j] for j in range(i + 1, 3)) for i in range(3))
        return sum(z[i] * (self.slope[i] + more) for i, more in enumerate(rising))


def _way(
    task: AbstractTask,
    pose: EndEffectorPose,
    held: EndEffectorPose,
    wanted: EndEffectorPose,
    stiffness: cs.SX,
) -> _Way:
    """Return the way from a reference to another, and what it costs."""
    relative = wanted.rotation @ held.rotation.T
    sine, axis = _sine_and_axis(relative)
    first = cs.skew(axis) @ held.rotation
    way = _Way(
        begin=held,
        straight=wanted.position - held.position,
        first=first,
        second=cs.skew(axis) @ first,
        angle=cs.atan2(sine, (cs.trace(relative) - 1) / 2),
        slope=cs.SX(3, 1),
        curvature=cs.SX(3, 3),
    )
    z = cs.SX.sym("z", 3)
    point = EndEffectorPose(
        held.position + z[0] * way.straight, held.rotation + z[1] * way.first + z[2] * way.second
    )
    curvature, slope = cs.hessian(task.potential(pose, point, stiffness), z)
    assert not cs.depends_on(curvature, z), "a potential is quadratic in the reference"
    curvature, slope = (cs.substitute(derivative, z, cs.SX.zeros(3)) for derivative in (curvature, slope))
    return way._replace(slope=slope, curvature=curvature)


def _sine_and_axis(rotation: cs.SX) -> tuple[cs.SX, cs.SX]:
    """Return sin ψ and a unit axis, also for half a turn, where R + I = 2 u uᵀ, and for none, where any axis is."""
    turn = cs.inv_skew(rotation - rotation.T) / 2  # u sin ψ
    sine = cs.norm_2(turn)
    symmetric = rotation + cs.SX.eye(3)
    longest = symmetric[:, 0]
    for j in (1, 2):
        longest = cs.if_else(symmetric[j, j] > cs.mmax(cs.diag(symmetric)[:j]), symmetric[:, j], longest)
    return sine, cs.if_else(sine > HALF_TURN, turn / cs.fmax(sine, HALF_TURN), longest / cs.norm_2(longest))
