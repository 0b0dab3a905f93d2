"""A policy at 15 Hz that switches its stiffness at a wall: what it gives, how hard it presses, what a tank costs it."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.files import require_writable
from passiflex.metrics.numbers import rms
from passiflex.metrics.steps import displacement
from passiflex.passivity import audit
from passiflex.plotting.policy import Guarded, draw_policy
from passiflex.scenarios.setpoints import Table
from passiflex.simulation import Run, Scenario, resolve, simulate_problem
from passiflex.simulation.setpoint_arrays import setpoint_table
from passiflex.studies.contact import ENDLESS
from passiflex.studies.paper import Report, shipped_scenario
from passiflex.studies.written import Written, write_study

Array = NDArray[np.float64]

SOFT, STIFF = (100.0, 25.0), (1000.0, 80.0)
"""Stiffness and damping that the policy switches between [N/m, N s/m]."""
TURNING = 50.0, 4.0
"""Those of rotations, which stay [N m/rad, N m s/rad]."""
RATE, HELD = 15.0, 4
"""Messages per second, and for how many of them a stiffness stays."""
STREAM = {"rate": RATE, "delay": 0.02, "jitter": 0.04, "lost": 0.2}
WALL = 0.1
"""How far off the wall is [m]."""
WISHES = {"in the air": -0.05, "2 cm into the wall": 0.02, "15 cm into the wall": 0.15}
"""How far beyond the wall the policy's targets go [m]."""
WILD = "15 cm into the wall"
TANKS = (0.5, 1.0, 2.0, 5.0, 10.0, ENDLESS)
"""At the start [J]."""
SHOWN = 1.0
"""The tank of the runs that are drawn over time [J]."""
SEEDS = (0, 1, 2)
DURATION, BEGINS = 10.0, 0.2
"""Of a run, and when its policy begins [s]."""
PRESSES, WIPES = (0.5, 0.5), (0.4, 0.08)
"""How often [Hz] the targets go to the wall, and of which share; how often they go aside, and how far [m]."""


class Told(NamedTuple):
    """What became of a policy.

    Attributes
    ----------
    given: Most that law and motors had given to the links [J].
    peak: Largest force on the wall [N].
    held_back: Time in which the reference was held back [s].
    lag: How far the reference in force was from the one that was told, at most [m].
    margin: Least of what law and motors might still have given [J].
    verdict: Of the run.
    """

    given: float
    peak: float
    held_back: float
    lag: float
    margin: float
    verdict: str


def wishes(wish: str, seed: int) -> Table:
    """Return a policy: targets that go to the wall and aside, its stiffness either of two at random."""
    time = np.arange(0, DURATION - 0.5, 1 / RATE)
    deep = WALL + WISHES[wish]
    down = -deep * (1 - np.cos(2 * np.pi * PRESSES[0] * time)) * PRESSES[1]
    aside = WIPES[1] * np.sin(2 * np.pi * WIPES[0] * time)
    chance = np.random.default_rng(seed).random(time.size // HELD + 1) < 0.5
    stiff = np.repeat(chance, HELD)[: time.size, None]
    K, D = (
        np.where(stiff, [high] * 3 + [turning] * 3, [low] * 3 + [turning] * 3)
        for low, high, turning in zip(SOFT, STIFF, TURNING, strict=True)
    )
    return setpoint_table(
        time,
        np.column_stack([0 * time, aside, down]),
        stiffness=K,
        damping=D,
        at=BEGINS,
        between="linear",
        relative=True,
        stream=STREAM,
    )


def told(wish: str, tank: float, seed: int) -> Scenario:
    """Return the scenario of a policy for a tank [J]."""
    (stiffness, damping), (turning, turned) = SOFT, TURNING
    size = "endless" if tank == ENDLESS else f"{tank:g}J"
    return shipped_scenario("contact").changed(
        {
            "name": f"policy_{wish.replace(' ', '_')}_{size}_{seed}",
            "description": f"a policy at 15 Hz, {wish}, its stiffness 100 or 1000 N/m",
            "law.stiffness": {"translation": stiffness, "rotation": turning},
            "law.damping": {"translation": damping, "rotation": turned},
            "environment[0].friction": 0.3,
            "tank.initial": tank,
            "reference": [wishes(wish, seed).model_dump(exclude_none=True)],
            "seed": seed,
            "output_interval": 0.002,
            "duration": DURATION,
        }
    )


def obeyed(run: Run) -> Told:
    """Return what became of a run."""
    result = audit(run)
    return Told(
        given=float(run["joint_energy"].max()),
        peak=float(np.linalg.norm(run["wall_force"], axis=1).max()),
        held_back=float(run["governed_time"][-1]),
        lag=float(run["largest_lag"][-1]),
        margin=result.margin,
        verdict=result.verdict,
    )


def deviation(run: Run, free: Run) -> float:
    """Return how far a hand goes from where another does, as a share of that one's motion; both root mean squares."""
    away, moved = (
        displacement(run["position"]) - displacement(free["position"]),
        displacement(free["position"]),
    )
    return rms(np.linalg.norm(away, axis=1)) / rms(np.linalg.norm(moved, axis=1))


def reproduce_policy(folder: Path, report: Report = lambda text: None) -> Written:
    """Run the study, write its figure, page and table into `folder`; return the paths, and the part of the summary."""
    require_writable(folder)
    numbers: dict[str, Any] = {}
    drawn: list[Guarded] = []
    shown: dict[str, Run] = {}
    table = [
        [
            "the policy wants",
            "tank",
            "given to the links",
            "peak force",
            "held back",
            "off the law without a tank",
        ]
    ]
    for wish, tank in itertools.product(WISHES, reversed(TANKS)):
        report(f"policy: {wish}, {'no tank' if tank == ENDLESS else f'tank of {tank:g} J'}")
        runs = [simulate_problem(resolve(told(wish, tank, seed))) for seed in SEEDS]
        if tank == ENDLESS:
            free = runs
        found = [obeyed(run) for run in runs]
        off = [deviation(*pair) for pair in zip(runs, free, strict=True)]
        for run, one, away in zip(runs, found, off, strict=True):
            numbers[run.name] = one._asdict() | {"deviation": away}
        given, peak, held = (max(getattr(f, name) for f in found) for name in ("given", "peak", "held_back"))
        drawn.append(Guarded(wish, None if tank == ENDLESS else tank, peak, max(off)))
        if wish == WILD and tank in (SHOWN, ENDLESS):
            shown["no tank" if tank == ENDLESS else f"tank of {tank:g} J"] = runs[0]
        size = "none" if tank == ENDLESS else f"{tank:g} J"
        table.append(
            [wish, size, f"{given:.2f} J", f"{peak:.0f} N", f"{held:.1f} s", f"{100 * max(off):.1f} %"]
        )
    report("policy: drawing")
    shown = dict(reversed(shown.items()))
    curves = {
        title: (run.time, np.linalg.norm(run["wall_force"], axis=1), run["joint_energy"])
        for title, run in shown.items()
    }
    figure = draw_policy(drawn, curves, SHOWN, CONDITIONS)
    return write_study("policy", folder, figure, shown, table, numbers)


CONDITIONS = (
    "iiwa14 at 1 kHz, each command one period late, sensors, noise and torque limits as in the sampled study; "
    "wall of 1e4 N/m, friction 0.3\n"
    "targets at 15 Hz, 20 to 60 ms late, a fifth of them lost; stiffness 100 or 1000 N/m, drawn anew every 0.27 s; "
    "worst of 3 seeds"
)
