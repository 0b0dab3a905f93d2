"""An arm as a card looks at it: a law at a rate and a delay, in postures over its workspace, with a margin."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from passiflex.control.posture import posture
from passiflex.limits.margin_box import MarginBox, Member
from passiflex.problems.altered import altered
from passiflex.problems.problem import SampledProblem, require_sampled
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.scenarios.scenario_file import parse_scenario
from passiflex.simulation import resolve
from passiflex.stability.modes import Spectrum

Array = NDArray[np.float64]

Scales = tuple[float, float]
"""Multiples of the designed damping: of translation and rotation."""

SCALES: tuple[Scales, ...] = tuple(
    sorted(
        itertools.product((4.0, 2.8, 2.0, 1.4, 1.0, 0.7, 0.5, 0.35), (2.0, 1.0, 0.5, 0.35)),
        key=lambda scales: abs(math.log(scales[0])) + abs(math.log(scales[1])),
    )
)
"""What is tried of them, the nearest to the design first."""
STIFFEST = {"translation": 30_000.0, "rotation": 3_000.0}
"""[N/m], [N m/rad] Nothing stiffer is looked for, and nothing stiffer than the springs of the joints."""
MARGIN = 0.2
"""By how much B, K, D and the links' inertia of each joint may be off, and the delay, of a period."""
RATIO = 0.7
"""Damping ratio of a design, by the inertia that moves."""
ROTATION, TRANSLATION = 30.0, 500.0
"""K_x of the part that is not looked at [N m/rad], [N/m]."""
FIXED = 1e-6
"""Share of the largest mobility below which the end effector cannot go that way."""
NEAREST = 2
"""Postures at which the box is searched where that is not done at all of them."""
TOOL_CENTRE, TOOL_RADIUS = 0.08, 0.04
"""[m] Where the centre of a tool of some mass is above the flange, and its radius of gyration."""


class Found(NamedTuple):
    """Which robot of which setting dies out last, and its spectral radius per period."""

    radius: float
    setting: Setting
    member: Member

    @property
    def angles(self) -> Array:
        """Return its posture (n,) rad."""
        return self.setting.box.angles(self.member)

    def mode(self, gains: Mapping[str, Array]) -> Spectrum:
        """Return what dies out last."""
        loop, late = self.setting.box.loop(self.member)
        return loop.spectrum(1 / self.setting.rate, late, gains)


@dataclass(frozen=True, eq=False)
class Setting:
    """One way to run an arm.

    Attributes
    ----------
    robot: The arm.
    rate, delay: [Hz], [s].
    postures: (p, n) rad.
    task: pose or position.
    tool: Mass on the flange [kg], of which the law knows.
    inner_loop: plain or matched.
    inertia: B_e (n,) [kg m²]; B where None, which is no shaping.
    differences: Whether velocities are differences of readings, as on most arms.
    margin: Of the box.
    order: In which dampings are tried.
    """

    robot: FlexibleJointRobot
    rate: float
    delay: float
    postures: Array
    task: str = "pose"
    tool: float = 0.0
    inner_loop: str = "plain"
    inertia: Array | None = None
    differences: bool = True
    margin: float = MARGIN
    _members: list[Member] = field(default_factory=list)
    order: list[Scales] = field(default_factory=lambda: list(SCALES))

    def at(self, rate: float, delay: float) -> Setting:
        """Return it at another rate [Hz] and delay [s], asked of the same robots."""
        return dataclasses.replace(self, rate=rate, delay=delay, _members=list(self.members))

    @property
    def scenario(self) -> dict[str, Any]:
        """Return the entries of its scenario, but for the posture."""
        size = 6 if self.task == "pose" else 3
        inertia: Any = {"ratio": 1.0} if self.inertia is None else {"value": self.inertia.tolist()}
        law = {
            "type": "impedance",
            "task": self.task,
            "gravity": "robot",
            "shaped_stiffness": {"ratio": 1.0},
            "shaped_inertia": inertia,
            "stiffness": {"matrix": np.eye(size).tolist()},
            "damping": {"matrix": np.eye(size).tolist()},
            "null_space_damping": 5.0,
        }
        data: dict[str, Any] = {
            "name": "card",
            "robot": self.robot.name,
            "law": law,
            "control": {
                "rate": self.rate,
                "delay": self.delay,
                "inner_loop": self.inner_loop,
                "external_torque": "none",
                "allow_unstable": True,
            },
            "duration": 1 / self.rate,
            "output_interval": 1 / self.rate,
        }
        if self.tool:
            sphere = [self.tool * TOOL_RADIUS**2] * 3
            data["tool"] = {"mass": self.tool, "centre": [0, 0, TOOL_CENTRE], "inertia": sphere}
        if self.differences:
            data["sensors"] = {"velocity": "differences"}
        return data

    @cached_property
    def box(self) -> MarginBox:
        """Return the robots that it is to hold for, at its postures."""
        return MarginBox(self._problems, self.margin)

    @cached_property
    def _problems(self) -> tuple[SampledProblem, ...]:
        return tuple(self._problem(q) for q in self.postures)

    def _problem(self, q: Array) -> SampledProblem:
        text = yaml.safe_dump(self.scenario | {"posture": q.tolist()})
        return require_sampled(resolve(parse_scenario(text), self.robot))

    def simulated(self, member: Member, gains: Mapping[str, Array]) -> SampledProblem:
        """Return the nonlinear problem of a robot of the box with these gains, where it stands and as late as it is."""
        there = altered(self._problem(self.box.angles(member)), gains=gains, plant=self.box.plant(member))
        return dataclasses.replace(require_sampled(there), delay=self.box.late(member))

    @property
    def members(self) -> list[Member]:
        """Return the robots that are asked first: the nominal one, and those that have mostly decided, then others."""
        if not self._members:
            self._members.extend([*self.box.centres(), *self.box.usual_suspects()])
        return self._members

    @cached_property
    def felt(self) -> tuple[float, float]:
        """Return what moves with the end effector, motors included, on average over postures and the ways it can go.

        In kg and kg m².
        """
        found = []
        for problem in self._problems:
            numbers = problem.law.robot.layout.unpack(problem.model)
            at = posture(self.robot, problem.q, numbers)
            motors = numbers["motor_inertia"] if self.inertia is None else self.inertia
            J, moving = at.jacobian, at.mass_matrix + np.diag(motors)
            mobility = J @ np.linalg.solve(moving, J.T)
            halves = [mobility[:3, :3]] if self.task == "position" else [mobility[:3, :3], mobility[3:, 3:]]
            values = [np.linalg.eigvalsh(half) for half in halves]
            found.append([float(np.mean(np.log(v[v > FIXED * v[-1]]))) for v in values])
        means = np.exp(-np.mean(found, axis=0))
        return float(means[0]), float(means[-1])

    @cached_property
    def springs(self) -> dict[str, float]:
        """Return what the joint springs alone are at the end effector, by part: softest direction, mean of postures."""
        found = []
        for problem in self._problems:
            numbers = problem.law.robot.layout.unpack(problem.model)
            J = posture(self.robot, problem.q, numbers).jacobian
            give = J @ np.diag(1 / self.robot.joint_stiffness) @ J.T
            found.append([np.log(np.linalg.eigvalsh(half)[-1]) for half in (give[:3, :3], give[3:, 3:])])
        means = np.exp(-np.mean(found, axis=0))
        return {"translation": float(means[0]), "rotation": float(means[1])}

    @property
    def stiffest(self) -> dict[str, float]:
        """Return the K_x beyond which nothing is looked for, by part."""
        return {part: min(most, self.springs[part]) for part, most in STIFFEST.items()}

    def gains(self, translation: float, rotation: float, scales: Scales = (1.0, 1.0)) -> dict[str, Array]:
        """Return K_x and D_x, isotropic; the damping is `scales` times that of `RATIO`."""
        heavy, bulky = self.felt
        push, turn = (2 * RATIO * np.sqrt(k * m) for k, m in ((translation, heavy), (rotation, bulky)))
        K, D = np.repeat([translation, rotation], 3), np.repeat([scales[0] * push, scales[1] * turn], 3)
        size = 6 if self.task == "pose" else 3
        return {"stiffness": np.diag(K[:size]), "damping": np.diag(D[:size])}

    def holds(
        self, gains: Mapping[str, Array], period: float | None = None, delay: float | None = None
    ) -> bool:
        """Return whether all robots that are known hold with these gains; the one that failed last is asked first.

        `period` [s] and `delay` [s] are its own unless given; the members' share of the period goes along.
        """
        T = 1 / self.rate if period is None else period
        for i, member in enumerate(self.members):
            loop, late = self.box.loop(member)
            if delay is not None or period is not None:
                own = self.delay if delay is None else delay
                late = max(own + (late - self.delay) * T * self.rate, 0.0)
            if not loop.holds(T, late, gains):
                self.members.insert(0, self.members.pop(i))
                return False
        return True

    def worst(self, gains: Mapping[str, Array]) -> Found:
        """Return which of the robots that are known dies out last with these gains."""
        return max(
            (Found(self.radius(m, gains), self, m) for m in self.members), key=lambda found: found.radius
        )

    def radius(self, member: Member, gains: Mapping[str, Array]) -> float:
        """Return the spectral radius per period of a robot with these gains."""
        loop, late = self.box.loop(member)
        return loop.radius(1 / self.rate, late, gains)

    def searched(self, gains: Mapping[str, Array], *, thorough: bool = True) -> bool:
        """Return whether nothing that fails is found in the box; what is found is asked from then on, in all postures.

        Thorough: at every posture; else at those two where the robots that are known die out last.
        """
        places = range(len(self.postures))
        for place in places if thorough else self._nearest(gains):
            worst = self.box.search(gains, place, thorough=False)
            if not worst.stable:
                alike = (worst.member._replace(posture=other) for other in places if other != place)
                self.members[:0] = [worst.member, *(m for m in alike if not self.radius(m, gains) < 1)]
                return False
        return True

    def _nearest(self, gains: Mapping[str, Array]) -> list[int]:
        last = dict.fromkeys(range(len(self.postures)), 0.0)
        for member in self.members:
            last[member.posture] = max(last[member.posture], self.radius(member, gains))
        return sorted(last, key=lambda place: -last[place])[:NEAREST]
