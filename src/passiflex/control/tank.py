"""(19)–(23): the energy tank, in the energy T = n²/2 itself, so that nothing is divided by its level."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import casadi as cs

from passiflex.layout import Field, Layout

NO_CAP = 1e9
"""Level [J] that stands for a tank without a cap; an infinite one would make derivatives ∞ · 0."""


class EnergyTankNumbers(Protocol):
    """The numbers of a tank in symbols, as `EnergyTank.layout` says."""

    tank_fill: cs.SX
    tank_floor: cs.SX
    tank_low: cs.SX
    tank_cap: cs.SX
    tank_band: cs.SX
    tank_signed: cs.SX


class TankFlow(NamedTuple):
    """The rates of one tank [W], and its two valves.

    Attributes
    ----------
    rate: Ṫ = α P_D − drawn, (23).
    drawn: |P_X| in the paper's accounting, P_X in the signed one.
    spilled: What the tank does not take, dissipated for good: (1 − α) P_D, and near the cap of what the
        signed accounting would get back from the reference.
    fill: α, 0..1.
    """

    rate: cs.SX
    drawn: cs.SX
    spilled: cs.SX
    fill: cs.SX


def smoothstep(x: cs.SX) -> cs.SX:
    """Return 0 below 0, 1 above 1, and 3x² − 2x³ between."""
    y = cs.fmin(cs.fmax(x, 0), 1)
    return y * y * (3 - 2 * y)


@dataclass(frozen=True)
class EnergyTank:
    """The paper's tank, with floor, cap and fill.

    P_D fills it, the motion of the reference draws from it. Near the cap all inflow fades out
    over `tank_band` and the rest is spilled. Between `tank_low` and the floor the valve β fades out the
    motion of the reference (its clock runs slower and stops), which renders P_X = 0 as the paper asks.
    """

    layout: Layout = Layout(
        (
            Field("tank_fill", (), "1", "α when the tank is not full, 0..1"),
            Field("tank_floor", (), "J", "level that the reference never draws below"),
            Field("tank_low", (), "J", "level below which the reference slows down"),
            Field("tank_cap", (), "J", "level above which energy is spilled; `NO_CAP` for none"),
            Field("tank_band", (), "J", "width over which the inflow fades out below the cap"),
            Field("tank_signed", (), "1", "0: draws |P_X| as the paper; 1: draws P_X"),
        ),
        EnergyTankNumbers,
    )

    def valve(self, level: cs.SX, g: EnergyTankNumbers) -> cs.SX:
        """Return β(T): 0 at the floor, 1 above `tank_low`."""
        return smoothstep((level - g.tank_floor) / (g.tank_low - g.tank_floor))

    def flow(
        self, level: cs.SX, dissipated_power: cs.SX, reference_power: cs.SX, g: EnergyTankNumbers
    ) -> TankFlow:
        """Return (23) at the level T [J] under P_D and P_X [W]."""
        room = 1 - smoothstep((level - g.tank_cap) / g.tank_band + 1)
        drawn = cs.if_else(g.tank_signed > 0, reference_power, cs.fabs(reference_power))
        returned = cs.fmax(-drawn, 0)  # what the signed accounting gets back from the reference
        fill = g.tank_fill * room
        refused = (1 - room) * returned
        rate = fill * dissipated_power - drawn - refused
        return TankFlow(rate, drawn, (1 - fill) * dissipated_power + refused, fill)


def jump_cost(stored: float, *, signed: bool) -> float:
    """Return what a jump that changes the spring's potential by `stored` [J] takes from the tank.

    (21) is a delta function there; its integral is the exact change of the potential (theory note 2.7).
    """
    return stored if signed else abs(stored)
