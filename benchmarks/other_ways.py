"""What the plain sampled law costs on the plants that a user would otherwise take, and how far they are from ours."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable

import mujoco
import numpy as np
from rich.console import Console
from rich.table import Table

from core_time import best_times
from lane_limit import period_of
from mujoco_way import MujocoPlant
from passiflex.metrics.measures import SIGNALS
from passiflex.simulation import simulate_problem
from passiflex.simulation.batch import lane_loop, simulate_batch
from sampled_law import HeldPlant, SampledLaw, comparable, orders, through_samples
from scipy_way import ScipyPlant


def alternatives(console: Console, lanes_speed: float, seconds: float, repeats: int) -> None:
    """Print what the plain sampled law costs on other plants, and how far their motion is from ours."""
    problem = comparable(seconds)
    steps = int(period_of(problem).calls["plant"]) // 4
    width = lane_loop(problem).width
    run = simulate_problem(problem)
    ours = np.hstack([run["q"], run["theta"]])
    fine = through_samples(problem, ScipyPlant(problem, "DOP853", 1e-11, 1e-13), seconds)
    plants: dict[str, Callable[[], HeldPlant]] = {
        f"MuJoCo, RK4, {steps} steps a period as ours": lambda: MujocoPlant(problem, "RK4", steps),
        f"MuJoCo, implicitfast, {steps} steps a period": lambda: MujocoPlant(problem, "implicitfast", steps),
        "SciPy + Pinocchio, DOP853 1e-6": lambda: ScipyPlant(problem, "DOP853", 1e-6, 1e-8),
        "SciPy + Pinocchio, LSODA 1e-6": lambda: ScipyPlant(problem, "LSODA", 1e-6, 1e-8),
    }
    motions = {name: through_samples(problem, make(), seconds) for name, make in plants.items()}
    long = dataclasses.replace(comparable(30.0), output_interval=0.005)
    law, order, bare = SampledLaw(problem), orders(problem)[0], MujocoPlant(problem, "RK4", steps)
    at_rest = MujocoPlant(problem, "RK4", steps).state()
    periods = len(fine.levels)
    works: dict[str, Callable[[], object]] = {
        f"ours: {width} lanes": lambda: simulate_batch([long] * width, SIGNALS),
        **{
            name: functools.partial(lambda make: through_samples(problem, make(), seconds), make)
            for name, make in plants.items()
        },
        "  that law alone, in Python": lambda: [law(*at_rest, order) for _ in range(periods)],
        "  MuJoCo's plant alone, RK4, in C": lambda: mujoco.mj_step(bare.model, bare.data, steps * periods),
        "ours: one robot alone": lambda: simulate_problem(long),
    }
    taken = best_times(repeats, *works.values())
    lasting = {f"ours: {width} lanes": width * long.duration, "ours: one robot alone": long.duration}
    table = Table(
        "best", "s per robot-s", "robot-s per s", "ours, complete, is faster by",
        "q, θ off the fine solution", "off ours", "T off ours",
    )  # fmt: skip
    for name, t in zip(works, taken, strict=True):
        each = t / lasting.get(name, seconds)
        row = [name, f"{each:.2g}", f"{1 / each:.3g}", f"{lanes_speed * each:.1f}×"]
        if name in motions:
            q, levels = motions[name]
            row += [f"{np.abs(q - to).max():.1e} rad" for to in (fine.positions, ours)]
            row.append(f"{np.abs(run['tank_energy'][:-1] - levels).max():.1e} J")
        elif name.startswith("ours"):
            row.append(f"{np.abs(ours - fine.positions).max():.1e} rad")
        table.add_row(*row)
    console.print(table)
    console.print(
        f"- {seconds:g} s of the task without noise and sensor errors, plain inner loop, moving by up to "
        f"{np.abs(ours - ours[0]).max():.2g} rad; fine solution: the same law over DOP853 at 1e-11. The alternatives "
        "leave out sensors, matched inner loop, governor, valve, fallback, motor limits, the ledger and all recording "
        f"but of q, θ, T; ours has them, and 'complete' is the shipped task in lanes, {lanes_speed:.0f} robot-s per "
        "core-second",
        highlight=False,
    )
