"""Four sampled tanks: the paper's, the one at the joint port, and two that readers know."""

from __future__ import annotations

from typing import ClassVar, final

import casadi as cs

from passiflex.sampled.tank import AbstractTank, PeriodFlows, TankNumbers


@final
class PortTank(AbstractTank):
    """T_k+1 = T_k − (S_k+1 − S_k) − w_k (theory note 4): exact, whatever happened in between.

    With it T + S + Σw is constant, so Σw ≤ S₀ + T₀ − S as long as T ≥ 0: passivity at the joints, for any
    controller inside, from measured τ_a, q and the storage alone. S ≥ 0 if the law carries no weight; if it
    does, S + V̂(q) ≥ 0 with the weight V̂ of its model, and Σw − (V̂ − V̂₀) ≤ S₀ + V̂₀ + T₀.
    """

    kind: ClassVar[str] = "port"
    title: ClassVar[str] = "port tank"
    reads: ClassVar[tuple[str, ...]] = ("storage_change", "port_energy")
    measures: ClassVar[bool] = True
    falls_back: ClassVar[bool] = True

    def flow(self, flows: PeriodFlows, g: TankNumbers) -> cs.SX:
        """Return −ΔS − w."""
        return -flows.storage_change - flows.port_energy


@final
class PaperTank(AbstractTank):
    """(19)–(23) at the samples: T_k+1 = T_k + α P_D Δt − |ΔU|.

    P_D is the law's formula, in which sampling, delay, saturation and noise do not occur: under them it
    credits energy that nobody dissipated.
    """

    kind: ClassVar[str] = "paper"
    title: ClassVar[str] = "paper's tank"
    reads: ClassVar[tuple[str, ...]] = ("claimed_loss",)

    def flow(self, flows: PeriodFlows, g: TankNumbers) -> cs.SX:
        """Return α P_D Δt."""
        return g.tank_fill * flows.claimed_loss


@final
class TimeDomainTank(AbstractTank):
    """Passivity observer and controller in the time domain, after Hannaford and Ryu (2002).

    The observer is E_k+1 = E_k − w_k, started at T₀. It takes the weight that the links lift for energy given
    away, so it is for robots that carry their own. The controller acts when E < 0: it adds, in the
    same period, the damping −E / (Δt |φ̇|²) that would pay the debt within it, at most α_max. It gates no
    reference: what that gives shows at the port a moment later.
    """

    kind: ClassVar[str] = "time_domain"
    title: ClassVar[str] = "time-domain passivity control"
    reads: ClassVar[tuple[str, ...]] = ("port_energy",)
    charges: ClassVar[bool] = False
    gates: ClassVar[bool] = False
    measures: ClassVar[bool] = True

    def flow(self, flows: PeriodFlows, g: TankNumbers) -> cs.SX:
        """Return −w."""
        return -flows.port_energy

    def braking(self, level: cs.SX, speed_squared: cs.SX, elapsed: cs.SX, g: TankNumbers) -> cs.SX:
        """Return α = min(−E / (Δt |φ̇|²), α_max) while E < 0."""
        debt = cs.fmax(-level, 0)
        work = elapsed * speed_squared  # per unit of damping
        payable = work * g.tank_braking > debt
        return cs.if_else(payable, debt / cs.fmax(work, 1e-300), cs.if_else(debt > 0, g.tank_braking, 0))


@final
class VariableStiffnessTank(AbstractTank):
    """The tank of Ferraguti, Secchi and Fantuzzi (2013), for a stiffness that changes in flight.

    The spring's part above the base stiffness, K_x − K_base, takes its energy from the tank and gives it
    back: T_k+1 = T_k + α ẋᵀD_xẋ Δt + work done on that part. As the tank runs empty, that part is switched
    off. A change of the stiffness is free, and the reference is not gated.
    """

    kind: ClassVar[str] = "variable_stiffness"
    title: ClassVar[str] = "tank for variable stiffness"
    reads: ClassVar[tuple[str, ...]] = ("claimed_cartesian_loss", "variable_spring_work")
    charges: ClassVar[bool] = False
    gates: ClassVar[bool] = False

    def flow(self, flows: PeriodFlows, g: TankNumbers) -> cs.SX:
        """Return α ẋᵀD_xẋ Δt and the work on the variable part."""
        return g.tank_fill * flows.claimed_cartesian_loss + flows.variable_spring_work

    def stiffness_share(self, level: cs.SX, g: TankNumbers) -> cs.SX:
        """Return β(T)."""
        return self.valve(level, g)


TANKS: dict[str, type[AbstractTank]] = {
    tank.kind: tank for tank in (PortTank, PaperTank, TimeDomainTank, VariableStiffnessTank)
}
"""By the name of their kind in a scenario."""
