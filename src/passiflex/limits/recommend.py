"""Gains with a stated margin, for a robot at a rate and a delay: K_e = K, B_e joint by joint, the better inner loop."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import ArrayLike, NDArray

from passiflex.control.task import AbstractTask, PoseTask, PositionTask
from passiflex.errors import NameUnknownError, ScenarioError, SizeError, ValueRangeError
from passiflex.limits.attempt import Attempt, Report
from passiflex.limits.inertia_search import FLOORS, MOST, HeavierError, InertiaSearch, UnattainableError
from passiflex.limits.one_thread import on_one_thread
from passiflex.limits.recommendation import Recommendation
from passiflex.limits.subject import DELAY, RATE, number
from passiflex.limits.workspace import workspace_postures
from passiflex.robots.flexible import FlexibleJointRobot

Array = NDArray[np.float64]

SIZES = {"pose": 6, "position": 3}
TASKS: dict[str, type[AbstractTask]] = {"pose": PoseTask, "position": PositionTask}
HALVINGS = 4
"""Of a margin that nothing holds, to find the largest that can be had."""
ORDER = ("plain", "matched")


def recommend(
    robot: FlexibleJointRobot | str | Path,
    rate: float | str,
    delay: float | str = 0.0,
    margin: float = 0.2,
    *,
    task: str = "pose",
    inner_loop: str | None = None,
    gravity: str = "robot",
    stiffness: ArrayLike = 60.0,
    damping: ArrayLike = 20.0,
    null_space_damping: float = 5.0,
    torque_noise: float = 0.2,
    sensors: Mapping[str, Any] | None = None,
    postures: ArrayLike | None = None,
    report: Report = lambda text: None,
) -> Recommendation:
    """Return K_e = K and the smallest B_e of each joint that hold with the margin and keep the noise small.

    The margin is a box (`limits.margin_box`): B, K, D and the links' inertia of each joint off by up to that
    share, the delay by up to that many periods, at the postures and near them. B_e of a joint is the largest of
    the floor of its inner loop (`FLOORS`), what keeps the torque that the sensors' noise makes below a tenth of
    the joint's limit (a quarter on the worst robots), and what the box needs. The worst member is confirmed by
    the nonlinear loop with sensors, noise and limits. The law's model stays nominal: the robot is off.

    Parameters
    ----------
    robot: Or its name in the catalogue, or the path of its file.
    rate, delay: [Hz], [s]; text may name a unit.
    margin: 0 to below 1, as 0.2 for 20 %.
    task: pose or position.
    inner_loop: plain or matched; the better of the two if left out.
    gravity: robot, motor or static.
    stiffness, damping: K_x and D_x: (k, k), or one number for all axes.
    null_space_damping: k_ns [1/s].
    torque_noise: Variance of the noise of the torque sensors, white over the samples [(N m)²].
    sensors: As in a scenario; they tell the truth if left out.
    postures: (p, n) rad; six of `limits.workspace` if left out.
    report: Is told what is being done.

    Raises
    ------
    ValueRangeError
        For a rate, delay or margin that makes no sense, or if no B_e holds; the message says the largest margin
        that can be had.
    NameUnknownError, SizeError
        For an unknown robot, task or inner loop, or postures that do not fit.
    """
    robot = robot if isinstance(robot, FlexibleJointRobot) else FlexibleJointRobot.load(robot)
    hertz, late = number("rate", rate, RATE), number("delay", delay, DELAY)
    for kind, name, known in (("task", task, SIZES), ("inner loop", inner_loop or "plain", FLOORS)):
        if name not in known:
            raise NameUnknownError(kind, name, known)
    law = {
        "type": "impedance",
        "task": task,
        "gravity": gravity,
        "shaped_stiffness": {"ratio": 1},
        "shaped_inertia": {"ratio": 1},
        "stiffness": {"matrix": _matrix(stiffness, SIZES[task])},
        "damping": {"matrix": _matrix(damping, SIZES[task])},
        "null_space_damping": null_space_damping,
    }
    data: dict[str, Any] = {
        "name": "recommend",
        "robot": robot.name,
        "posture": [0.0] * robot.n,
        "law": law,
        "control": {"rate": hertz, "delay": late, "external_torque": "none"},
        "duration": 1 / hertz,
        "output_interval": 1 / hertz,
    }
    if sensors:
        data["sensors"] = dict(sensors)
    places = workspace_postures(robot, TASKS[task]()) if postures is None else np.atleast_2d(postures)
    return recommend_gains(
        yaml.safe_dump(data), robot, places, margin, torque_noise, inner_loop=inner_loop, report=report
    )


@on_one_thread
def recommend_gains(
    scenario: str,
    robot: FlexibleJointRobot,
    postures: ArrayLike,
    margin: float,
    torque_noise: float,
    *,
    inner_loop: str | None = None,
    report: Report = lambda text: None,
) -> Recommendation:
    """Return the same for the text of a scenario, whose shaping, inner loop and posture do not matter."""
    places = np.atleast_2d(np.asarray(postures, dtype=float))
    if places.ndim != 2 or places.shape[1] != robot.n:
        raise SizeError("postures", got=places.shape, needs=f"(postures, {robot.n}) in rad")
    if not 0 <= margin < 1:
        raise ValueRangeError("margin", got=f"{margin:g}", needs="0 to below 1, as 0.2 for 20 %")
    if not (torque_noise >= 0 and math.isfinite(torque_noise)):
        raise ValueRangeError(
            "torque_noise", got=f"{torque_noise:g}", needs="a variance in (N m)^2, 0 or more"
        )
    found: dict[str, Recommendation] = {}
    failures: dict[str, UnattainableError] = {}
    tried, others = dict[str, Attempt](), dict[str, str]()
    for inner in ORDER if inner_loop is None else (inner_loop,):
        try:
            tried[inner] = Attempt(scenario, robot, places, torque_noise, inner, report)
        except ScenarioError as unfit:  # with this clock it is no choice
            if inner_loop is not None:
                raise
            others[inner] = f"is none here: {unfit.mistakes[0].partition(': ')[2]}"
            mistaken = unfit
    if not tried:
        raise mistaken
    begun: dict[str, InertiaSearch] = {}
    for inner, attempt in tried.items():
        try:
            begun[inner] = attempt.begun(margin)
        except UnattainableError as failure:
            failures[inner] = failure
    below = math.inf
    others |= {k: f"holds with no B_e: {v.got}" for k, v in failures.items()}
    for inner in sorted(begun, key=lambda k: begun[k].mean):  # the lighter one is likely to stay so
        try:
            found[inner] = tried[inner].finished(begun[inner], below)
        except UnattainableError as failure:
            failures[inner], others[inner] = failure, f"holds with no B_e: {failure.got}"
        except HeavierError as heavier:
            others[inner] = f"needs at least {heavier.got} B_e"
        else:
            below = begun[inner].mean
    if not found:
        raise _nothing(tried, failures, margin)
    best = min(found, key=lambda k: begun[k].mean)
    others |= {
        k: f"needs {begun[k].mean / begun[best].mean:.2g} times as much B_e" for k in found if k != best
    }
    return dataclasses.replace(
        found[best], other="; ".join(f"the {k} inner loop {why}" for k, why in others.items())
    )


def _nothing(
    tried: Mapping[str, Attempt], failures: Mapping[str, UnattainableError], margin: float
) -> ValueRangeError:
    """Return the refusal, with the largest margin that can be had."""
    low, high, best = 0.0, margin, ""
    for i in range(HALVINGS + 1 if margin else 0):
        middle = 0.0 if i == 0 else (low + high) / 2
        for inner, attempt in tried.items():
            try:
                attempt.finished(attempt.begun(middle), confirmed=False)
            except UnattainableError:
                continue
            low, best = middle, inner
            break
        else:
            if i == 0:
                break
            high = middle
    inner, failure = next(iter(failures.items()))
    largest = f"a margin of {low:.2g} holds with the {best} inner loop; " if best and low else ""
    if best and not low:
        largest = f"only the robot itself, without a margin, holds with the {best} inner loop; "
    return ValueRangeError(
        "no B_e holds with this margin",
        got=f"margin {margin:g}: {failure.got or failure.what}",
        needs=f"a loop that is stable with at most {MOST:g} B on every robot of the margin",
        try_=largest + "a higher rate, less delay, a softer K_x or another D_x",
    )


def _matrix(value: ArrayLike, size: int) -> list[list[float]]:
    given = np.asarray(value, dtype=float)
    return (given * np.eye(size) if given.ndim == 0 else given).tolist()
