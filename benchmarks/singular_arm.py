"""A UR10 that starts with its wrist stretched, under operational-space control and under the law of this package.

Three far goals, as in the report of an arm that ran away (field notes: error 1.55 m, 34.7 rad/s,
1.3e4 N m). Operational-space control is Λ (K_p e − K_d ẋ) with Λ = (J M⁻¹ Jᵀ)⁻¹, which is the rigid law with a target
inertia of one, here with the motors' inertia known; it is not defined at the start itself and begins 0.01 rad beside.
Run it with: python benchmarks/singular_arm.py
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from passiflex.control.posture import posture
from passiflex.robots import FlexibleJointRobot
from passiflex.scenarios.scenario_file import parse_scenario
from passiflex.simulation import resolve
from passiflex.simulation.simulate_sampled import simulate_unchecked

Array = NDArray[np.float64]

START = (0.0, -1.712, 1.712, 0.0, 0.0, 0.0)
"""Upper arm and forearm bent, and the axes of the fourth and sixth joint parallel: J has lost a rank."""
BESIDE = 0.01
"""[rad] How far from there a law starts that is not defined there."""
STAYS, LONG = 3.0, 10.0
"""[s] How long each goal stays; and for how long the law of this package is given it once more."""
GOALS = (
    ((0.6, 0.15, 0.3), (0.0, 0.924, 0.0, 0.383)),
    ((0.6, -0.3, 0.3), (0.0, 0.924, 0.0, 0.383)),
    ((0.8, 0.0, 0.5), (0.924, 0.0, 0.383, 0.0)),
)
"""Positions [m] and quaternions (w, x, y, z) in the base."""
RATE = 500.0
OWN = {
    "type": "impedance",
    "task": "pose",
    "shaped_stiffness": {"ratio": 1},
    "shaped_inertia": {"ratio": 1},
    "stiffness": {"translation": 300, "rotation": 30},
    "damping": {"translation": 150, "rotation": 15},
    "null_space_damping": 5,
}


class Outcome(NamedTuple):
    """What became of the three goals: errors at their ends [m], and extremes [rad/s, N m]."""

    errors: tuple[float, ...]
    speed: float
    torque: float


def operational_space(stiffness: float) -> dict[str, Any]:
    """Return the law Λ (K_p e − 2 √K_p ẋ) for K_p [1/s²]."""
    return {
        "type": "rigid",
        "task": "pose",
        "gravity": "model",
        "stiffness": {"translation": stiffness, "rotation": stiffness},
        "damping": {"translation": 2 * stiffness**0.5, "rotation": 2 * stiffness**0.5},
        "target_inertia": {"matrix": np.eye(6).tolist()},
        "motor_inertia": "carried",
        "regularisation": 0,
    }


def outcome(law: dict[str, Any], stays: float = STAYS, *, limits: bool, tank: bool = False) -> Outcome:
    """Run a law to the goals, each for `stays` seconds, and return what became of it."""
    robot = FlexibleJointRobot.load("ur10")
    beside = [0, 0, 0, 0, 0 if law["type"] == "impedance" else BESIDE, 0]
    q = np.add(START, beside)
    scenario = {
        "name": "singular",
        "robot": "ur10",
        "posture": q.tolist(),
        "law": law,
        "control": {"rate": RATE, "delay": 1 / RATE, "external_torque": "none", "allow_unstable": True},
        "sensors": {"velocity": "differences"},
        "reference": _goals(robot, q, stays),
        "duration": stays * len(GOALS),
        "output_interval": 1 / RATE,
    }
    if limits:
        scenario["motors"] = {"torque_limit": "robot"}
    if tank:
        scenario["tank"] = {"kind": "port", "initial": 5.0}
    run = simulate_unchecked(resolve(parse_scenario(yaml.safe_dump(scenario))))
    ends = [np.searchsorted(run.time, (i + 1) * stays - 1e-9) for i in range(len(GOALS))]
    rows = [
        run["position"][min(int(end), len(run.time) - 1)] for end in ends
    ]  # the last one of a run that failed
    errors = tuple(float(np.linalg.norm(row - goal)) for row, (goal, _) in zip(rows, GOALS, strict=True))
    return Outcome(errors, float(np.abs(run["dq"]).max()), float(np.abs(run["tau_m"]).max()))


def _goals(robot: FlexibleJointRobot, q: Array, stays: float) -> list[dict[str, Any]]:
    at = posture(robot, q, robot.nominal()).pose
    place, turn, events = at.position, at.rotation, []
    for i, (position, (w, *rest)) in enumerate(GOALS):
        goal = Rotation.from_quat([*rest, w]).as_matrix()
        by = (np.array(position) - place).tolist()
        turned = Rotation.from_matrix(goal @ turn.T).as_rotvec().tolist()
        events.append({"at": i * stays, "kind": "step", "by": by, "turn": turned})
        place, turn = np.array(position), goal
    return events


def main() -> None:
    """Print the laws beside each other."""
    print(f"{'law':52}{'error at the ends, m':>26}{'speed, rad/s':>14}{'torque, N m':>13}")
    for k in (100.0, 420.0):
        for limits in (False, True):
            name = f"operational space, K_p {k:g} 1/s²{', torque limits' if limits else ''}"
            _print(name, outcome(operational_space(k), limits=limits))
    for stays in (STAYS, LONG):
        _print(
            f"this package, torque limits, tank 5 J, {stays:g} s each",
            outcome(OWN, stays, limits=True, tank=True),
        )


def _print(name: str, found: Outcome) -> None:
    errors = "  ".join(f"{error:.4f}" for error in found.errors)
    print(f"{name:52}{errors:>26}{found.speed:14.2f}{found.torque:13.0f}")


if __name__ == "__main__":
    main()
