"""Gains with a stated margin, for a robot at a rate and a delay: K_e = K, and the B_e of each joint."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import ArrayLike, NDArray

from passiflex.errors import NameUnknownError, SizeError, ValueRangeError
from passiflex.limits.planes import FINE
from passiflex.limits.recommendation import Recommendation
from passiflex.limits.robust import Family, perturbations
from passiflex.limits.subject import DELAY, RATE, number
from passiflex.limits.torque_noise import torque_by_noise
from passiflex.limits.workspace import workspace_postures
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.simulation import Problem, parse_scenario, resolve
from passiflex.simulation.admissible import INERTIA_RATIOS, SCAN, least_inertia
from passiflex.simulation.linear_loop import LinearLoop

Array = NDArray[np.float64]
Report = Callable[[str], None]

SIZES = {"pose": 6, "position": 3}
FLOORS = {"plain": 0.0, "matched": 0.03}
"""Least B_e/B. The matched loop is stable far below 0.03 B, but bears less delay there and makes more noise."""
NOISE_SHARE = 1 / 10
"""Most motor torque that the torque sensors' noise may make, rms, as a share of the joint's limit."""
STEP = 1.05
"""By how much B_e is raised at a time."""
DIGITS = 3
"""To which B_e is rounded, up."""


def recommend(
    robot: FlexibleJointRobot | str | Path,
    rate: float | str,
    delay: float | str = 0.0,
    margin: float = 0.2,
    *,
    task: str = "pose",
    inner_loop: str = "matched",
    stiffness: ArrayLike = 60.0,
    damping: ArrayLike = 20.0,
    null_space_damping: float = 5.0,
    torque_noise: float = 0.2,
    sensors: Mapping[str, Any] | None = None,
    postures: ArrayLike | None = None,
    report: Report = lambda text: None,
) -> Recommendation:
    """Return K_e = K and the smallest B_e that holds with the margin and keeps the noise small.

    B_e of a joint is the largest of the floor of its inner loop (`FLOORS`); what keeps the torque that the
    sensors' noise makes below `NOISE_SHARE` of the joint's limit; and what the margin needs, for which all
    joints are raised by a common factor. The law's model stays nominal: the robot is off. The arm's
    weight is left out: what it adds is slow.

    Parameters
    ----------
    robot: Or its name in the catalogue, or the path of its file.
    rate, delay: [Hz], [s]; text may name a unit.
    margin: `limits.robust.perturbations` says what it stands for.
    task: pose or position.
    inner_loop: plain or matched.
    stiffness, damping: K_x and D_x: (k, k), or one number for all axes.
    null_space_damping: k_ns [1/s].
    torque_noise: Variance of the noise of the torque sensors, white over the samples [(N m)²].
    sensors: As in a scenario; they tell the truth if left out.
    postures: (p, n) rad; six of `limits.workspace` if left out.
    report: Is told what is being done.

    Raises
    ------
    ValueRangeError
        For a rate, delay or margin that makes no sense, or if no B_e up to 4 B holds.
    NameUnknownError, SizeError
        For an unknown robot, task or inner loop, or postures that do not fit.
    """
    robot = robot if isinstance(robot, FlexibleJointRobot) else FlexibleJointRobot.load(robot)
    hertz, late = number("rate", rate, RATE), number("delay", delay, DELAY)
    for kind, name, known in (("task", task, SIZES), ("inner loop", inner_loop, FLOORS)):
        if name not in known:
            raise NameUnknownError(kind, name, known)
    cases = perturbations(robot.n, margin)
    if not (torque_noise >= 0 and math.isfinite(torque_noise)):
        raise ValueRangeError(
            "torque_noise", got=f"{torque_noise:g}", needs="a variance in (N m)^2, 0 or more"
        )
    places = workspace_postures(robot, SIZES[task]) if postures is None else np.atleast_2d(postures)
    if places.ndim != 2 or places.shape[1] != robot.n:
        raise SizeError("postures", got=places.shape, needs=f"(postures, {robot.n}) in rad")
    law = {
        "type": "impedance",
        "task": task,
        "gravity": "robot",
        "shaped_stiffness": {"ratio": 1},
        "shaped_inertia": {"ratio": 1},
        "stiffness": {"matrix": _matrix(stiffness, SIZES[task])},
        "damping": {"matrix": _matrix(damping, SIZES[task])},
        "null_space_damping": null_space_damping,
    }
    control = {"rate": hertz, "delay": late, "inner_loop": inner_loop, "external_torque": "none"}
    report("resolving the postures")
    problems = [_problem(robot, q, law, control, sensors) for q in places]
    report(f"{len(problems)} postures, {len(cases)} cases each")
    family = Family.of(problems, cases)
    report("raising B_e until all of them hold")
    search = _Search(family, robot, torque_noise)
    search.run(FLOORS[inner_loop])
    gains = search.gains()
    return Recommendation(
        robot=robot.name,
        rate=hertz,
        delay=late,
        inner_loop=inner_loop,
        margin=margin,
        shaped_stiffness=gains["shaped_stiffness"],
        shaped_inertia=gains["shaped_inertia"],
        inertia_ratio=gains["shaped_inertia"] / robot.motor_inertia,
        postures=places,
        worst=family.worst(gains),
        torque_noise=search.noise(gains),
        torque_limit=robot.torque_limit,
        decided_by=tuple(search.decided),
    )


class _Search:
    """B_e/B per joint, raised until the family holds and the noise is small."""

    def __init__(self, family: Family, robot: FlexibleJointRobot, variance: float):
        self.family, self.robot, self.variance = family, robot, variance
        self.loops = [LinearLoop(p) for p in family.problems]
        self.ratio, self.decided = np.zeros(robot.n), ["floor"] * robot.n

    def run(self, floor: float) -> None:
        """Raise from the floor, or from where the nominal robot is stable."""
        s = self.loops[0].s
        nominal = max(least_inertia(loop, 1.0, s.period, s.delay, SCAN, FINE) for loop in self.loops)
        self._raise(np.full(self.robot.n, max(floor, nominal)), "floor" if floor >= nominal else "margin")
        while True:
            while not self.family.stable(self.gains()):
                self._raise(STEP * self.ratio, "margin")
            if not self._quietened():
                return

    def _quietened(self) -> bool:
        """Raise what is too loud, joint by joint, and return whether there was anything."""
        allowed = NOISE_SHARE * self.robot.torque_limit
        raised = False
        while (excess := self.noise(self.gains()) / allowed).max() > 1:
            # Near the border of stability it is resonance that is loud: a little more B_e, and it is gone.
            self._raise(self.ratio * np.where(excess > 1, np.clip(excess, 1 + FINE, STEP), 1), "noise")
            raised = True
        return raised

    def gains(self) -> dict[str, Array]:
        """Return K_e and B_e, rounded up."""
        inertia = np.array([_rounded_up(v) for v in self.ratio * self.robot.motor_inertia])
        return {"shaped_stiffness": self.robot.joint_stiffness, "shaped_inertia": inertia}

    def noise(self, gains: Mapping[str, Array]) -> Array:
        """Return the rms torque by noise of each motor, at the posture that is worst for it."""
        rms = [torque_by_noise(loop.driven(gains=gains), self.variance) for loop in self.loops]
        return np.max(rms, axis=0)

    def _raise(self, ratio: Array, why: str) -> None:
        if not (ratio <= INERTIA_RATIOS[1]).all():
            raise ValueRangeError(
                "no B_e holds with this margin",
                got=f"B_e raised to {INERTIA_RATIOS[1]:g} B in vain, because of the {why}",
                needs="a loop that is stable on every robot of the margin",
                try_="a higher rate, less delay, a softer K_x, another D_x, a smaller margin, or inner_loop: matched",
            )
        self.decided = [
            why if new > old else was for new, old, was in zip(ratio, self.ratio, self.decided, strict=True)
        ]
        self.ratio = ratio


def _problem(
    robot: FlexibleJointRobot,
    q: Array,
    law: dict[str, Any],
    control: dict[str, Any],
    sensors: Mapping[str, Any] | None,
) -> Problem:
    data: dict[str, Any] = {
        "name": "recommend",
        "robot": robot.name,
        "posture": q.tolist(),
        "law": law,
        "control": control,
        "duration": 1 / control["rate"],
        "output_interval": 1 / control["rate"],
    }
    if sensors:
        data["sensors"] = dict(sensors)
    return resolve(parse_scenario(yaml.safe_dump(data), "recommend"), robot)


def _matrix(value: ArrayLike, size: int) -> list[list[float]]:
    given = np.asarray(value, dtype=float)
    return (given * np.eye(size) if given.ndim == 0 else given).tolist()


def _rounded_up(value: float) -> float:
    """Return the value with `DIGITS` digits, rounded up."""
    places = DIGITS - 1 - math.floor(math.log10(value))
    return math.ceil(round(value * 10**places, 6)) / 10**places
