"""What the controller itself remembers from one period to the next: what is in force, what was read, and the books."""

from __future__ import annotations

from typing import Any

import casadi as cs

from passiflex.control.signals import Command
from passiflex.layout import Field, Layout
from passiflex.sampled.measurement_bound import sure
from passiflex.sampled.period import Force, Granted, Read
from passiflex.sampled.rest import Remembered, Rest
from passiflex.sampled.tank import added


def period_state(n: int, k: int) -> Layout:
    """Return the fields; energies are sums since the start."""
    return Layout(
        (
            Field("governed_position", (3,), "m", "x̂_d, the reference in force", axes=("axis",)),
            Field("governed_rotation", (3, 3), "1", "its axes", axes=("axis", "column")),
            Field(
                "held_stiffness",
                (k, k),
                "N/m, N, N m/rad",
                "K_x in force",
                axes=("task_row", "task_column"),
            ),
            Field("tank_energy", (), "J", "T"),
            Field("law_storage", (), "J", "S after the last change of the reference"),
            Field("variable_potential", (), "J", "U(K_x) − U(K_base)", kept=False),
            Field("claimed_power", (), "W", "P_D that the law claims", kept=False),
            Field("claimed_cartesian_power", (), "W", "its part in D_x", kept=False),
            Field("last_q", (n,), "rad", "measured q of the last period, as the books have it", kept=False),
            Field(
                "last_tau_a", (n,), "N m", "measured τ_a of the last period, as the books have it", kept=False
            ),
            Field("last_command", (n,), "N m", "τ_m of the last period", kept=False),
            Field("running", (), "1", "0 before the first period", kept=False),
            Field("latched", (), "1", "1 once the law has fallen back"),
            Field("measured_port_energy", (), "J", "Σ w"),
            Field("reference_energy", (), "J", "Σ ΔU: stored by changes of reference and stiffness"),
            Field("granted_energy", (), "J", "paid for changes of reference and stiffness"),
            Field("drawn_energy", (), "J", "taken from the tank by the port"),
            Field("refilled_energy", (), "J", "given to the tank"),
            Field("spilled_energy", (), "J", "refused by the cap"),
            Field("rebased_energy", (), "J", "given to T by S when the law fell back"),
            Field("lowest_level", (), "J", "least T so far"),
            Field("governed_time", (), "s", "in which the reference was held back"),
            Field("largest_lag", (), "m", "largest |x_d − x̂_d| so far, of all periods"),
            Field("faults", (), "1", "periods with a measurement that was not finite"),
            Field(
                "lost_time",
                (),
                "s",
                "since the last measurement that was finite, if it was not the last",
                kept=False,
            ),
        )
    )


def period_start(n: int, k: int, at: Rest) -> Remembered:
    """Return their values at rest."""
    return period_state(n, k).zeros() | {
        "governed_position": at.position,
        "governed_rotation": at.rotation,
        "held_stiffness": at.cartesian_stiffness,
        "tank_energy": at.level,
        "lowest_level": at.level,
        "last_q": at.running * at.q,
        "last_tau_a": at.running * at.tau_a,
        "last_command": at.command,
        "running": at.running,
    }


def period_after(
    r: Read, f: Force, granted: Granted, asked: cs.SX, command: Command, variable: cs.SX, floor: cs.SX, s: Any
) -> dict[str, cs.SX]:
    """Return their values after a period; `asked` is x_d, `variable` U(K_x) − U(K_base), `floor` that of the tank."""
    tank = added(f.tank, granted.entry)
    held_back = cs.logic_or(granted.pose_share < 1, granted.stiffness_share < 1)
    is_sure = cs.logic_or(r.first, f.lowest - r.bound.total >= floor)
    known = r.bound.state | {"storage_jitter": f.jitter}
    return {
        "governed_position": granted.pose.position,
        "governed_rotation": granted.pose.rotation,
        "held_stiffness": granted.stiffness,
        "tank_energy": tank.level,
        "law_storage": f.storage + granted.cost,
        "variable_potential": variable,
        "claimed_power": command.energy.dissipated_power,
        "claimed_cartesian_power": command.energy.cartesian_damping,
        "last_q": r.paired.q,
        "last_tau_a": r.paired.tau_a,
        "last_command": command.tau_m,
        "running": 1,
        "latched": f.latched,
        "measured_port_energy": s.measured_port_energy + f.work,
        "reference_energy": s.reference_energy + granted.cost,
        "granted_energy": s.granted_energy + tank.granted,
        "drawn_energy": s.drawn_energy + tank.drawn,
        "refilled_energy": s.refilled_energy + tank.refilled,
        "spilled_energy": s.spilled_energy + tank.spilled,
        "rebased_energy": s.rebased_energy + f.rebased,
        "lowest_level": cs.fmin(s.lowest_level, cs.fmin(f.lowest, tank.level)),
        "governed_time": s.governed_time + cs.if_else(held_back, r.elapsed, 0),
        "largest_lag": cs.fmax(s.largest_lag, cs.norm_2(asked - granted.pose.position)),
        "faults": s.faults + cs.fmin(tank.fault, 1),
        "lost_time": 0,
        **known,
        **sure(is_sure, r.paired.q, s, known | {"measurement_bound": r.bound.lasting}),
    }
