"""Energy balances of a run: storages, ports and losses, and what is left over.

Each balance says  H(t) − H(0) = supplied − dissipated + residual.  Energies are in J, ports count
positive into the system.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from passiflex.elements import Books
from passiflex.loops.sampled_loop import AT_ONCE

Array = NDArray[np.float64]


class Signals(Protocol):
    """What the books are read from: a `Run`, or the recording of one in lanes."""

    @property
    def time(self) -> Array: ...  # noqa: D102 - as in `Run`
    @property
    def failure(self) -> str: ...  # noqa: D102
    @property
    def sampled(self) -> bool: ...  # noqa: D102
    @property
    def has_tank(self) -> bool: ...  # noqa: D102
    @property
    def unbooked(self) -> str: ...  # noqa: D102
    @property
    def elements(self) -> tuple[Books, ...]: ...  # noqa: D102
    def __getitem__(self, name: str) -> Array: ...


@dataclass(frozen=True, eq=False)
class Balance:
    """One energy balance over time.

    Attributes
    ----------
    name: Which system it is about.
    storages: Energy stored in each element [J].
    supplied: Energy that came in through each port since the start [J].
    dissipated: Energy lost in each element since the start [J].
    supplied_power, dissipated_power: The same as power [W]. The jumps of a reference are energy at an
        instant, and in no power.
    """

    name: str
    storages: dict[str, Array]
    supplied: dict[str, Array]
    dissipated: dict[str, Array]
    supplied_power: dict[str, Array] = field(default_factory=dict)
    dissipated_power: dict[str, Array] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        run: Signals,
        name: str,
        storages: dict[str, Array],
        supplied: dict[str, str],
        dissipated: dict[str, str],
    ) -> Balance:
        """Return the balance whose flows are signals of the run, as in {"environment": "external"}."""
        return cls(
            name,
            storages,
            {port: run[f"{signal}_energy"] for port, signal in supplied.items()},
            {loss: run[f"{signal}_energy"] for loss, signal in dissipated.items()},
            {port: run[f"{signal}_power"] for port, signal in supplied.items()},
            {loss: run[f"{signal}_power"] for loss, signal in dissipated.items()},
        )

    @property
    def total(self) -> Array:
        """Return H(t) [J]."""
        return np.sum(list(self.storages.values()), axis=0)

    @property
    def residual(self) -> Array:
        """Return H(t) − H(0) − supplied + dissipated [J]."""
        total = self.total
        flow = np.sum(list(self.supplied.values()), axis=0) - np.sum(list(self.dissipated.values()), axis=0)
        return total - total[0] - flow

    @property
    def worst(self) -> float:
        """Return max |residual| [J]."""
        return float(np.abs(self.residual).max())


def robot_balance(run: Signals) -> Balance:
    """Return the balance of the real robot, (3)–(4): true whatever the law; its residual is the integrator's."""
    own = [e for e in run.elements if not e.outside]
    return Balance.of(
        run,
        "robot",
        {
            "links": run["link_kinetic_energy"],
            "motors": run["motor_kinetic_energy"],
            "joint springs": run["joint_spring_energy"],
            "gravity": run["potential_energy"],
            **{e.name: run[e.storage] for e in own if e.stores},
        },
        {"environment": "external", "motor torque": "motor"},
        {"joint dampers": "joint_loss"} | {f"motor {e.name}": e.name for e in own},
    )


def environment_balance(run: Signals) -> Balance:
    """Return the balance of what touches the robot from outside: what it gives it had, lost less, or was supplied with.

    Pushes of the scenario are no part of it: they give whatever they are told to.
    """
    there = [e for e in run.elements if e.outside]
    stored = {e.name: run[e.storage] for e in there if e.stores}

    def supplied(kind: str) -> dict[str, Array]:
        robot = {f"{e.name}, from the robot": -run[f"{e.given}_{kind}"] for e in there}
        beyond = {f"{e.name}, from beyond": run[f"{e.supplied}_{kind}"] for e in there if e.supplies}
        return robot | beyond

    def lost(kind: str) -> dict[str, Array]:
        return {f"{e.name}, lost": run[f"{e.name}_{kind}"] for e in there}

    return Balance(
        "environment",
        stored or {"nothing stored": np.zeros_like(run["external_energy"])},
        supplied("energy"),
        lost("energy"),
        supplied("power"),
        lost("power"),
    )


def link_balance(run: Signals) -> Balance:
    """Return the balance of the links alone, between environment and joints: true whatever the law."""
    return Balance.of(
        run,
        "links",
        {"links": run["link_kinetic_energy"], "gravity": run["potential_energy"]},
        {"environment": "external", "joints": "joint"},
        {},
    )


def claimed_balance(run: Signals) -> Balance:
    """Return the law's own books: 𝓗₂ of (28) with (29), links included.

    They close if the law's model is right. The residual is the energy that the books miss: of model
    errors, of noise, of whatever the law does not know. A sampled law keeps books at its joints instead:
    T + S against Σw, as measured; what the reference puts into S comes from the tank, or from outside.
    """
    if run.sampled:
        outside = {} if run.has_tank else {"reference": lent(run)}
        return Balance(
            "law",
            {"tank": run["tank_energy"] * run.has_tank, "law": run["law_storage"]},
            {"joints, as measured": -run["measured_port_energy"]} | outside,
            {"spilled": run["spilled_energy"]},
        )
    return Balance.of(
        run,
        "law",
        {
            "links": run["link_kinetic_energy"],
            "gravity": run["potential_energy"],
            "shaped motors": run["shaped_kinetic_energy"],
            "shaped springs": run["shaped_spring_energy"],
            "Cartesian spring": run["cartesian_spring_energy"],
            "gravity compensation": run["gravity_storage"],
            "tank": run["tank_energy"] if run.has_tank else np.zeros_like(run["tank_energy"]),
        },
        {"environment": "external", "reference": "reference"},
        {"drawn from the tank": "drawn", "dampers past the tank": "spilled"},
    )


def motor_side_storage(run: Signals) -> Array:
    """Return S̃(t) [J]: what law and motors store, with the weight that the law knows of carried.

    S̃ = ½ φ̇ᵀ B_e φ̇ + U(φ; x_d) + [V̂(q) + ½ (φ−q)ᵀ K_e (φ−q) − V_γ(φ)], with V̂ of the law's model. The
    bracket is ≥ 0, as V_γ is its minimum over q.
    """
    return (
        run["shaped_kinetic_energy"]
        + run["cartesian_spring_energy"]
        + run["shaped_spring_energy"]
        + run["compensated_energy"]
        + run["gravity_storage"]
    )


def port_energy(run: Signals) -> Array:
    """Return W̃(t) [J]: given to the links through the joints, ∫ τ_aᵀ q̇, less the weight lifted by it.

    The weight V̂ is taken where the links really are; older sampled runs know it where they were measured.
    """
    try:
        carried = run["carried_energy"]
    except KeyError:
        carried = run["compensated_energy"]
    return run["joint_energy"] - (carried - carried[0])


def port_tank(run: Signals) -> Array:
    """Return what a tank at the joint port would hold [J]: T₀ − (S̃ − S̃₀) − W̃, in which the weight cancels.

    It needs no formula for dissipation: with a perfect model it is T₀ + ∫ (P_D − P_X); otherwise it is
    what is really left of T₀.
    """
    stored = motor_side_storage(run) - run["compensated_energy"]
    return initial_tank(run) - (stored - stored[0]) - run["joint_energy"]


def lent(run: Signals) -> Array:
    """Return what the moving reference gave to a law without a tank since the first row [J]; a tank pays itself."""
    given = run["reference_energy"]
    return np.zeros_like(given) if run.has_tank else given - given[0]


def overclaimed(run: Signals) -> Array:
    """Return by how much what the law claims to have exceeds what is there, T − T_port − lent [J].

    A sampled law claims a level when it reads its sensors. In a row of a period that it missed, what it claimed at
    the last recorded reading stands.
    """
    beyond = run["tank_energy"] * run.has_tank - port_tank(run) - lent(run)
    return beyond[_last_reading(run)] if run.sampled else beyond


def _last_reading(run: Signals) -> NDArray[np.intp]:
    """Return for each row the last row up to it at which the law read its sensors; files of before say it of all."""
    rows = np.arange(len(run.time))
    try:
        read = run["read_time"]
    except KeyError:
        return rows
    return np.maximum.accumulate(np.where(run.time - read < AT_ONCE, rows, 0))


def initial_tank(run: Signals) -> float:
    """Return T₀ [J]; 0 for a law without a tank."""
    return float(run["tank_energy"][0]) if run.has_tank else 0.0
