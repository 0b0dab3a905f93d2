"""Where the energy is, and what the tank's books are worth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from passiflex.diagrams.events import marks_of, spans_of
from passiflex.diagrams.panel import Array, Curve, Level, Panel
from passiflex.diagrams.viewed import Viewed, curve, curves, other_role, with_curves
from passiflex.passivity import available_energy, port_tank
from passiflex.passivity.ledger import motor_side_storage
from passiflex.runs.run import Run


def energy_panels(viewed: Viewed, others: Sequence[Viewed] = ()) -> tuple[Panel, ...]:
    """Return the energies, and the level of the tank as the law claims it beside what is really there."""
    run, spans, marks = viewed.run, spans_of(viewed.run), marks_of(viewed.run)
    floor = _floor(run)
    compared = [c for k, other in enumerate(others) for c in _compared(other, other_role(k))]
    energies = Panel(
        kind="energy",
        choice="energies",
        title="energy",
        unit="J",
        curves=(*_energies(run), *compared),
        levels=floor,
        spans=spans,
        marks=marks,
    )
    books = Panel(
        kind="energy",
        choice="books",
        title="tank and what is there",
        unit="J",
        curves=_books(run),
        levels=(*floor, Level(0.0, "nothing left")),
        spans=spans,
        marks=marks,
    )
    return with_curves(energies, books)


def kinetic(run: Run) -> Array:
    """Return ½ q̇ᵀ M q̇ + ½ φ̇ᵀ B_e φ̇ [J], of links and shaped motors."""
    return run["link_kinetic_energy"] + run["shaped_kinetic_energy"]


def springs(run: Run) -> Array:
    """Return the energy [J] of Cartesian spring and shaped joint springs, with the weight that they carry.

    U + ½ (φ−q)ᵀ K_e (φ−q) + V(q) − V_γ(φ). The weight belongs to the springs that are bent by it: V alone
    has no zero, and − V_γ is claimed by the law's compensation.
    """
    return (
        run["cartesian_spring_energy"]
        + run["shaped_spring_energy"]
        + run["potential_energy"]
        + run["gravity_storage"]
    )


def robot_energy(run: Run) -> Array:
    """Return 𝓗₁ of (14) with the links [J]: what is stored beside the tank.

    Of the rigid law, which shapes nothing, the shaped motors and springs are the real ones.
    """
    return kinetic(run) + springs(run)


def total_energy(run: Run) -> Array:
    """Return 𝓗₂ = 𝓗₁ + T of (28) [J], of a sampled run as well; 𝓗₁ for a law without a tank.

    As 𝓗₁ = link energy + S̃ − weight carried, 𝓗₂(t) − 𝓗₂(0) is the energy that the environment gave plus
    what the tank claims beyond the tank at the port.
    """
    return robot_energy(run) + (run["tank_energy"] if run.has_tank else 0.0)


def _energies(run: Run) -> tuple[Curve, ...]:
    tank = run.data.attrs.get("has_tank")
    return curves(
        curve(run, "total H₂ = H₁ + T" if tank else "total H₁", "total", lambda: total_energy(run)),
        # without a tank the total is the robot's
        curve(run, "robot H₁", "robot", lambda: robot_energy(run)) if tank else None,
        curve(run, "tank T, as claimed", "tank", lambda: run["tank_energy"]) if tank else None,
        curve(run, "kinetic: links, motors", "kinetic", lambda: kinetic(run)),
        curve(run, _spring_label(run), "spring", lambda: springs(run)),
    )


def _spring_label(run: Run) -> str:
    carried = any(np.any(run[name]) for name in ("potential_energy", "gravity_storage") if name in run.data)
    return "springs: Cartesian, joints" + (", weight carried" if carried else "")


def _compared(other: Viewed, role: str) -> tuple[Curve, ...]:
    run = other.run
    tank = run.data.attrs.get("has_tank")
    return curves(
        curve(run, f"total, {other.label}", f"{role} total", lambda: total_energy(run)),
        curve(run, f"tank, {other.label}", role, lambda: run["tank_energy"]) if tank else None,
    )


def _books(run: Run) -> tuple[Curve, ...]:
    """Return level claimed, level there, and what may still be given; of a law without a tank, the last alone."""
    tank = run.data.attrs.get("has_tank")
    return curves(
        curve(run, "tank T, as claimed", "tank", lambda: run["tank_energy"]) if tank else None,
        curve(run, "T that is really there", "true", lambda: port_tank(run)) if tank else None,
        curve(run, "what may still be given", "available", lambda: _available(run)),
    )


def _available(run: Run) -> Array:
    """Return the energy that may still be given; a gap stays a gap, though the budget looks at the whole run."""
    sound = np.isfinite(motor_side_storage(run))
    if sound.all() or not sound[0]:
        return available_energy(run)
    values = np.full(run.time.size, np.nan)
    values[sound] = available_energy(Run(run.data.isel(time=np.flatnonzero(sound))))
    return values


def _floor(run: Run) -> tuple[Level, ...]:
    scenario = run.scenario
    if scenario is None or scenario.tank is None:
        return ()
    return (Level(scenario.tank.floor, "T_min, floor of the tank"),)
