"""A hand in the way: at which speed it feels 140 or 280 N, and which tank cannot press harder; no certificate."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.files import require_writable
from passiflex.passivity import audit
from passiflex.plotting.hands import Pressed, draw_hands
from passiflex.problems.natural_inertia import natural_inertia
from passiflex.simulation import Run, Scenario, resolve, simulate_problem
from passiflex.studies.contact import SPEEDS, approach
from passiflex.studies.paper import Report, shipped_scenario
from passiflex.studies.written import Written, write_study

Array = NDArray[np.float64]

HAND = 7.5e4
"""Stiffness of a hand [N/m], 75 N/mm by ISO/TS 15066."""
WALLS = {1e4: "1e4 N/m", HAND: "7.5e4 N/m, a hand", 1e6: "1e6 N/m"}
"""Stiffness of what is in the way [N/m], in words; it does not give way otherwise, as a hand on a table."""
LIMITS = (140.0, 280.0)
"""Forces [N] on a hand, quasi-static and transient."""
PUBLIC_SPEED = SPEEDS[1]
"""Speed [m/s] that public tests allow an iiwa beside people."""
APPROACHES = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0)
"""Speeds of the reference at the wall [m/s]."""
FLOOR = 0.1
"""Level of the tank below which nothing is granted [J]."""
ENERGIES = (0.03, 0.065, 0.25, 1.0)
"""Tanks above their floor that are tried on a hand besides those of the limits [J]."""
ATTACKS: dict[str, dict[str, Any]] = {
    "a step of 20 cm": {"reference": [{"at": 0.2, "kind": "step", "by": [0, 0, -0.2]}]},
    "a step of 40 cm": {"reference": [{"at": 0.2, "kind": "step", "by": [0, 0, -0.4]}]},
    "20 cm in 0.3 s": {"reference": [{"at": 0.2, "kind": "move", "by": [0, 0, -0.2], "duration": 0.3}]},
    "a step of 20 cm, three times as stiff": {
        "reference": [{"at": 0.2, "kind": "step", "by": [0, 0, -0.2]}],
        "law.stiffness.translation": 1500,
    },
}
"""References that ask for all that a tank has."""


class Touch(NamedTuple):
    """What a wall felt.

    Attributes
    ----------
    speed: Of the hand when it touched, or the fastest that it was if it did not [m/s].
    peak: Largest force [N].
    margin: Least of what law and motors might still have given [J].
    verdict: Of the run.
    """

    speed: float
    peak: float
    margin: float
    verdict: str


def attack(name: str, wall: float, energy: float) -> Scenario:
    """Return the scenario of an attack on a wall [N/m] with so much above the tank's floor [J]."""
    words = name.replace(" ", "_").replace(",", "")
    changes = {
        "name": f"hands_{wall:.1e}_{energy:.3g}J_{words}".replace("+", ""),
        "description": f"{name}, with {energy:.3g} J above the tank's floor",
        "environment[0].stiffness": wall,
        "tank.initial": FLOOR + energy,
        "duration": 4.0,
    }
    return shipped_scenario("contact").changed(changes | ATTACKS[name])


def touch(run: Run) -> Touch:
    """Return what the wall felt in a run."""
    force, result = np.linalg.norm(run["wall_force"], axis=1), audit(run)
    speed = -np.gradient(run["position"][:, 2], run.time)
    first = int((force > 0).argmax())
    return Touch(
        speed=float(speed[max(first - 1, 0)] if force.any() else speed.max()),
        peak=float(force.max()),
        margin=result.margin,
        verdict=result.verdict,
    )


def moving_mass() -> float:
    """Return the mass of the links as the wall feels them, Λ along its normal [kg]."""
    return float(natural_inertia(resolve(shipped_scenario("contact")))[2, 2])


def bound(wall: float, energy: float) -> float:
    """Return the force that an energy [J] can press a spring [N/m] with: √(2 k E) [N]."""
    return float(np.sqrt(2 * wall * energy))


def enough(wall: float, force: float) -> float:
    """Return the energy that can press a spring [N/m] with a force [N] and no more: f²/2k [J]."""
    return force**2 / (2 * wall)


def speed_for(force: float, speeds: Array, peaks: Array) -> float:
    """Return the speed [m/s] with which a wall feels a force, between those that were tried; infinite above them."""
    return float(np.interp(force, peaks, speeds, right=np.inf))


def reproduce_hands(folder: Path, report: Report = lambda text: None) -> Written:
    """Run the study, write its figure, page and table into `folder`; return the paths, and the part of the summary."""
    require_writable(folder)
    numbers: dict[str, Any] = {}
    mass, approached, attacked = moving_mass(), [], []
    shown: dict[str, Run] = {}
    found: dict[float, list[Touch]] = {}
    for wall in WALLS:
        report(f"hands: approaching {WALLS[wall]}")
        found[wall] = [
            touch(simulate_problem(resolve(approach("recommended", wall, speed)))) for speed in APPROACHES
        ]
        for speed, felt in zip(APPROACHES, found[wall], strict=True):
            numbers[f"approach_{wall:.1e}_{speed:g}".replace("+", "")] = felt._asdict()
            approached.append(Pressed(WALLS[wall], felt.speed, felt.peak))
    table = [
        ["wall", "force", "speed at which it is felt, *f/√(kΛ)*", "tank above its floor that is enough, f²/2k",
         "then at most", "at a speed of"]
    ]  # fmt: skip
    for wall, limit in itertools.product(WALLS, LIMITS):
        speeds, peaks = (
            np.array(part) for part in zip(*((t.speed, t.peak) for t in found[wall]), strict=True)
        )
        allowed, energy = speed_for(limit, speeds, peaks), enough(wall, limit)
        worst = _attacked(wall, energy, numbers, report)
        name = f"limit_{wall:.1e}_{limit:g}N".replace("+", "")
        numbers[name] = {"speed": allowed, "energy": energy} | worst._asdict()
        said = f"{allowed:.2f}" if np.isfinite(allowed) else f"more than {speeds[-1]:.2f}"
        table.append(
            [
                WALLS[wall], f"{limit:g} N", f"{said} m/s, *{limit / np.sqrt(wall * mass):.2f}*",
                f"{energy:.3f} J", f"{worst.peak:.0f} N", f"{worst.speed:.2f} m/s",
            ]
        )  # fmt: skip
        if wall == HAND:
            attacked.append(Pressed(WALLS[wall], energy, worst.peak))
    for energy in ENERGIES:
        attacked.append(Pressed(WALLS[HAND], energy, _attacked(HAND, energy, numbers, report).peak))
    report("hands: drawing")
    fast = simulate_problem(resolve(approach("recommended", HAND, APPROACHES[-2])))
    guarded = simulate_problem(resolve(attack("a step of 40 cm", HAND, enough(HAND, LIMITS[0]))))
    shown = {"a tank that cannot press a hand with 140 N": guarded, "0.5 m/s, tank of 5 J": fast}
    tanks = np.geomspace(0.02, 1.3, 30)
    figure = draw_hands(
        approached,
        {WALLS[wall]: float(np.sqrt(wall * mass)) for wall in WALLS},
        sorted(attacked),
        np.array([tanks, [bound(HAND, energy) for energy in tanks]]),
        PUBLIC_SPEED,
        CONDITIONS,
    )
    return write_study("hands", folder, figure, shown, table, numbers)


def _attacked(wall: float, energy: float, numbers: dict[str, Any], report: Report) -> Touch:
    """Return the touch with the largest force of all attacks, with the largest speed and the least margin of them."""
    report(f"hands: attacking {WALLS[wall]} with {energy:.3g} J")
    touches = []
    for name in ATTACKS:
        run = simulate_problem(resolve(attack(name, wall, energy)))
        touches.append(touch(run))
        numbers[run.name.removeprefix("hands_")] = touches[-1]._asdict()
    hardest = max(touches, key=lambda t: t.peak)
    return hardest._replace(speed=max(t.speed for t in touches), margin=min(t.margin for t in touches))


CONDITIONS = (
    "iiwa14 at 1 kHz, each command one period late, sensors, noise and torque limits as in the sampled study; "
    "gains by `recommend`, K_x = 500 N/m\n"
    "a hand of 20 mm comes to a wall that does not give way but for its stiffness. An aid, no certificate"
)
