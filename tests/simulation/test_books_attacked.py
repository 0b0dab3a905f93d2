"""Random arms, gains, sensors and clocks, to find one whose books claim what is not there: the slow attack."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml

from passiflex.errors import PassiflexError, UnstableLoopError
from passiflex.passivity import audit, overclaimed
from passiflex.simulation import parse_scenario, resolve, simulate_problem
from passiflex.simulation.book_cautions import book_cautions

RUNS = 60
"""Of the test; `python tests/simulation/test_books_attacked.py 2000 [SEED]` has as many as it is told."""
BEYOND = 1e-5
"""Error that is no more than the integrator's [J]."""
SMALL = 1e-3
"""Overdraft [J] that is no finding."""


class Attacked(NamedTuple):
    """What became of a case: refused, or how far beyond the bound, the margin, and what was said of its books."""

    fate: str
    beyond: float = 0.0
    margin: float = 0.0
    warned: tuple[str, ...] = ()


def case(rng: np.random.Generator) -> dict[str, Any]:
    """Return a scenario with errors of every kind."""
    arm = str(rng.choice(["planar2r", "iiwa14"]))
    n, rate = (2, rng.choice([500, 1000])) if arm == "planar2r" else (7, rng.choice([500, 1000]))
    posture = rng.uniform(-1.2, 1.2, n)
    posture[1] = rng.uniform(0.5, 1.2)
    task = "position" if n == 2 else str(rng.choice(["position", "pose"]))
    soft = {"translation": float(rng.uniform(50, 800))}
    damp = {"translation": float(rng.uniform(10, 80))}
    if task == "pose":
        soft["rotation"], damp["rotation"] = float(rng.uniform(10, 80)), float(rng.uniform(1, 8))
    plane = ["x", "z"] if n == 2 else [str(a) for a in rng.permutation(["x", "y", "z"])[:2]]
    by = rng.uniform(-0.05, 0.05, 3) * ([1, 0, 1] if n == 2 else 1)
    data: dict[str, Any] = {
        "name": "attack",
        "robot": arm,
        "posture": posture.tolist(),
        "law": {
            "type": "impedance",
            "task": task,
            "gravity": "robot",
            "shaped_stiffness": {"ratio": 1},
            "shaped_inertia": {"ratio": float(np.exp(rng.uniform(np.log(0.1), 0)))},
            "stiffness": soft,
            "damping": damp,
        },
        "control": {
            "rate": int(rate),
            "delay": float(rng.integers(0, 3) / rate),
            "inner_loop": str(rng.choice(["plain", "matched"])),
            "external_torque": "none",
            "missed": float(rng.choice([0, 0.1, 0.3, 0.5])),
        },
        "tank": {"kind": "port", "initial": float(rng.uniform(0.15, 3))},
        "sensors": {
            "velocity": "differences",
            "velocity_filter": "200 Hz",
            "link_resolution": float(rng.choice([0, 1e-4, 1e-3])),
            "motor_resolution": float(rng.choice([0, 1e-6])),
            "torque_offset": (rng.uniform(-1, 1, n) * rng.choice([0, 0.2, 1])).tolist(),
            "torque_scale": (rng.uniform(-0.03, 0.03, n) * rng.choice([0, 1])).tolist(),
        },
        "motors": {"torque_limit": "robot"},
        "reference": [
            {"at": 0.1, "kind": "step", "by": by.tolist()},
            {"at": 0.5, "kind": "circle", "plane": plane, "radius": float(rng.uniform(0.02, 0.08)), "period": 1.5},
        ],
        "seed": int(rng.integers(2**31)),
        "duration": 6.0,
        "output_interval": float(1 / rate),
    }  # fmt: skip
    if rng.random() < 0.7:
        hold = int(rng.choice([1, 1, 5, 10, 20, 50]))
        data["noise"] = {"torque_variance": float(rng.uniform(0.02, 0.5)), "hold": float(hold / rate)}
    if rng.random() < 0.3:
        data["sensors"]["torque_bandwidth"] = float(rng.uniform(100, 0.4 * rate))
    if rng.random() < 0.5:
        data["drags"] = [{"from": 0.3, "to": 6.0, "viscous": float(rng.uniform(2, 30))}]
    return data


def attacked(data: dict[str, Any]) -> Attacked:
    """Return what becomes of a case."""
    try:
        problem = resolve(parse_scenario(yaml.safe_dump(data)))
        warned = book_cautions(problem)
        run = simulate_problem(problem)
    except UnstableLoopError:
        return Attacked("refused")
    except PassiflexError as error:
        return Attacked(f"mistake: {str(error)[:60]}")
    beyond = float((overclaimed(run) - run["measurement_bound"]).max())
    verdict = audit(run)
    return Attacked(verdict.verdict, beyond, verdict.margin, warned)


def attack(
    runs: int,
    seed: int,
    draw: Callable[[np.random.Generator], dict[str, Any]] = case,
    tried: Callable[[dict[str, Any]], Attacked] = attacked,
) -> list[tuple[int, dict[str, Any], Attacked]]:
    """Return the cases that break a promise; prints what became of all."""
    fates: Counter[str] = Counter()
    broken = []
    for i in range(runs):
        data = draw(np.random.default_rng([seed, i]))
        found = tried(data)
        fates[found.fate] += 1
        violated = found.fate == "violated" and found.margin < -SMALL and not found.warned
        if found.beyond > BEYOND or violated or found.fate.startswith("mistake"):
            broken.append((i, data, found))
            print(
                i, found.fate, f"{found.beyond:.3g} J beyond, margin {found.margin:.3g} J", data, flush=True
            )
        if i % 50 == 49:
            print(i + 1, dict(fates), flush=True)
    return broken


@pytest.mark.slow
def test_no_claim_exceeds_its_bound_and_no_violation_comes_unsaid() -> None:
    """What a tank claims less its bound is there, and whatever ends violated was refused or warned of."""
    assert attack(RUNS, seed=1) == []


if __name__ == "__main__":
    attack(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 2)
