"""One inner loop at a margin: least B_e on the box, then the judge and the nonlinear loop on what was found."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.limits.confirmation import settled
from passiflex.limits.inertia_search import InertiaSearch, UnattainableError
from passiflex.limits.margin_box import MarginBox
from passiflex.limits.recommendation import Recommendation
from passiflex.problems.altered import rewritten
from passiflex.problems.free_space import in_free_space
from passiflex.problems.problem import SampledProblem, require_sampled
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.simulation import parse_scenario, resolve
from passiflex.stability.judgement import judge
from passiflex.texts.yaml_tree import read_back

Array = NDArray[np.float64]
Report = Callable[[str], None]

CONFIRMED, FIRMER = 6, 1.2
"""Nonlinear simulations of the worst member at most, and by how much B_e is raised after one that does not settle."""


PARTS = {"law": "law at one of the postures", "gains": "change of gains", "fallback": "fallback"}
"""What of a scenario may not hold although the box does."""


class Attempt:
    """One inner loop: what it reaches at a margin."""

    def __init__(
        self,
        scenario: str,
        robot: FlexibleJointRobot,
        places: Array,
        variance: float,
        inner: str,
        report: Report,
    ):
        self.robot, self.variance, self.inner, self.report = robot, variance, inner, report
        report(f"{inner} inner loop: compiling, {len(places)} postures")
        shaping = {"shaped_stiffness": {"ratio": 1}, "shaped_inertia": {"ratio": 1}}
        control = {"inner_loop": inner, "external_torque": "none", "allow_unstable": False}
        text = rewritten(scenario, {"law": shaping, "control": control})
        there = (_sampled(rewritten(text, {"posture": q.tolist()}), robot) for q in places)
        self.problems = tuple(map(in_free_space, there))

    def begun(self, margin: float) -> InertiaSearch:
        """Return a search whose ratios hold on the members that mostly decide: less it cannot be.

        Raises
        ------
        UnattainableError
            If there are none.
        """
        self.report(f"{self.inner} inner loop: least B_e on a box of ±{margin:g}")
        search = InertiaSearch(MarginBox(self.problems, margin), self.robot, self.variance, self.inner)
        search.begin()
        return search

    def finished(
        self, search: InertiaSearch, below: float = math.inf, *, confirmed: bool = True
    ) -> Recommendation:
        """Return the gains that hold on the whole box.

        Raises
        ------
        UnattainableError
            If there are none.
        HeavierError
            As soon as the mean of B_e/B is sure to be this much or more.
        """
        for _ in range(CONFIRMED):
            self.report(f"{self.inner} inner loop: searching the box, mean B_e {search.mean:.2g} B")
            search.run(below)
            entry = self._entry(search)
            why = self._refused(search, entry) if confirmed else ""
            if not why:
                return self._recommendation(search, entry)
            search.raise_all(FIRMER, why)
        raise UnattainableError(
            "no B_e passes on the worst robot of the margin",
            got=f"B_e raised {CONFIRMED} times in vain, because of the {why}",
        )

    def _refused(self, search: InertiaSearch, entry: Mapping[str, Any]) -> str:
        """Return what does not hold of gains that hold on the box, by the judge and by the nonlinear loop."""
        for problem in self.problems:
            text = rewritten(problem.text, entry)
            found = judge(_sampled(text, self.robot))
            if not found.stable:
                return "missed periods" if found.missed else PARTS[found.part]
        member = search.worst.member
        box, (_, late) = search.box, search.box.loop(member)
        there = {**entry, "posture": box.angles(member).tolist()}
        text = rewritten(self.problems[member.posture].text, there)
        problem = _sampled(text, self.robot)
        return "" if settled(problem, box.plant(member), late, self.variance) else "simulation"

    def _entry(self, search: InertiaSearch) -> dict[str, Any]:
        """Return the sections of a scenario with these gains, and with a fallback that holds where they do."""
        gains, box = search.gains(), search.box
        inertia = {"shaped_inertia": [float(v) for v in gains["shaped_inertia"]]}
        own = {"shaped_stiffness": {"ratio": 1}} | inertia
        data = read_back(rewritten(self.problems[0].text, {"law": own}))
        back = gains | {"shaped_inertia": self.robot.motor_inertia}
        suspects = [*box.centres(), *search.active, search.worst.member]
        if not all(box.radius(m, back) < 1 for m in suspects):
            fallback = {
                k: v for k, v in data["control"].get("fallback", {}).items() if k in ("stiffness", "damping")
            }
            data["control"]["fallback"] = fallback | inertia
        names = ("law", "control", "sensors", "output_interval")
        return {name: data[name] for name in names if name in data}

    def _recommendation(self, search: InertiaSearch, entry: Mapping[str, Any]) -> Recommendation:
        gains, box, worst = search.gains(), search.box, search.worst
        s = self.problems[0]
        return Recommendation(
            robot=self.robot.name,
            rate=1 / s.period,
            delay=s.delay,
            inner_loop=self.inner,
            margin=box.margin,
            shaped_stiffness=gains["shaped_stiffness"],
            shaped_inertia=gains["shaped_inertia"],
            inertia_ratio=gains["shaped_inertia"] / self.robot.motor_inertia,
            postures=np.array([p.q for p in self.problems]),
            worst=worst,
            corner=box.words(worst.member),
            searched=box.tried,
            torque_noise=np.max([search.noise(m, gains) for m in box.centres()], axis=0),
            torque_limit=self.robot.torque_limit,
            decided_by=tuple(search.decided),
            entry=entry,
        )


def _sampled(text: str, robot: FlexibleJointRobot) -> SampledProblem:
    return require_sampled(resolve(parse_scenario(text, "recommend"), robot))
