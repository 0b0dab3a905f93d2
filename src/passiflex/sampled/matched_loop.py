"""An inner loop for slow clocks: the held torque takes the motor to where the shaped one would be.

The paper's (5) at a sample, held for a period and late by another, reduces the motor inertia to about 0.11 B
at 1 kHz before it is unstable. Here the state is predicted over the delay, the shaped motor makes one
implicit step from there, and the command is the held torque that ends at the same velocity. For the
fast part, link and motor inertia need not be known to each other: what the link does is taken from τ_a and
from a slow estimate of the acceleration, so that no M⁻¹ enters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, final

import casadi as cs
import numpy as np

from passiflex.control.inner_loop import shaped_damping
from passiflex.control.law import AbstractLaw, ImpedanceGains, ImpedanceLaw
from passiflex.control.signals import Command, LawEnergy, Measurement, Reference
from passiflex.layout import Field, Layout
from passiflex.robots.flexible import RobotNumbers
from passiflex.robots.linear_algebra import solve_spd
from passiflex.sampled.inner_loop import AbstractInnerLoop, InnerNumbers, Seen
from passiflex.sampled.rest import Remembered, Rest

SLOW = 1e-2
"""Least frequency [1/s] that is told from critical damping; over a period the difference is below 1e-8."""


class JointFlow(NamedTuple):
    """Motor against a link of given velocity, over one period: deflection and its rate, exactly.

    (δ, δ̇) relative to rest go to (stay δ + push δ̇, −K/B push δ + keep δ̇).
    """

    stay: cs.SX
    push: cs.SX
    keep: cs.SX


def joint_flow(K: cs.SX, D: cs.SX, B: cs.SX, T: cs.SX) -> JointFlow:
    """Return the flow of B δ̈ + D δ̇ + K δ = 0 over T, elementwise, under- or overdamped."""
    s = D / (2 * B)
    square = K / B - s * s
    o = cs.fmax(cs.sqrt(cs.fabs(square)), SLOW)
    swings = square > 0
    fade = cs.exp(-s * T)
    slow, fast = cs.exp((o - s) * T), cs.exp(-(o + s) * T)  # if overdamped, both ≤ 1
    push = cs.if_else(swings, fade * cs.sin(o * T), (slow - fast) / 2) / o
    mean = cs.if_else(swings, fade * cs.cos(o * T), (slow + fast) / 2)
    return JointFlow(mean + s * push, push, mean - s * push)


@final
@dataclass(frozen=True)
class MatchedInnerLoop(AbstractInnerLoop):
    """One-step matching of the motor velocity, over a delay of `late` whole periods.

    It reads motor position and joint torque: θ̇ is the difference of θ, put forward by half a period
    with the known torques; q̇ a slow difference of θ − δ; δ the deflection by the torque sensor, so that at
    rest τ_a is exactly what the outer loop wants, also with a wrong K and in contact. The damping of the
    outer loop is implicit, as the light shaped motor could not bear it held.
    """

    late: int = 1
    kind: ClassVar[str] = "matched"
    predicts: ClassVar[bool] = True

    def takes(self, law: AbstractLaw) -> bool:
        """Return whether it is the paper's law, which is taken apart."""
        return isinstance(law, ImpedanceLaw)

    def expecting(self, late: int) -> MatchedInnerLoop:
        """Return the same over another delay."""
        return self if late == self.late else MatchedInnerLoop(late)

    def state(self, n: int) -> Layout:
        """Return the last readings, the estimates, and the torques that are on their way."""
        return Layout(
            (
                Field("seen", (), "1", "0 before the first period", kept=False),
                Field("seen_theta", (n,), "rad", "θ of the last period", kept=False, acts=True),
                Field("seen_deflection", (n,), "rad", "δ for the link velocity", kept=False, acts=True),
                Field("seen_dq", (n,), "rad/s", "q̇", kept=False, acts=True),
                Field("seen_ddq", (n,), "rad/s^2", "slow acceleration", kept=False, acts=True),
                Field(
                    "in_flight",
                    (self.late + 1, n),
                    "N m",
                    "given torques, the oldest first",
                    kept=False,
                    acts=True,
                ),
            )
        )

    def start(self, at: Rest) -> Remembered:
        """Return the readings of a joint at rest, and the same torque in every period."""
        return self.state(at.q.size).zeros() | {
            "seen": at.running,
            "seen_theta": at.running * at.theta,
            "seen_deflection": at.running * at.tau_a / at.stiffness,
            "in_flight": at.running * np.tile(at.command, (self.late + 1, 1)),
        }

    def see(
        self,
        y: Measurement,
        applied: cs.SX,
        elapsed: cs.SX,
        s: Any,
        m: RobotNumbers,
        i: InnerNumbers,
    ) -> Seen:
        """Return y with q, q̇ and θ̇ estimated."""
        K, D, B = m.joint_stiffness, m.joint_damping, m.motor_inertia
        first = s.seen < 1
        past = cs.vertcat(s.in_flight[1:, :], applied.T)  # the first acted in the period that ends now
        past = cs.if_else(first, cs.repmat(applied.T, self.late + 1, 1), past)
        pull = (past[0, :].T - y.tau_a) / B
        last_theta = cs.if_else(first, y.theta, s.seen_theta)
        rate = (y.theta - last_theta) / elapsed + cs.if_else(first, 0, elapsed / 2 * pull)
        ddq = cs.if_else(first, 0, s.seen_ddq + i.acceleration_gain * (pull - s.seen_ddq))
        last = cs.if_else(first, y.tau_a / K, s.seen_deflection)
        deflection = (y.tau_a + D / elapsed * last) / (K + D / elapsed)
        moved = (y.theta - deflection) - (last_theta - last)
        difference = moved / elapsed + elapsed / 2 * ddq
        dq = (1 - i.velocity_gain) * (s.seen_dq + elapsed * ddq) + i.velocity_gain * difference
        dq = cs.if_else(first, 0, dq)
        state = self.state(y.q.shape[0]).stack(
            {
                "seen": 1,
                "seen_theta": y.theta,
                "seen_deflection": deflection,
                "seen_dq": dq,
                "seen_ddq": ddq,
                "in_flight": past,
            }
        )
        return Seen(y._replace(dq=dq, dtheta=rate), state)

    def _arrival(
        self, y: Measurement, m: RobotNumbers, flow: JointFlow, seen: Any, T: cs.SX
    ) -> tuple[cs.SX, cs.SX, cs.SX, cs.SX]:
        """Return q, q̇, δ, θ̇ when the command begins to act: a step for each torque on its way, the oldest first."""
        K, D, B, a = m.joint_stiffness, m.joint_damping, m.motor_inertia, seen.seen_ddq
        delta, v, w = (y.tau_a - D * (y.dtheta - y.dq)) / K, y.dq, y.dtheta
        q = y.theta - delta
        for k in range(1, self.late + 1):
            rest = (seen.in_flight[k, :].T - B * a) / K
            off, slip = delta - rest, w - v
            q += T * v + T**2 / 2 * a
            v += T * a
            delta = rest + flow.stay * off + flow.push * slip
            w = v - K / B * flow.push * off + flow.keep * slip
        return q, v, delta, w

    def command(
        self,
        law: AbstractLaw,
        y: Measurement,
        reference: Reference,
        m: RobotNumbers,
        g: ImpedanceGains,
        added: cs.SX,
        seen: Any,
        i: InnerNumbers,
    ) -> Command:
        """Return the torque whose hold ends at the velocity of the shaped motor."""
        assert isinstance(law, ImpedanceLaw)
        K, D, B, T = m.joint_stiffness, m.joint_damping, m.motor_inertia, i.period
        share = K / g.shaped_stiffness
        B_s = share * g.shaped_inertia  # the shaped motor, as a motor on the real spring
        a = seen.seen_ddq
        flow = joint_flow(K, D, B, T)
        q, v, delta, w = self._arrival(y, m, flow, seen, T)
        phi = q + share * delta  # (11)
        outer = law.outer(phi, q, reference, m, g)
        force = outer.torque + added
        v_end, slip = v + T * a, w - v
        R = cs.diag(share)
        impulse = T / B_s / (1 + T * D / B_s + T**2 * K / B_s)
        # One backward-Euler step of the shaped motor on the real spring, its damping implicit.
        drive = v_end / impulse + B_s / T * slip + force - K * delta - g.shaped_inertia * a
        drive -= outer.damping @ ((1 - share) * v_end)
        w_end = solve_spd(cs.diag(share / impulse) + R @ outer.damping @ R, share * drive)
        tau_m = K * delta + B * a + B / flow.push * (w_end - v_end - flow.keep * slip)

        now = law.stored(y, m, g)
        stretch = now.dphi - y.dq
        energy = LawEnergy(
            motor_kinetic=now.motor_kinetic,
            joint_spring=now.joint_spring,
            cartesian_spring=law.task.potential(now.pose, reference.pose, g.stiffness),
            gravity_storage=now.gravity_storage,
            joint_damping=cs.dot(stretch, shaped_damping(K, D, g.shaped_stiffness) * stretch),
            cartesian_damping=cs.dot(now.dphi, outer.cartesian_damping @ now.dphi),
            null_space_damping=cs.dot(now.dphi, (outer.damping - outer.cartesian_damping) @ now.dphi),
            reference_power=cs.SX(0),
        )
        return Command(tau_m, force - outer.damping @ now.dphi, now.phi, now.dphi, energy)
