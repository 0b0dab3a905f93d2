"""What a search found: the worst cases, each as a scenario that runs alone."""

from __future__ import annotations

import json
import math
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from passiflex.campaigns.samples import Values
from passiflex.errors import UnstableLoopError
from passiflex.files import OutputError, read_json, read_regular, require_writable, whole_file
from passiflex.metrics.measures import MEASURES
from passiflex.origin import package_version, source_commit
from passiflex.problems.problem import Problem, SampledProblem
from passiflex.scenarios.scenario import Scenario
from passiflex.stability.admissible import require_stable

NAME = "search.json"
MOST_BYTES = 100_000_000


class Case(NamedTuple):
    """A point that was simulated.

    Attributes
    ----------
    values: What each parameter is.
    measures: Verdict, failure and numbers of the run, as `measures.measures` gives them.
    scenario: Complete; `control.allow_unstable` is true where its loop is unstable.
    """

    values: Values
    measures: dict[str, float | str]
    scenario: Scenario


class Best(NamedTuple):
    """The measure of the worst case after so many simulations; NaN if there was none."""

    evaluations: int
    value: float


@dataclass(frozen=True)
class Found:
    """The worst cases of a search, the worst first.

    Attributes
    ----------
    campaign: Text of the campaign whose parameters were searched.
    measure: What was searched by; its bad end is that of `MEASURES`.
    seed: Of the search.
    budget, evaluations: Simulations that were allowed and done; fewer if no further point was left.
    refused: Points among them that were no possible robot or scenario.
    cases: Distinct in at least one parameter, by a share of its support.
    history: The worst after each batch of simulations.
    """

    campaign: str
    measure: str
    seed: int
    budget: int
    evaluations: int
    refused: int
    cases: tuple[Case, ...]
    history: tuple[Best, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; a number that is not finite becomes None."""
        return {
            "measure": self.measure,
            "worst": MEASURES[self.measure].worst,
            "seed": self.seed,
            "budget": self.budget,
            "evaluations": self.evaluations,
            "refused": self.refused,
            "cases": [
                {
                    "scenario": _file(i),
                    "values": {k: list(v) if isinstance(v, tuple) else v for k, v in case.values.items()},
                    "measures": {k: _finite(v) for k, v in case.measures.items()},
                }
                for i, case in enumerate(self.cases)
            ],
            "history": [[b.evaluations, _finite(b.value)] for b in self.history],
            "version": package_version(),
            "commit": source_commit(),
            "campaign": self.campaign,
        }

    def save(self, folder: str | Path) -> list[Path]:
        """Write worst_1.yaml … and search.json, and return the paths; those that an earlier search names there go.

        Raises
        ------
        OutputError
            If they cannot be written, or somebody else's file has such a name.
        """
        before = require_place(folder, len(self.cases))
        record = json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        texts = {NAME: record}  # first: what follows is known to be ours, also if this process is killed
        texts |= {_file(i): case.scenario.to_yaml() for i, case in enumerate(self.cases)}
        paths = [Path(folder) / name for name in texts]
        for path, text in zip(paths, texts.values(), strict=True):
            with whole_file(path) as temporary:
                temporary.write_text(text, encoding="utf-8")
        for other in {Path(folder) / name for name in before} - set(paths):
            other.unlink(missing_ok=True)
        return [*paths[1:], paths[0]]


def require_place(folder: str | Path, cases: int) -> set[str]:
    """Raise OutputError unless a search can be kept in a folder; return what an earlier one has there, by name."""
    folder = Path(folder)
    require_writable(folder)
    before = _files_of_before(folder / NAME)
    for name in {NAME, *map(_file, range(cases))} - before:
        if os.path.lexists(folder / name):
            what = f"{folder / name} is none that a search wrote"
            raise OutputError(what, try_="another folder, or move it away")
    return before


def _files_of_before(path: Path) -> set[str]:
    """Return the names of a record and of the scenarios that it lists; none if it cannot be read, or is no record."""
    try:
        cases = read_json(read_regular(path, MOST_BYTES).decode("utf-8"))["cases"]
        names = {str(case["scenario"]) for case in cases}
    except (OSError, ValueError, LookupError, TypeError):
        return set()
    return {path.name, *(name for name in names if re.fullmatch(r"worst_\d+\.yaml", name))}


def case_scenario(scenario: Scenario, problem: Problem, rank: int) -> Scenario:
    """Return the scenario of a case as it is kept: it runs anywhere, also if its loop is unstable."""
    changes: dict[str, Any] = {"name": f"{scenario.name[:90]}_worst_{rank}"}
    robot = Path(scenario.robot)
    if robot.suffix in (".yaml", ".yml"):  # a file is looked for beside the scenario's
        changes["robot"] = str(robot.resolve())
    if scenario.control is not None and isinstance(problem, SampledProblem):
        try:
            require_stable(problem)
        except UnstableLoopError:
            changes["control"] = scenario.control.model_copy(update={"allow_unstable": True})
    return scenario.model_copy(update=changes)


def _file(index: int) -> str:
    return f"worst_{index + 1}.yaml"


def _finite(value: float | str) -> float | str | None:
    return None if isinstance(value, float) and not math.isfinite(value) else value
