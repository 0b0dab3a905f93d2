"""Where τ_e of (5) comes from: a wrench sensor, a momentum observer, or nowhere."""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, final

import casadi as cs

from passiflex.control.signals import Measurement
from passiflex.layout import Field, Layout
from passiflex.robots.arm import SerialArm
from passiflex.robots.flexible import RobotNumbers
from passiflex.robots.linear_algebra import solve_spd
from passiflex.sampled.rest import Remembered, Rest
from passiflex.sampled.sensors import low_pass

REGULAR = 1e-6
"""Added to J M⁻¹ Jᵀ [1/kg], which may be singular."""


class Estimate(NamedTuple):
    """The measurement with τ_e and F_e as the law is to believe them, and what the estimator remembers."""

    measured: Measurement
    state: cs.SX


class Known(NamedTuple):
    """What an estimator may use: the arm, the numbers m of the law's model, its bandwidth [rad/s]."""

    arm: SerialArm
    m: RobotNumbers
    bandwidth: cs.SX


class AbstractExternalTorque(abc.ABC):
    """A choice of τ_e."""

    blind: ClassVar[bool] = False
    """Whether the law takes whatever pushes the robot for error."""

    @abc.abstractmethod
    def state(self, n: int) -> Layout:
        """Return what is remembered from one sample to the next."""

    def start(self, at: Rest) -> Remembered:
        """Return what is remembered at rest, of each field of the state."""
        return self.state(at.q.size).zeros()

    @abc.abstractmethod
    def estimate(self, y: Measurement, elapsed: cs.SX, known: Known, s: Any) -> Estimate:
        """Return y with τ_e and F_e replaced."""


@final
@dataclass(frozen=True)
class TrueTorque(AbstractExternalTorque):
    """τ_e as it is: in simulation only."""

    def state(self, n: int) -> Layout:
        """Return nothing."""
        return Layout(())

    def estimate(self, y: Measurement, elapsed: cs.SX, known: Known, s: Any) -> Estimate:
        """Return y as it is."""
        return Estimate(y, cs.SX(0, 1))


@final
@dataclass(frozen=True)
class MeasuredWrench(AbstractExternalTorque):
    """τ_e = J(q)ᵀ F_e, with F_e of the wrench sensor."""

    def state(self, n: int) -> Layout:
        """Return nothing."""
        return Layout(())

    def estimate(self, y: Measurement, elapsed: cs.SX, known: Known, s: Any) -> Estimate:
        """Return y with the wrench sensor's τ_e."""
        return Estimate(y._replace(tau_e=known.arm.jacobian(y.q, known.m).T @ y.F_e), cs.SX(0, 1))


@final
@dataclass(frozen=True)
class NoTorque(AbstractExternalTorque):
    """τ_e = 0: the law takes whatever pushes the robot for inertia and error."""

    blind: ClassVar[bool] = True

    def state(self, n: int) -> Layout:
        """Return nothing."""
        return Layout(())

    def estimate(self, y: Measurement, elapsed: cs.SX, known: Known, s: Any) -> Estimate:
        """Return y with nothing external."""
        return Estimate(y._replace(tau_e=cs.SX.zeros(known.arm.n), F_e=cs.SX.zeros(6)), cs.SX(0, 1))


@final
@dataclass(frozen=True)
class MomentumObserver(AbstractExternalTorque):
    """τ_e from τ_a, q and q̇: what the momentum p = M q̇ gained beyond what the model explains.

    ṗ = τ_a + τ_e + Ṁ q̇ − C q̇ − ∇V. The mean of τ_e over a period is Δp/Δt less the mean of the known
    terms (trapezoid), low-passed with the stated bandwidth [rad/s]. F_e = J̄ᵀ τ_e.
    """

    def state(self, n: int) -> Layout:
        """Return the estimate, the last momentum and the last known torque."""
        return Layout(
            (
                Field("observed_torque", (n,), "N m", "τ_e of the observer", acts=True),
                Field("momentum", (n,), "N m s", "M q̇ at the last sample", kept=False, acts=True),
                Field(
                    "known_torque",
                    (n,),
                    "N m",
                    "τ_a + Ṁq̇ − Cq̇ − ∇V at the last sample",
                    kept=False,
                    acts=True,
                ),
                Field("observing", (), "1", "0 before the first sample", kept=False),
            )
        )

    def start(self, at: Rest) -> Remembered:
        """Return that nothing pushes."""
        known = at.running * (at.tau_a - at.weight)
        return self.state(at.q.size).zeros() | {"known_torque": known, "observing": at.running}

    def estimate(self, y: Measurement, elapsed: cs.SX, known: Known, s: Any) -> Estimate:
        """Return y with the observer's τ_e."""
        arm, m = known.arm, known.m
        q = cs.SX.sym("q", arm.n)
        dq = cs.SX.sym("dq", arm.n)
        free = cs.symvar(cs.vertcat(*(cs.vec(v) for v in vars(m).values())))
        M = arm.mass_matrix(q, m)
        inertial = cs.jtimes(M @ dq, q, dq)  # Ṁ q̇
        f = cs.Function(
            "momentum", [q, dq, *free], [M, M @ dq, inertial - arm.bias_torque(q, dq, m)], {"cse": True}
        )
        M_now, momentum, own = f(y.q, y.dq, *free)
        explained = y.tau_a + own
        mean = (momentum - s.momentum) / elapsed - (explained + s.known_torque) / 2
        first = s.observing < 1
        tau_e = cs.if_else(first, 0, low_pass(s.observed_torque, mean, known.bandwidth, elapsed))
        J = arm.jacobian(y.q, m)
        weighted = solve_spd(M_now, J.T)
        F_e = solve_spd(J @ weighted + REGULAR * cs.SX.eye(6), weighted.T @ tau_e)
        state = self.state(arm.n).stack(
            {"observed_torque": tau_e, "momentum": momentum, "known_torque": explained, "observing": 1}
        )
        return Estimate(y._replace(tau_e=tau_e, F_e=F_e), state)
