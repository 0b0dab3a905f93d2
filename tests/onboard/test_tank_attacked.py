"""Set-points at random, on arms of five makes that integrate their own ports: no more than the tank, whatever is asked.

`python tests/onboard/test_tank_attacked.py ARM RUNS SEED` searches on, and prints the worst.
"""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from onboard.arms import ElasticArm
from passiflex.errors import UnstableLoopError
from passiflex.onboard import Controller, Sensed, Setpoint, WatchSettings
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.scenario_file import parse_scenario

Array = np.ndarray


class Case(NamedTuple):
    """An arm, where it stands, its clock [Hz], what it says, noise of its torque [N m], steps of its plant."""

    robot: str
    posture: tuple[float, ...]
    rate: int
    says: tuple[str, ...]
    noise: float = 0.0
    steps: int = 8


CASES = {
    "iiwa14": Case("iiwa14", (0, 0.6, 0, -1.2, 0, 1, 0), 1000, ("q", "theta", "dq", "dtheta", "tau_a")),
    "iiwa14, FRI": Case("iiwa14", (0, 0.6, 0, -1.2, 0, 1, 0), 1000, ("q", "tau_a"), 0.3),
    "fr3": Case("fr3", (0, -0.5, 0, -2, 0, 1.6, 0.7), 1000, ("q", "dq", "tau_a"), 0.2),
    "ur5e": Case("ur5e", (0, -1.2, 1.6, -1.9, -1.57, 0), 500, ("theta", "dtheta")),
    "so101": Case("so101", (0, 0.3, -0.6, 0.5, 0), 200, ("theta",), 0.0, 150),
}


def scenario(case: Case) -> Scenario:
    pose = len(case.posture) >= 6
    stiffness = {"translation": 100, "rotation": 5} if pose else {"translation": 30}
    damping = {"translation": 20, "rotation": 1} if pose else {"translation": 3}
    data: dict[str, Any] = {
        "name": "attacked",
        "robot": case.robot,
        "posture": list(case.posture),
        "law": {
            "type": "impedance",
            "task": "pose" if pose else "position",
            "gravity": "robot",
            "shaped_stiffness": {"ratio": 1},
            "shaped_inertia": {"ratio": 0.6},
            "stiffness": stiffness,
            "damping": damping,
            "null_space_damping": 2,
        },
        "control": {"rate": case.rate, "external_torque": "none"},
        "tank": {"kind": "port", "initial": 2},
        "sensors": {"velocity_filter": 100, "link_resolution": 1e-5 if case.noise else 0},
        "motors": {"torque_limit": "robot"},
        "duration": 1,
    }
    if case.noise:
        data["noise"] = {"torque_variance": case.noise**2, "hold": 1 / case.rate}
    return parse_scenario(yaml.safe_dump(data))


def attacked(case: Case, runs: int, seed: int) -> tuple[float, int]:
    """Return the least of what was there less what the joints gave [J], in runs of a second; and how many fell back."""
    rng = np.random.default_rng(seed)
    controller = Controller(scenario(case), WatchSettings(frozen_after=np.inf, soft_start=0.2))
    least, fell = np.inf, 0
    for _ in range(runs):
        q = np.array(case.posture) + rng.uniform(-0.2, 0.2, len(case.posture))
        arm = ElasticArm(case.robot, q.tolist(), 1 / case.rate, steps=case.steps)
        try:
            controller.start(arm.said(*case.says))
        except UnstableLoopError:
            continue
        full, every, kind = controller.report.level, int(rng.integers(1, 100)), int(rng.integers(4))
        home = {name: controller.asked[name].copy() for name in ("position", "rotation", "stiffness")}
        for i in range(case.rate):
            asked = _asked(rng, home, kind) if i % every == 0 else None
            arm.move(controller.step(_read(arm, case, rng), asked))
            least = min(least, full - arm.given)
            assert np.isfinite(arm.x).all()
        fell += controller.report.latched
    return least, fell


def _asked(rng: np.random.Generator, home: dict[str, Array], kind: int) -> Setpoint:
    """Return a pose up to a metre and a turn away; of some kinds with gains of any rank and size, and a wrench."""
    k = len(home["stiffness"])

    def gain(most: float) -> Array:
        root = rng.normal(size=(k, rng.integers(1, k + 1)))
        found = root @ root.T
        return found / np.linalg.eigvalsh(found)[-1] * 10 ** rng.uniform(-1, most)

    return Setpoint(
        home["position"] + rng.normal(size=3) * 10 ** rng.uniform(-3, 0),
        Rotation.from_rotvec(rng.normal(size=3) * 10 ** rng.uniform(-2, 0.3)).as_matrix() @ home["rotation"],
        stiffness=gain(3.3) if kind != 1 else None,
        damping=gain(2) if kind >= 2 else None,
        wrench=10 * rng.normal(size=6) if kind == 3 else None,
    )


def _read(arm: ElasticArm, case: Case, rng: np.random.Generator) -> Sensed:
    said = arm.said(*case.says)
    if not case.noise:
        return said
    assert said.q is not None
    noisy = said._replace(q=np.round(np.asarray(said.q) / 1e-5) * 1e-5)
    return noisy._replace(tau_a=np.asarray(said.tau_a) + case.noise * rng.normal(size=len(case.posture)))


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_nothing_beyond_the_tank_whatever_is_asked(name: str) -> None:
    least, _ = attacked(CASES[name], 6, 1)
    assert least > 0


if __name__ == "__main__":
    arm_name, runs_asked, seed_asked = sys.argv[1:]
    print(*attacked(CASES[arm_name], int(runs_asked), int(seed_asked)))
