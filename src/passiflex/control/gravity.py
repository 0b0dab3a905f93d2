"""Three ways to carry the arm's weight, each with the potential that it stores (theory note 2.1)."""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import ClassVar

import casadi as cs

from passiflex.control.signals import Contribution
from passiflex.robots.arm import ArmNumbers, SerialArm


class AbstractGravity(abc.ABC):
    """A choice of gravity compensation; `in_model` says whether plant and law know gravity at all."""

    in_model: ClassVar[bool]
    searches: ClassVar[bool] = False
    """Whether it finds where the links rest by a fixed point, which a soft K_e lets contract too slowly."""

    @abc.abstractmethod
    def compensation(self, arm: SerialArm, phi: cs.SX, K_e: cs.SX, m: ArmNumbers) -> Contribution:
        """Return torque and storage at φ (n,), with the shaped stiffness K_e (n,) and the law's model m."""


@dataclass(frozen=True)
class RobotGravity(AbstractGravity):
    """The robot compensates gravity itself, as KUKA's does: neither plant nor law sees any."""

    in_model: ClassVar[bool] = False

    def compensation(self, arm: SerialArm, phi: cs.SX, K_e: cs.SX, m: ArmNumbers) -> Contribution:
        """Return zero and zero."""
        return Contribution(cs.SX.zeros(arm.n), cs.SX(0), cs.SX(0))


@dataclass(frozen=True)
class MotorGravity(AbstractGravity):
    """τ_g = ∇V(φ), storage −V(φ): simple, and off by the weight's deflection of the springs."""

    in_model: ClassVar[bool] = True

    def compensation(self, arm: SerialArm, phi: cs.SX, K_e: cs.SX, m: ArmNumbers) -> Contribution:
        """Return ∇V(φ) and −V(φ)."""
        return Contribution(arm.gravity_torque(phi, m), -arm.potential_energy(phi, m), cs.SX(0))


@dataclass(frozen=True)
class StaticGravity(AbstractGravity):
    """τ_g = ∇V(q̄), where the links would rest if the motors stood at φ: the exact compensation.

    q̄(φ) solves K_e (φ − q̄) = ∇V(q̄), so it minimises V(q) + ½ (φ − q)ᵀ K_e (φ − q) over q. The minimum
    V_γ(φ) has the gradient K_e (φ − q̄) (envelope theorem), and −V_γ is what the compensation stores.
    The fixed point contracts by |∇²V| / K_e, 1e-2 or less; `steps` of it are unrolled.
    """

    steps: int = 8
    in_model: ClassVar[bool] = True
    searches: ClassVar[bool] = True

    def rest_position(self, arm: SerialArm, phi: cs.SX, K_e: cs.SX, m: ArmNumbers) -> cs.SX:
        """Return q̄(φ) (n,)."""
        q = cs.SX.sym("q", arm.n)
        gravity = cs.Function("g", [q, _flat(m)], [arm.gravity_torque(q, m)], {"cse": True})
        rest = phi
        for _ in range(self.steps):
            rest = phi - gravity(rest, _flat(m)) / K_e
        return rest

    def compensation(self, arm: SerialArm, phi: cs.SX, K_e: cs.SX, m: ArmNumbers) -> Contribution:
        """Return K_e (φ − q̄) = ∇V(q̄) and −V_γ(φ)."""
        rest = self.rest_position(arm, phi, K_e, m)
        deflection = phi - rest
        minimum = arm.potential_energy(rest, m) + cs.dot(deflection, K_e * deflection) / 2
        return Contribution(K_e * deflection, -minimum, cs.SX(0))


def _flat(m: ArmNumbers) -> cs.SX:
    """Return the symbols of the physical parameters, so that they can be arguments of a function."""
    return cs.vertcat(*cs.symvar(cs.vertcat(*(cs.vec(v) for v in vars(m).values()))))
