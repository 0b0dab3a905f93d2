"""Random arms and gains with noise on q and θ, and with sensors that are late, to find books that claim too much."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
import yaml

from passiflex.errors import PassiflexError, UnstableLoopError
from passiflex.passivity import audit, overclaimed
from passiflex.passivity.ledger import AT_ONCE
from passiflex.scenarios.sensor_settings import DELAYS
from passiflex.simulation import Run, parse_scenario, resolve, simulate_problem
from passiflex.simulation.book_cautions import book_cautions
from simulation.test_books_attacked import Attacked, attack, case

RUNS = 24
"""Of the test, each; `python tests/simulation/test_sensors_attacked.py KIND 2000 [SEED]` has as many as it is told."""


def drawn(rng: np.random.Generator, arm: str) -> dict[str, Any]:
    """Return a case of one arm, or of any."""
    while (data := case(rng))["robot"] != arm and arm:
        pass
    return data


def noisy(rng: np.random.Generator, arm: str = "") -> dict[str, Any]:
    """Return a scenario with noise on q and θ, and a law that makes more of them than K_e = K does."""
    data = drawn(rng, arm)
    law, sensors = data["law"], data["sensors"]
    noise = data.setdefault("noise", {"torque_variance": 0.0})
    for name in ("link_deviation", "motor_deviation"):
        noise[name] = float(np.exp(rng.uniform(np.log(1e-7), np.log(1e-4)))) * bool(rng.random() < 0.8)
    if rng.random() < 0.5:
        law["shaped_stiffness"] = {"ratio": float(rng.choice([0.5, 2, 4]))}
        law["shaped_inertia"] = {"ratio": float(rng.uniform(0.5, 2))}
        data["control"]["inner_loop"] = "plain"
    if rng.random() < 0.5:
        law["null_space_damping"] = float(rng.uniform(1, 10))
    sensors["velocity"] = str(rng.choice(["true", "differences"]))
    sensors["velocity_filter"] = (
        float(rng.choice([50, 200, np.inf])) if sensors["velocity"] == "differences" else 200.0
    )
    if rng.random() < 0.5:  # what hides the noise is left out
        sensors |= {"torque_offset": 0.0, "torque_scale": 0.0, "link_resolution": 0.0}
        data["control"]["missed"] = 0.0
    return data


def late(rng: np.random.Generator) -> dict[str, Any]:
    """Return a scenario with sensors that are late, each by a time of its own or all alike."""
    arm = "planar2r"  # as code is made for each number of periods
    data = drawn(rng, arm) if rng.random() < 0.5 else noisy(rng, arm)
    rate = data["control"]["rate"]
    periods = rng.uniform(0, 4, 4) * rng.choice([0, 1], 4)
    if rng.random() < 0.5:
        periods = np.round(periods)
    if rng.random() < 0.3:
        periods[:] = periods[2]
    data["sensors"] |= {name: float(p / rate) for name, p in zip(DELAYS, periods, strict=True)}
    if rng.random() < 0.7:  # or nearly all of them are refused
        data["law"]["shaped_stiffness"], data["law"]["shaped_inertia"] = (
            {"ratio": 1.0},
            {"ratio": float(rng.uniform(0.8, 1.5))},
        )
        data["control"]["inner_loop"] = "plain"
    return data


def corner(rng: np.random.Generator) -> dict[str, Any]:
    """Return a scenario with each of what noise on q and θ hangs on at one end of its range."""
    data = noisy(rng, "planar2r")
    stiffness, inertia = float(rng.choice([0.5, 4])), float(rng.choice([0.5, 2]))
    data["law"] |= {"shaped_stiffness": {"ratio": stiffness}, "shaped_inertia": {"ratio": inertia}}
    data["law"]["stiffness"] = {"translation": float(rng.choice([50, 800]))}
    data["control"] |= {
        "inner_loop": "plain",
        "missed": 0.0,
        "delay": float(rng.choice([0, 1]) / data["control"]["rate"]),
    }
    link, motor = rng.choice([0.0, 1e-4], 2)
    data["noise"] = {"torque_variance": 0.0, "link_deviation": float(link), "motor_deviation": float(motor)}
    data["sensors"] |= {"velocity_filter": float(rng.choice([50, np.inf])), "link_resolution": 0.0}
    data["tank"]["initial"] = float(rng.choice([0.15, 3]))
    return data


def last_seen(run: Run, periods: float) -> np.ndarray:
    """Return ∫ τ_aᵀ q̇ at the instant that was read last, so many periods of the law late.

    Every period has its row; in one that the law missed, what was read last stands. A reading between two samples is
    taken to have passed as much of the energy between them.
    """
    rows = np.flatnonzero(np.abs(run.time - run["read_time"]) < AT_ONCE)
    count = np.searchsorted(rows, np.arange(len(run.time)), side="right") - 1
    older, newer = (
        run["joint_energy"][rows[np.maximum(count - int(f(periods)), 0)]] for f in (np.ceil, np.floor)
    )
    return np.asarray(newer + (periods - np.floor(periods)) * (older - newer))


def attacked(data: dict[str, Any]) -> Attacked:
    """Return what becomes of a case; `beyond` is that of the instant that was read last."""
    try:
        problem = resolve(parse_scenario(yaml.safe_dump(data)))
        warned = tuple(line for line in book_cautions(problem) if not line.startswith(ALWAYS))
        run = simulate_problem(problem)
    except UnstableLoopError:
        return Attacked("refused")
    except PassiflexError as error:
        return Attacked(f"mistake: {str(error)[:60]}")
    periods = float(problem.parts.unpack("errors", problem.numbers)["late"])
    now = last_seen(run, 0.0) if periods else run["joint_energy"]
    beyond = overclaimed(run) - (now - last_seen(run, periods) if periods else 0.0)
    verdict = audit(run)
    return Attacked(verdict.verdict, float((beyond - run["measurement_bound"]).max()), verdict.margin, warned)


ALWAYS = "the tank sees what goes through the joints"
"""How the caution begins that sensors which are late have whatever happens: it excuses nothing."""
CASES = {"noisy": noisy, "corner": corner, "late": late}


@pytest.mark.slow
@pytest.mark.parametrize("kind", CASES)
def test_no_claim_exceeds_its_bound(kind: str) -> None:
    """What a tank claims less its bound is there, and whatever ends violated was refused or warned of."""
    assert attack(RUNS, 1, CASES[kind], attacked) == []


if __name__ == "__main__":
    attack(int(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 2, CASES[sys.argv[1]], attacked)
