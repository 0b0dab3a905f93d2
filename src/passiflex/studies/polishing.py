"""Polishing a dome: what friction takes from the tank, how long that lasts, and what is left when it is empty."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.files import require_writable
from passiflex.passivity import audit
from passiflex.plotting.polishing import Polished, draw_polishing
from passiflex.scenarios.reference import Circle
from passiflex.simulation import Run, Scenario, resolve, simulate_problem
from passiflex.studies.contact import ENDLESS
from passiflex.studies.gliding import (
    DOME,
    FLOOR,
    GAP,
    HAND,
    LEAN,
    SPEED,
    STIFFNESS,
    SURFACE,
    TANK,
    carried,
    steady,
)
from passiflex.studies.paper import Report, shipped_scenario
from passiflex.studies.written import Written, write_study

Array = NDArray[np.float64]

FORCES, FRICTIONS = (5.0, 10.0, 20.0), (0.2, 0.4, 0.6)
"""Wanted press [N] and friction of the dome."""
INWARD = np.array([0, math.sin(LEAN), -math.cos(LEAN)])
"""From where the hand starts to the dome's middle."""
UNDER_WAY, LEFT_BEHIND = 1.0, 5e-3
"""Time on the circle [s] after which the hand is taken to glide, and distance [m] to the reference in force from which
on it is held back."""
ON_AND_ON = 60.0
"""Longest run [s]."""


class Polishing(NamedTuple):
    """What became of one dome.

    Attributes
    ----------
    force, lag: Mean force [N] and lag [m] while the hand glides.
    waviness: Deviation of that force [N].
    lasts: Time from the touch until the reference is held back [s]; infinite if it never is.
    lost: To friction and the dome [J].
    rubbed: μ ∫ f ds by the rows [J], to compare with it.
    given: By law and motors, through the joints [J].
    way: That the hand went along the dome [m].
    rest: Mean force at the end [N].
    margin: Least of what law and motors might still have given [J].
    verdict: Of the run.
    """

    force: float
    lag: float
    waviness: float
    lasts: float
    lost: float
    rubbed: float
    given: float
    way: float
    rest: float
    margin: float
    verdict: str


def polishing(force: float, friction: float) -> Scenario:
    """Return the scenario for a press [N] and a friction, as long as the tank lasts and then some.

    The press is a virtual depth, K_x d on springs in a row: its energy is in the tank's books once, and it stays when
    the tank is empty.
    """
    depth = force * (1 / STIFFNESS + 1 / SURFACE)
    glides = SPEED / ((DOME + HAND) * math.sin(LEAN))
    lasts = (TANK - FLOOR) / (friction * force * SPEED)
    return shipped_scenario("polishing").changed(
        {
            "name": f"polishing_{force:g}N_{friction:g}",
            "description": f"round a dome with {force:g} N and friction {friction:g}",
            "environment[0].friction": friction,
            "environment[0].centre": ((DOME + HAND + GAP) * INWARD).tolist(),
            "reference[0].by": ((GAP + depth) * INWARD).tolist(),
            "reference[1].radius": (DOME + HAND - depth) * math.sin(LEAN),
            "reference[1].period": 2 * math.pi / glides,
            "tank.initial": TANK,
            "duration": min(round(6 + 1.1 * lasts, 1), ON_AND_ON),
        }
    )


def endless(force: float, friction: float) -> Scenario:
    """Return the same with a tank that never ends, which is to say without one."""
    asked = polishing(force, friction)
    return asked.changed({"name": f"{asked.name}_endless", "tank.initial": ENDLESS})


def fed_forward(force: float, friction: float) -> Scenario:
    """Return the same with the press as a force straight down, behind the valve, and no depth."""
    scenario = polishing(force, friction)
    down = -force / math.cos(LEAN)
    return scenario.changed(
        {
            "name": f"{scenario.name}_forward",
            "description": f"{scenario.description}, pressed by a force behind the valve",
            "reference[0].by": (GAP * INWARD).tolist(),
            "reference[1].radius": (DOME + HAND) * math.sin(LEAN),
            "feedforward": [{"from": 0.2, "to": scenario.duration, "force": [0, 0, down]}],
        }
    )


def polished(run: Run, friction: float) -> Polishing:
    """Return what became of a run."""
    began, time = next(e.at for e in _scenario(run).reference if isinstance(e, Circle)), run.time
    force, held = pressed(run), np.linalg.norm(run["desired_position"] - run["governed_position"], axis=1)
    behind = (held > LEFT_BEHIND) & (time > began)
    empty = float(time[behind.argmax()]) if behind.any() else math.inf
    touch = float(time[(force > 0).argmax()])
    gliding = (time > began + UNDER_WAY) & (time < empty)
    moved = np.linalg.norm(np.diff(run["position"], axis=0), axis=1) * (force[1:] > 0)
    mean = (force[1:] + force[:-1]) / 2
    result = audit(run)
    return Polishing(
        force=float(force[gliding].mean()),
        lag=float(lag(run)[gliding].mean()),
        waviness=float(force[gliding].std()),
        lasts=empty - touch,
        lost=float(run["dome_energy"][-1]),
        rubbed=friction * float(mean @ moved),
        given=float(run["joint_energy"].max()),
        way=float(moved.sum()),
        rest=float(force[time > time[-1] - 1].mean()),
        margin=result.margin,
        verdict=result.verdict,
    )


def pressed(run: Run) -> Array:
    """Return the force along the dome's normal over time [N]."""
    out = run["position"] - centre(run)
    return np.einsum("ij,ij->i", run["dome_force"], out) / np.linalg.norm(out, axis=1)


def lag(run: Run) -> Array:
    """Return how far the hand is behind the reference that is asked for, along the circle [m]; modulo one turn."""
    here, there = (run[name] - centre(run) for name in ("position", "desired_position"))
    turn = np.arctan2(there[:, 1], there[:, 0]) - np.arctan2(here[:, 1], here[:, 0])
    return (turn + math.pi) % (2 * math.pi) * np.hypot(*here[:, :2].T) - math.pi * np.hypot(*here[:, :2].T)


def centre(run: Run) -> Array:
    """Return the middle of the dome in the world [m]."""
    return run["position"][0] + np.array(_scenario(run).environment[0].centre)  # type: ignore[union-attr]


def _scenario(run: Run) -> Scenario:
    assert run.scenario is not None
    return run.scenario


def reproduce_polishing(folder: Path, report: Report = lambda text: None) -> Written:
    """Run the study, write its figure, page and table into `folder`; return the paths, and the part of the summary."""
    require_writable(folder)
    hand = carried(polishing(FORCES[0], FRICTIONS[0]))
    numbers: dict[str, Any] = {}
    drawn: list[Polished] = []
    runs: dict[tuple[float, float], Run] = {}
    head = ["wanted", "friction", "force", "lag", "tank lasts", "drawn by friction", "after it is empty"]
    table = [[f"{name}, *closed form*" if name in head[2:5] else name for name in head]]
    for force, friction in itertools.product(FORCES, FRICTIONS):
        report(f"polishing: {force:g} N, friction {friction:g}")
        run = runs[force, friction] = simulate_problem(resolve(polishing(force, friction)))
        found, closed = polished(run, friction), steady(force, friction, hand)
        numbers[f"{force:g}N_{friction:g}"] = found._asdict() | {
            f"closed_form_{name}": value
            for name, value in (closed._asdict() | {"lasts": closed.lasts}).items()
        }
        drawn.append(Polished(force, friction, run.time, run["tank_energy"], found, closed))
        table.append(
            [
                f"{force:g} N", f"{friction:g}",
                f"{found.force:.1f} ± {found.waviness:.1f} N, *{closed.force:.1f}*",
                f"{1e3 * found.lag:.0f} mm, *{1e3 * closed.lag:.0f}*",
                f"{found.lasts:.1f} s, *{closed.lasts:.1f}*",
                f"{found.lost:.2f} J over {found.way:.1f} m",
                f"{found.rest:.1f} N",
            ]
        )  # fmt: skip
    middle = FORCES[1], FRICTIONS[1]
    others: dict[str, Run] = {}
    for title, name, scenario in (
        ("without a tank", "endless", endless(*middle)),
        ("pressed by a force behind the valve", "forward", fed_forward(*middle)),
    ):
        report(f"polishing: {title}")
        others[title] = simulate_problem(resolve(scenario))
        numbers[name] = polished(others[title], middle[1])._asdict()
    report("polishing: drawing")
    forward = others["pressed by a force behind the valve"]
    rubs = np.geomspace(0.7, 14, 20)
    pressing = {"virtual depth": runs[middle], "force behind the valve": forward}
    figure = draw_polishing(
        drawn,
        {name: (run.time, pressed(run)) for name, run in pressing.items()},
        np.array([rubs, (TANK - FLOOR) / rubs]),
        CONDITIONS,
    )
    shown = {"tank of 5 J": runs[middle], **others}
    return write_study("polishing", folder, figure, shown, table, numbers)


CONDITIONS = (
    "iiwa14 at 1 kHz, each command one period late, sensors, noise and torque limits as in the sampled study\n"
    "K_x = 1000 N/m, D_x = 80 N s/m; a hand of 20 mm goes round a dome of 15 cm (1e4 N/m), "
    "30° from its top, at 0.1 m/s; port tank of 5 J"
)
