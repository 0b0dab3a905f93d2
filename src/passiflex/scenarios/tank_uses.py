"""Which settings each kind of tank goes by, known without the tanks, as one who reads a scenario needs no CasADi."""

from __future__ import annotations

from typing import NamedTuple


class Uses(NamedTuple):
    """What a tank goes by, beside its level at the start: `accounting` is `tank_signed`, the others go by name.

    Attributes
    ----------
    always: Settings that it goes by.
    gates: Settings that only its valve goes by: they act where something is gated.
    """

    always: tuple[str, ...]
    gates: tuple[str, ...] = ()

    @property
    def all(self) -> tuple[str, ...]:
        """Return both."""
        return (*self.always, *self.gates)


CONTINUOUS = Uses(("fill", "floor", "low", "cap", "band", "accounting"))
"""Of `control.tank.EnergyTank`."""
SAMPLED = {
    "port": Uses(("floor", "low", "cap", "power", "trip", "accounting")),
    "paper": Uses(("fill", "floor", "low", "cap", "power", "accounting")),
    "time_domain": Uses(("cap", "braking"), gates=("floor", "low")),
    "variable_stiffness": Uses(("fill", "floor", "low", "cap")),
}
"""Of `sampled.tanks.TANKS`, by the name of the kind in a scenario."""
