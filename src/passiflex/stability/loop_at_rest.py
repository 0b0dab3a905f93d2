"""A sampled loop that has been at rest for long: where it stands, what its controller remembers and is told."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.control.rigid import RigidImpedanceLaw
from passiflex.layout import Layout
from passiflex.loops.plant import Plant
from passiflex.loops.sampled_loop import SampledLoop
from passiflex.problems.posture import Posture, posture
from passiflex.problems.problem import Problem

Array = NDArray[np.float64]

BRIMFUL = 1e6
"""Level [J] of a tank that holds nothing back."""
AT_REST = ("shaped_stiffness", "stiffness", "damping")
"""Gains that decide where a loop rests and what it then remembers."""


class Standing(NamedTuple):
    """A robot at rest under its weight.

    Attributes
    ----------
    q, theta: (n,).
    held: The motor torque that holds it (n,) [N m].
    plant: Its numbers, flat, as `Plant.parameters`.
    arm: It at q, by these numbers.
    """

    q: Array
    theta: Array
    held: Array
    plant: Array
    arm: Posture


class AtRest(NamedTuple):
    """Memory and row of a period at rest, flat: `SampledLoop.memory` and `SampledLoop.row`; and φ (n,)."""

    memory: Array
    row: Array
    phi: Array


def standing(problem: Problem, q: Array | None = None, plant: Mapping[str, Array] | None = None) -> Standing:
    """Return the problem's robot at rest: at its start, or at another q; itself, or with other numbers (by name)."""
    s = problem.sampling
    assert s is not None
    robot, layout = problem.law.robot, Plant(problem.law.robot).parameters
    true = layout.unpack(s.plant) | dict(plant or {})
    where = problem.q if q is None else q
    here = posture(robot, where, true)
    if q is None and not plant:
        return Standing(where, problem.theta, s.held, s.plant, here)
    weight = here.gravity_torque
    return Standing(where, where + weight / true["joint_stiffness"], weight, layout.pack(true), here)


def loop_at_rest(
    problem: Problem,
    loop: SampledLoop,
    gains: Mapping[str, ArrayLike],
    period: float,
    at: Standing | None = None,
) -> AtRest:
    """Return what a period finds and leaves unchanged, with the gains in place of the problem's and a full tank."""
    p, at = problem, at or standing(problem)
    model, plant = loop.parameters.model.unpack(p.model), loop.parameters.plant.unpack(at.plant)
    K = model["joint_stiffness"]
    stretch = at.theta - at.q
    shaped = (
        at.theta
        if isinstance(p.law, RigidImpedanceLaw)
        else at.q + K / np.asarray(gains["shaped_stiffness"]) * stretch
    )
    home = posture(p.law.robot, shaped, model).pose
    tau_a = plant["joint_stiffness"] * stretch
    weight = posture(p.law.robot, at.q, model).gravity_torque
    known: dict[str, Any] = {
        "started": 1.0,
        "read_q": at.q,
        "read_theta": at.theta,
        "read_tau_a": tau_a,
        "governed_position": home.position,
        "governed_rotation": home.rotation,
        "held_stiffness": gains["stiffness"],
        "tank_energy": BRIMFUL,
        "last_q": at.q,
        "last_tau_a": tau_a,
        "known_torque": tau_a - weight,
        "observing": 1.0,
        "seen": 1.0,
        "seen_theta": at.theta,
        "seen_deflection": tau_a / K,
        "last_command": at.held,
        "given_torque": at.held,
    }
    row: dict[str, Any] = {
        "desired_position": home.position,
        "desired_rotation": home.rotation,
        "desired_stiffness": gains["stiffness"],
        "desired_damping": gains["damping"],
        "elapsed": period,
    }
    known |= {f.name: np.tile(at.held, (f.shape[0], 1)) for f in loop.memory if f.name == "in_flight"}
    return AtRest(_packed(loop.memory, known), _packed(loop.row, row), shaped)


def _packed(layout: Layout, known: Mapping[str, Any]) -> Array:
    return layout.pack({f.name: known.get(f.name, np.zeros(f.shape)) for f in layout})
