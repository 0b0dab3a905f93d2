"""What every sampled energy tank is: books in joules, kept once per control period."""

from __future__ import annotations

import abc
from typing import ClassVar, NamedTuple, Protocol

import casadi as cs

from passiflex.control.tank import smoothstep
from passiflex.layout import Field, Layout

UNLIMITED = 1e9
"""A budget [J] that stands for none."""
LARGEST = 1e100
"""Numbers above this one, infinities and NaN are no measurements: energies are squares of what passes."""


class PeriodFlows(NamedTuple):
    """What happened in the control period that ends now [J], measured or claimed.

    Attributes
    ----------
    elapsed: Time since the last period that ran [s].
    port_energy: w = ½ (τ_a,k + τ_a,k+1)ᵀ (q_k+1 − q_k), measured: given to the links.
    storage_change: S_k+1 − S_k at the old reference, from measured positions and velocities.
    claimed_loss: P_D Δt, what the law's formula says was dissipated.
    claimed_cartesian_loss: The part of it in D_x.
    variable_spring_work: Change of U(K_x) − U(K_base) at the old reference: work done on the part of
        the Cartesian spring that exceeds the base stiffness.
    """

    elapsed: cs.SX
    port_energy: cs.SX
    storage_change: cs.SX
    claimed_loss: cs.SX
    claimed_cartesian_loss: cs.SX
    variable_spring_work: cs.SX


class TankEntry(NamedTuple):
    """One line of a tank's books [J]: level = before − granted − drawn + refilled − spilled.

    Attributes
    ----------
    level: T after this entry.
    granted: Paid for a change of the reference or of the stiffness.
    drawn: Taken by whatever else gave energy: gated actions, or a loop that is active.
    refilled: What came in, spilled or not.
    spilled: What came in and did not fit below the cap.
    fault: 1 if a number of the request was not finite; nothing else changed then.
    """

    level: cs.SX
    granted: cs.SX
    drawn: cs.SX
    refilled: cs.SX
    spilled: cs.SX
    fault: cs.SX


class TankNumbers(Protocol):
    """The numbers of a sampled tank in symbols, as `AbstractTank.layout` says."""

    tank_floor: cs.SX
    tank_low: cs.SX
    tank_cap: cs.SX
    tank_power: cs.SX
    tank_trip: cs.SX
    tank_signed: cs.SX
    tank_fill: cs.SX
    tank_braking: cs.SX


class AbstractTank(abc.ABC):
    """An energy tank with levels, sampled: its `flow`, and a few words on what it does.

    A tank never lifts its level for nothing, never divides by it, and knows measured quantities only. Each period it
    is settled, then pays within its budget, then says how far its valve is open.

    Attributes
    ----------
    kind, title: Its name in a scenario, and in words.
    reads: The fields of `PeriodFlows` that its flow is made of.
    charges: Whether a change of the reference or of the stiffness costs anything.
    gates: Whether what it grants has a bound.
    measures: Whether the level follows from the measured port: what that may get wrong is then not granted.
    falls_back: Whether a level below `tank_trip` means that the loop is active.
    """

    layout: ClassVar[Layout] = Layout(
        (
            Field("tank_floor", (), "J", "T_min: nothing is granted below"),
            Field("tank_low", (), "J", "T_low: the valve begins to close below"),
            Field("tank_cap", (), "J", "T_max: more is spilled"),
            Field("tank_power", (), "W", "P_max: most that the reference is granted"),
            Field("tank_trip", (), "J", "below it the law falls back for good"),
            Field("tank_signed", (), "1", "0: a change of the reference costs |ΔU|; 1: it costs ΔU"),
            Field("tank_fill", (), "1", "α: share of the claimed loss that is credited, if any is"),
            Field("tank_braking", (), "N m s/rad", "α_max: most damping that the tank adds, if it adds any"),
        ),
        TankNumbers,
    )
    kind: ClassVar[str] = ""
    title: ClassVar[str] = ""
    reads: ClassVar[tuple[str, ...]] = ()
    charges: ClassVar[bool] = True
    gates: ClassVar[bool] = True
    measures: ClassVar[bool] = False
    falls_back: ClassVar[bool] = False

    @abc.abstractmethod
    def flow(self, flows: PeriodFlows, g: TankNumbers) -> cs.SX:
        """Return what comes in for the period that ends now, out if negative [J]."""

    def settle(self, level: cs.SX, flows: PeriodFlows, g: TankNumbers) -> TankEntry:
        """Return the entry for the period that ends now."""
        ok = finite(level, *(getattr(flows, name) for name in self.reads))
        return booked(level, granted=0, flow=self.flow(flows, g), cap=g.tank_cap, ok=ok)

    def pay(self, level: cs.SX, cost: cs.SX, g: TankNumbers) -> TankEntry:
        """Return the entry for a change of the reference or of the stiffness that stores `cost` [J]."""
        if self.charges:
            return paid(level, cost, g)
        return booked(level, granted=0, flow=0, cap=g.tank_cap, ok=finite(level, cost))

    def budget(self, level: cs.SX, elapsed: cs.SX, g: TankNumbers) -> cs.SX:
        """Return what may be granted now [J], ≥ 0."""
        return above_floor(level, elapsed, g) if self.gates else cs.SX(UNLIMITED)

    def braking(self, level: cs.SX, speed_squared: cs.SX, elapsed: cs.SX, g: TankNumbers) -> cs.SX:
        """Return the damping [N m s/rad] that the tank adds to the motors in this period, ≥ 0."""
        return cs.SX(0)

    def stiffness_share(self, level: cs.SX, g: TankNumbers) -> cs.SX:
        """Return how much of the stiffness above the base one may act, 0..1."""
        return cs.SX(1)

    def valve(self, level: cs.SX, g: TankNumbers) -> cs.SX:
        """Return β(T): 0 at T_min, 1 from T_low on."""
        return smoothstep((level - g.tank_floor) / (g.tank_low - g.tank_floor))


def finite(*numbers: cs.SX, below: float = LARGEST) -> cs.SX:
    """Return 1 if all numbers are, and smaller than `below` also together, else 0."""
    return sum(cs.sum1(cs.fabs(cs.vec(cs.densify(cs.SX(number))))) for number in numbers) < below


def booked(level: cs.SX, *, granted: cs.SX | float, flow: cs.SX | float, cap: cs.SX, ok: cs.SX) -> TankEntry:
    """Return the entry that grants `granted` and takes `flow` in (out if negative), spilling what the cap refuses."""
    zero = cs.SX(0)
    granted, flow = cs.if_else(ok, granted, zero), cs.if_else(ok, flow, zero)
    drawn, refilled = cs.fmax(-flow, 0), cs.fmax(flow, 0)
    full = level - granted + flow
    most = cs.fmax(
        cap, level - granted
    )  # what a fallback's rebasing put above the cap may stay; nothing may come to it
    spilled = cs.fmin(cs.fmax(full - most, 0), refilled)
    after = cs.if_else(spilled > 0, most, full)  # full − spilled, but not rounded to what came in
    return TankEntry(after, granted, drawn, refilled, spilled, 1 - ok)


def unchanged(level: cs.SX) -> TankEntry:
    """Return an entry of nothing."""
    return TankEntry(level, *(cs.SX(0) for _ in range(5)))


def added(first: TankEntry, second: TankEntry) -> TankEntry:
    """Return two entries in a row as one."""
    sums = (a + b for a, b in zip(first[1:], second[1:], strict=True))
    return TankEntry(second.level, *sums)


def paid(level: cs.SX, cost: cs.SX, g: TankNumbers) -> TankEntry:
    """Return the entry of a cost: ΔU if the tank is signed, |ΔU| as the paper has it otherwise."""
    signed, ok = g.tank_signed > 0, finite(level, cost)
    granted = cs.if_else(signed, cs.fmax(cost, 0), cs.fabs(cost))
    returned = cs.if_else(signed, cs.fmax(-cost, 0), 0)
    return booked(level, granted=granted, flow=returned, cap=g.tank_cap, ok=ok)


def above_floor(level: cs.SX, elapsed: cs.SX, g: TankNumbers) -> cs.SX:
    """Return min(T − T_min, P_max Δt), at least 0 [J]; 0 if one of the two is no number."""
    most = cs.fmax(cs.fmin(level - g.tank_floor, g.tank_power * elapsed), 0)
    return cs.if_else(finite(level, elapsed), most, 0)
