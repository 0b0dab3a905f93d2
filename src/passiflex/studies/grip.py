"""A load that the law does not know: how far it sags, what lifting it costs, what an observer reads of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.control.posture import posture
from passiflex.files import require_writable
from passiflex.passivity import audit
from passiflex.plotting.grip import Lifted, draw_grip
from passiflex.robots import FlexibleJointRobot
from passiflex.simulation import Run, Scenario, resolve, simulate_problem
from passiflex.stability.judgement import judge
from passiflex.studies.paper import Report, shipped_scenario
from passiflex.studies.written import Written, write_study

Array = NDArray[np.float64]

MASS, GRAVITY, LIFT = 2.0, 9.81, 0.2
"""Of the load [kg], what pulls at it [m/s²], and how far it is to be lifted [m]."""
STIFFNESS = 500.0
"""K_x [N/m]."""
PICKED, LIFTED, SET_DOWN = (2.5, 3.0), (5.5, 6.0), (7.5, 8.0)
"""Times [s] at rest: with the load below, with it above, and without it."""
WAYS: dict[str, dict[str, Any]] = {
    "2 kg, unknown": {},
    "2 kg, known": {"environment[0].known": True, "name": "grip_known"},
    "2 kg, unknown, tank of 2 J": {"tank.initial": 2, "name": "grip_poor"},
}
"""Titles, and by what their scenarios differ from the shipped one."""
HEAVIEST = 14.0
"""What the arm carries by its data sheet [kg]."""
SOME = 20
"""Every so many rows are looked at for the weight that is read."""


class Grip(NamedTuple):
    """What became of the load.

    Attributes
    ----------
    sag, foreseen: By how much it pulls the hand down at rest, and m g (1/K_x + J K⁻¹ Jᵀ) [m].
    dip: Deepest point after it was picked up, below the start [m].
    read: Mass that the observer's torque stands for at rest [kg]; not finite without one.
    raised: How far the load was lifted [m].
    stored: m g h of that [J].
    drawn: By how much the tank fell from the start to the end [J].
    held_back: Time in which the reference was held back [s].
    margin: Least of what law and motors might still have given [J].
    verdict: Of the run.
    """

    sag: float
    foreseen: float
    dip: float
    read: float
    raised: float
    stored: float
    drawn: float
    held_back: float
    margin: float
    verdict: str


def grip(way: str) -> Scenario:
    """Return the scenario of a way to hold it."""
    return shipped_scenario("grip").changed(WAYS[way])


def height(run: Run) -> Array:
    """Return how far the hand is above its start [m]."""
    return run["position"][:, 2] - run["position"][0, 2]


def read_mass(run: Run) -> tuple[Array, Array]:
    """Return times [s] and the mass [kg] that stands for the external torque as the law believes it."""
    robot = FlexibleJointRobot.load(run.scenario.robot)  # type: ignore[union-attr]
    numbers, rows = robot.nominal(), range(0, run.time.size, SOME)
    read = [
        np.linalg.lstsq(posture(robot, run["measured_q"][k], numbers).jacobian.T, run["believed_tau_e"][k])[
            0
        ][2]
        for k in rows
    ]
    return run.time[::SOME], -np.array(read) / GRAVITY


def gripped(run: Run, read: tuple[Array, Array]) -> Grip:
    """Return what became of a run."""
    up, level, result = height(run), run["tank_energy"], audit(run)
    below, above, after = ((run.time > a) & (run.time < b) for a, b in (PICKED, LIFTED, SET_DOWN))
    robot = FlexibleJointRobot.load(run.scenario.robot)  # type: ignore[union-attr]
    J = posture(robot, run["q"][below][-1], robot.nominal()).jacobian[2]
    raised = run["load_way"][above][-1, 2]
    return Grip(
        sag=-float(up[below].mean()),
        foreseen=MASS * GRAVITY * float(1 / STIFFNESS + J @ (J / robot.joint_stiffness)),
        dip=-float(up.min()),
        read=float(read[1][(read[0] > PICKED[0]) & (read[0] < PICKED[1])].mean()),
        raised=float(raised),
        stored=MASS * GRAVITY * float(raised),
        drawn=float(level[0] - level[after].mean()),
        held_back=float(run["governed_time"][-1]),
        margin=result.margin,
        verdict=result.verdict,
    )


def holds(mass: float) -> bool:
    """Return whether the gains hold with a load [kg] that the law does not know, by the judge of all runs."""
    there = {"payload": {"mass": mass, "known": False}} if mass else {}
    return judge(resolve(shipped_scenario("grip").changed({"environment": [], **there}))).stable


def reproduce_grip(folder: Path, report: Report = lambda text: None) -> Written:
    """Run the study, write its figure, page and table into `folder`; return the paths, and the part of the summary."""
    require_writable(folder)
    runs: dict[str, Run] = {}
    numbers: dict[str, Any] = {}
    drawn = []
    table = [["way", "sag, *closed form*", "dip", "lifted by", "*m g h*", "drawn from the tank", "held back"]]
    for way in WAYS:
        report(f"grip: {way}")
        run = runs[way] = simulate_problem(resolve(grip(way)))
        read = read_mass(run)
        found = gripped(run, read)
        numbers[run.name] = found._asdict()
        drawn.append(Lifted(way, run.time, height(run), run["tank_energy"], *read))
        table.append(
            [
                way, f"{1e3 * found.sag:.1f} mm" + (f", *{1e3 * found.foreseen:.1f}*" if "unknown" in way else ""),
                f"{1e3 * found.dip:.0f} mm", f"{1e3 * found.raised:.0f} mm", f"{found.stored:.2f} J",
                f"{found.drawn:.2f} J", f"{found.held_back:.1f} s",
            ]
        )  # fmt: skip
    report("grip: drawing")
    wanted = runs["2 kg, known"]
    reference = wanted.time, wanted["desired_position"][:, 2] - wanted["position"][0, 2]
    foreseen = numbers["grip"]["foreseen"]
    figure = draw_grip(drawn, reference, foreseen, MASS, CONDITIONS)
    return write_study("grip", folder, figure, runs, table, numbers)


CONDITIONS = (
    "iiwa14 at 1 kHz, each command one period late, sensors, noise and torque limits as in the sampled study; "
    "K_x = 500 N/m\n"
    "2 kg picked up at 1 s, lifted from 3 to 4.5 s, set down at 6 s; port tank of 5 J unless said, floor 0.1 J"
)
