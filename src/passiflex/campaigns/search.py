"""Where in the supports of its parameters a campaign's scenario is at its worst: a search by optimisation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from passiflex.campaigns.box import Box
from passiflex.campaigns.campaign import Campaign
from passiflex.campaigns.evaluate import evaluate_problems, together_or_alone
from passiflex.campaigns.found import Best, Case, Found, case_scenario
from passiflex.campaigns.samples import values_of_row, with_values
from passiflex.errors import NameUnknownError, PassiflexError, ValueRangeError
from passiflex.metrics.measures import MEASURES
from passiflex.problems.problem import Problem
from passiflex.problems.resolution import resolve
from passiflex.scenarios.scenario import Scenario

Array = NDArray[np.float64]
Report = Callable[[str], None]

DISTINCT = 0.1
"""Cases differ by this share of the support of a parameter, or by a word."""
LEAST_POPULATION = 8
MOST_POPULATION = 64
GENERATIONS = 32
"""Aimed at; with 400 simulations of twelve parameters 8 and 16 generations of more points found less."""
LARGEST = 1e20
"""A measure beyond this counts as this."""
DIVERGED, MEANINGLESS, IMPOSSIBLE = -1e30, 1e25, 1e30
"""Objectives of a run that diverged at its start, of one without a number, of what cannot be run."""


def search(
    campaign: Campaign,
    measure: str = "margin",
    *,
    evaluations: int = 400,
    seed: int = 0,
    keep: int = 5,
    report: Report = lambda text: None,
) -> Found:
    """Return the worst cases that differential evolution finds within the supports of the parameters.

    Every point runs the campaign's scenario with its own seed: the noise is the same everywhere, and the same seed
    of the search gives the same result. How likely a value is plays no part. A run that diverges is worse
    than any that does not, the earlier the worse. A measure that is infinite counts as very large; one that is no
    number (a settling time without a step) is no case. Points that are no possible robot or scenario
    take part in the count, and are left.

    A measure that is flat over most of the supports, as the overdraft is where nothing is violated, gives the search
    nothing to go by: the margin goes on beyond zero.

    Parameters
    ----------
    measure: Of `MEASURES`, which also says which end is the bad one.
    evaluations: Most simulations; a point that comes again is not run again.
    keep: How many cases, distinct by a tenth of the support of a parameter at least.
    report: Is told how far it is, after each batch.

    Raises
    ------
    NameUnknownError
        For an unknown measure.
    ValueRangeError
        For a parameter without a least or largest value, no parameter, or a budget too small.
    """
    from scipy.optimize import Bounds, differential_evolution

    if measure not in MEASURES:
        raise NameUnknownError("metric", measure, list(MEASURES))
    if evaluations < LEAST_POPULATION or keep < 1:
        raise ValueRangeError(
            "evaluations and keep",
            got=f"{evaluations} and {keep}",
            needs=f"at least {LEAST_POPULATION} simulations, and one case to keep",
        )
    if seed < 0:
        raise ValueRangeError("seed of the search", got=seed, needs="a whole number, ≥ 0")
    box = Box.of(campaign)
    trials = _Trials(campaign, measure, box, evaluations, report)
    population = int(np.clip(evaluations // GENERATIONS, LEAST_POPULATION, MOST_POPULATION))
    rng = np.random.default_rng(seed)
    low, high = box.bounds.T
    free = low < high  # SciPy does not take sides of no length
    if not free.any():
        trials.objective(low[:, None])
        return trials.found(seed, keep)

    def objective(points: Array) -> Array:
        full = np.repeat(low[:, None], points.shape[1], axis=1)
        full[free] = points
        return trials.objective(full)

    differential_evolution(
        objective,  # type: ignore[arg-type]
        Bounds(low[free], high[free]),
        init=_start(population, low[free], high[free], rng),
        integrality=box.whole[free],
        maxiter=4 * (evaluations // population + 1),
        tol=0,
        atol=-1.0,  # never converged: the budget ends it, or having nothing new
        callback=lambda intermediate_result: trials.spent,  # type: ignore[arg-type]
        polish=False,
        updating="deferred",
        vectorized=True,
        rng=rng,
    )
    return trials.found(seed, keep)


def _start(population: int, low: Array, high: Array, rng: np.random.Generator) -> Array:
    """Return the points to begin with, evenly spread: a Latin hypercube, (population, sides)."""
    from scipy.stats import qmc

    return np.asarray(low + qmc.LatinHypercube(low.size, rng=rng).random(population) * (high - low))


_Ready = tuple[Array, Case, Problem]


@dataclass
class _Trial:
    point: Array
    objective: float
    case: Case | None = None
    problem: Problem | None = None


@dataclass
class _Trials:
    """All points that were tried, each once."""

    campaign: Campaign
    measure: str
    box: Box
    budget: int
    report: Report
    known: dict[bytes, _Trial] = field(default_factory=dict)
    history: list[Best] = field(default_factory=list)

    @property
    def spent(self) -> bool:
        return len(self.known) >= self.budget

    def objective(self, points: Array) -> Array:
        """Return what is to become least at points (sides, points); beyond the budget, nothing is worse."""
        inside = self.box.inside(points.T) + 0.0  # no −0, which has other bytes than 0
        new = {_bytes(p): p for p in inside if _bytes(p) not in self.known}
        chosen = list(new.values())[: self.budget - len(self.known)]
        if chosen:
            self._run(chosen)
        return np.array(
            [self.known[b].objective if b in self.known else math.inf for b in map(_bytes, inside)]
        )

    def found(self, seed: int, keep: int) -> Found:
        cases: list[Case] = []
        taken: list[Array] = []
        for trial in self._cases():
            if len(cases) < keep and all(self.box.distance(trial.point, p) >= DISTINCT for p in taken):
                assert trial.case is not None
                assert trial.problem is not None
                scenario = case_scenario(trial.case.scenario, trial.problem, len(cases) + 1)
                cases.append(trial.case._replace(scenario=scenario))
                taken.append(trial.point)
        refused = sum(trial.case is None for trial in self.known.values())
        done, history = len(self.known), tuple(self.history)
        text = self.campaign.to_yaml()
        return Found(text, self.measure, seed, self.budget, done, refused, tuple(cases), history)

    def _run(self, points: list[Array]) -> None:
        ready: list[_Ready] = []
        for point in points:
            values = values_of_row(self.campaign, self.box.row(point))
            try:
                scenario = with_values(self.campaign, values)
                ready.append((point, Case(values, {}, scenario), resolve(scenario)))
            except PassiflexError:
                self.known[_bytes(point)] = _Trial(point, IMPOSSIBLE)
        for (point, case, problem), numbers in zip(ready, _measured(ready), strict=True):
            if numbers is None:
                self.known[_bytes(point)] = _Trial(point, IMPOSSIBLE)
                continue
            value = self._objective(numbers, case.scenario)
            self.known[_bytes(point)] = _Trial(point, value, case._replace(measures=numbers), problem)
        self._tell()

    def _objective(self, numbers: dict[str, float | str], scenario: Scenario) -> float:
        if numbers["failure"]:
            return DIVERGED * (2 - float(numbers["end_time"]) / scenario.duration)
        value = float(numbers[self.measure])
        if math.isnan(value):
            return MEANINGLESS
        worst_is_low = MEASURES[self.measure].worst == "low"
        return min(max(value if worst_is_low else -value, -LARGEST), LARGEST)

    def _cases(self) -> list[_Trial]:
        """Return what has a number or diverged, the worst first; of equals, what was tried first."""
        some = [trial for trial in self.known.values() if trial.objective < MEANINGLESS]
        return sorted(some, key=lambda trial: trial.objective)

    def _tell(self) -> None:
        worst = next(iter(self._cases()), None)
        value, said = math.nan, "none that has a number"
        if worst is not None and worst.case is not None:
            value = float(worst.case.measures[self.measure])
            unit = MEASURES[self.measure].unit
            said = f"{value:.4g} {unit}" if unit != "1" else f"{value:.4g}"
            if worst.case.measures["failure"]:
                said = f"diverged at {worst.case.measures['end_time']:g} s"
        self.history.append(Best(len(self.known), value))
        self.report(f"{len(self.known)} of {self.budget} simulations; worst {self.measure}: {said}")


def _measured(ready: list[_Ready]) -> list[dict[str, float | str] | None]:
    """Return the measures of each; None where the problem cannot be run, which does not take others with it."""

    def run(which: Sequence[int]) -> list[dict[str, float | str]]:
        return evaluate_problems([ready[k][2] for k in which], [ready[k][1].scenario for k in which])

    return [found if isinstance(found, dict) else None for found in together_or_alone(run, len(ready))]


def _bytes(point: Array) -> bytes:
    return point.tobytes()
