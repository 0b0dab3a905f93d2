"""What one sample of a sampled loop consists of, by name: the same for a run alone and for runs in lanes."""

from __future__ import annotations

from passiflex.layout import Field, Layout
from passiflex.loops.plant import PLANT_ENERGIES
from passiflex.loops.sampled_loop import SampledLoop

INTERNAL = (
    "started", "read_q", "read_theta", "read_dq", "read_dtheta", "read_tau_a", "read_wrench", "last_q",
    "last_tau_a", "last_command", "running", "given_torque", "claimed_power", "claimed_cartesian_power",
    "variable_potential", "seen", "seen_theta", "seen_deflection", "seen_dq", "seen_ddq", "in_flight",
    "momentum", "known_torque", "observing", "lost_time",
    "walk", "bent", "unread_energy", "curved_energy", "withheld_energy", "joint_work", "first_q", "first_torque",
    "slow_q", "raw_tau_a", "step_q", "step_tau_a", "step_time",
)  # fmt: skip
"""Memory of the controller that is of no interest to a reader, or is recorded under another name."""
WISHED = ("desired_position", "desired_rotation")
"""What of the row is reported."""


def sample_parts(loop: SampledLoop) -> dict[str, Layout]:
    """Return the parts of one sample, in their order, by the names of `LaneLoop.instant`."""
    robot = loop.controller.law.robot
    n, (angle, speed, torque) = robot.n, robot.arm.chain.joint_units
    state = (
        Field("q", (n,), angle, "link position"),
        Field("theta", (n,), angle, "motor position"),
        Field("dq", (n,), speed, "link velocity"),
        Field("dtheta", (n,), speed, "motor velocity"),
    )
    return {
        "x": Layout(state),
        "quads": Layout(tuple(f._replace(name=f"{f.name}_energy") for f in PLANT_ENERGIES)),
        "controller": loop.memory,
        "command": Layout((Field("tau_m", (n,), torque, "motor torque in force"),)),
        "signals": loop.signals,
        "truth": loop.truth,
        "row": loop.row,
    }


def reported(part: str, layout: Layout) -> Layout:
    """Return the fields of a part that a reader gets to see."""
    if part == "row":
        return Layout(tuple(f for f in layout if f.name in WISHED))
    return Layout(tuple(f for f in layout if part != "controller" or f.name not in INTERNAL))
