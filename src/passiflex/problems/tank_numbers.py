"""The tank of a scenario in numbers: its levels, and the parameters of the one in continuous time."""

from __future__ import annotations

from passiflex.control.tank import NO_CAP
from passiflex.problems.problem import TankStart
from passiflex.scenarios.scenario import Scenario


def tank_start(scenario: Scenario) -> TankStart:
    """Return the tank at the start; an empty one for a law without a tank."""
    t = scenario.tank
    return TankStart(t.initial, t.floor, t.cap, t.signed) if t else TankStart(0, 0, 0, False)


def tank_gains(scenario: Scenario) -> dict[str, float]:
    """Return the numbers of `EnergyTank.layout`."""
    t = scenario.tank
    values = (
        {
            "fill": t.fill,
            "floor": t.floor,
            "low": t.low,
            "cap": min(t.cap, NO_CAP),
            "band": t.band,
            "signed": t.signed,
        }
        if t
        else {"fill": 0, "floor": 0, "low": 1, "cap": NO_CAP, "band": 1, "signed": 0}
    )
    return {f"tank_{name}": float(value) for name, value in values.items()}
