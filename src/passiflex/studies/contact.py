"""Touching a wall: what it feels of a hand that comes to it, for laws, speeds and walls, in two engines."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.diagrams import Viewed
from passiflex.extras import MissingExtraError
from passiflex.files import require_writable
from passiflex.metrics.contact import left
from passiflex.passivity import audit
from passiflex.plotting.contact import Approach, draw_approaches
from passiflex.plotting.figures import save_figure
from passiflex.reports import write_report
from passiflex.simulation import Run, Scenario, resolve, simulate_problem
from passiflex.studies.paper import Report, shipped_scenario
from passiflex.studies.summary import plain

Array = NDArray[np.float64]

STIFFNESSES = (1e3, 1e4, 1e5, 1e6)
"""Of the wall [N/m]."""
SPEEDS = (0.05, 0.16, 0.5)
"""Of the hand where the wall is [m/s]; 0.16 is what public tests allow an iiwa beside people (arXiv 2009.01036)."""
ENGINES = ("passiflex", "mujoco")
FASTEST = 1.875 / 2
"""Speed halfway of a move with minimum jerk, of its length over half its duration."""
BEFORE, AFTER = 0.2, 1.5
"""Time before the move, and after it [s]."""
STEADY = 0.3
"""Time at the end of a run [s] whose force is called steady."""
CRITICAL: dict[str, Any] = {"translation": 2 * 500**0.5, "rotation": 2 * 30**0.5}
"""2√K, as public controllers have it, whatever the inertia."""
ENDLESS = 1000.0
"""So much in the tank [J] never ends: the law without one, as a scenario that names no tank has one of 2 J."""
PUBLIC: dict[str, Any] = {"inner_loop": "plain", "allow_unstable": True}


class Way(NamedTuple):
    """A law: its title, and by what its scenario differs from the shipped one."""

    title: str
    changes: dict[str, Any]


LAWS = {
    "rigid": Way(
        "rigid law, unit mass, D = 2√K",
        {
            "law": {
                "type": "rigid", "task": "pose", "gravity": "robot", "null_space_damping": 5,
                "stiffness": {"translation": 500, "rotation": 30}, "damping": CRITICAL,
                "target_inertia": {"translation": 1, "rotation": 1},
            },
            "tank": None,
            "control": {"rate": 1000, "delay": 0.001, "external_torque": "none", **PUBLIC},
        },
    ),
    "public": Way(
        "Jᵀ(K e − D ẋ), D = 2√K",
        {"law.shaped_inertia": {"ratio": 1}, "law.damping": CRITICAL, "tank.initial": ENDLESS}
        | {f"control.{name}": value for name, value in PUBLIC.items()},
    ),
    "paper": Way(
        "the paper's gains and tank",
        {
            "law.shaped_stiffness": {"ratio": 10}, "law.shaped_inertia": {"ratio": 0.01},
            "tank": {"kind": "paper", "initial": 5}, "control.external_torque": "measured",
        } | {f"control.{name}": value for name, value in PUBLIC.items()},
    ),
    "recommended": Way("gains by recommend, port tank", {}),
}  # fmt: skip


class Felt(NamedTuple):
    """What a wall felt in a run.

    Attributes
    ----------
    peak, steady, trembling: Largest force, its mean and deviation at the end [N].
    bounces: How often the hand left the wall.
    given: Most energy that the wall had had from the hand [J].
    margin: Least of the port's margin [J]; below 0 the law gave what it did not have.
    verdict: Of the run.
    """

    peak: float
    steady: float
    trembling: float
    bounces: int
    given: float
    margin: float
    verdict: str


def approach(law: str, stiffness: float, speed: float) -> Scenario:
    """Return the scenario of a hand that comes to a wall with a speed [m/s] and goes on within it."""
    shipped = shipped_scenario("contact")
    length = abs(shipped.reference[0].by[2])  # type: ignore[union-attr]
    lasts = 2 * FASTEST * length / speed
    return shipped.changed(
        {
            **LAWS[law].changes,
            "name": f"contact_{law}_{stiffness:.0e}_{speed:g}".replace("+", ""),
            "description": f"{LAWS[law].title}: a hand comes to a wall of {stiffness:g} N/m with {speed:g} m/s",
            "environment[0].stiffness": stiffness,
            "reference[0].duration": lasts,
            "reference[0].at": BEFORE,
            "duration": round(BEFORE + lasts + AFTER, 3),
        }
    )


def felt(run: Run) -> Felt:
    """Return what the wall felt."""
    force, result = np.linalg.norm(run["wall_force"], axis=1), audit(run)
    late = force[run.time > run.time[-1] - STEADY]
    return Felt(
        peak=float(force.max()),
        steady=float(late.mean()),
        trembling=float(late.std()),
        bounces=left(force),
        given=float(-run["wall_given_energy"].min()),
        margin=result.margin,
        verdict=result.verdict,
    )


def approaches(
    engine: str = ENGINES[0],
    laws: Sequence[str] = tuple(LAWS),
    stiffnesses: Sequence[float] = STIFFNESSES,
    speeds: Sequence[float] = SPEEDS,
) -> Iterator[tuple[str, float, float, Run]]:
    """Yield law, wall, speed, and the run, stable or not."""
    for law, stiffness, speed in itertools.product(laws, stiffnesses, speeds):
        yield law, stiffness, speed, simulate_problem(resolve(approach(law, stiffness, speed)), engine)


def reproduce_contact(
    folder: Path, report: Report = lambda text: None, engines: Sequence[str] = ENGINES
) -> tuple[list[Path], dict[str, Any]]:
    """Run the study, write its figure and pages into `folder`; return the paths, and the part of the summary.

    Without the extra `mujoco` the second engine is left out, which is said.
    """
    require_writable(folder)
    summary: dict[str, Any] = {}
    drawn: list[Approach] = []
    shown: dict[str, Run] = {}
    for engine in engines:
        try:
            for law, stiffness, speed, run in approaches(engine):
                report(f"contact: {LAWS[law].title}, {stiffness:g} N/m, {speed:g} m/s, {engine}")
                numbers = felt(run)
                summary[f"{run.name}_{engine}"] = plain(numbers._asdict())
                middle = engine == engines[0] and (stiffness, speed) == (STIFFNESSES[2], SPEEDS[1])
                force = np.linalg.norm(run["wall_force"], axis=1)
                curve = (run.time - BEFORE, force) if middle else None
                drawn.append(
                    Approach(LAWS[law].title, engine, stiffness, speed, numbers.peak, numbers.given, curve)
                )
                if middle:
                    shown[law] = run
        except MissingExtraError as missing:
            report(f"contact: without {engine}, {missing}")
    report("contact: drawing")
    first, *others = (Viewed(shown[law], LAWS[law].title) for law in reversed(LAWS))
    page = write_report(first.run, folder / "contact.html", others)
    runs = [run.save(folder / f"{run.name}.nc") for run in shown.values()]
    return [*save_figure(draw_approaches(drawn, CONDITIONS), folder / "contact"), page, *runs], summary


CONDITIONS = (
    "iiwa14 at 1 kHz, each command one period late, sensors, noise and torque limits as in the sampled study; "
    "K_x = 500 N/m and 30 N m/rad\n"
    "the hand, a sphere of 20 mm, comes to the wall halfway of a move of 20 cm; wall: Hunt and Crossley, c = 0.3 s/m"
)
