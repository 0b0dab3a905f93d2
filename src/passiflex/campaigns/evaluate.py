"""From samples to rows: draw, resolve, run side by side, measure. And one sample again, in full."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.campaigns.campaign import Campaign
from passiflex.campaigns.campaign_file import parse_campaign
from passiflex.campaigns.draws import columns, draws, words
from passiflex.campaigns.same_robot import require_same_robot
from passiflex.campaigns.samples import sample_scenario
from passiflex.chunks.engines import usable_cores
from passiflex.chunks.manifest import load_manifest
from passiflex.chunks.source import source_digest
from passiflex.errors import (
    PassiflexError,
    PassiflexWarning,
    SimulationError,
    ValueRangeError,
)
from passiflex.files import as_path
from passiflex.metrics.contact import contact_signals
from passiflex.metrics.measures import MEASURES, OF_CONTACT, SIGNALS, measures
from passiflex.metrics.steps import displacement, step_window
from passiflex.passivity.ledger import Signals
from passiflex.problems.problem import Problem, SampledProblem
from passiflex.scenarios.surface_settings import AbstractSurface
from passiflex.simulation import Run, Scenario, resolve, simulate_problem
from passiflex.simulation.batch import digest_batch, simulate_in_lane

REFUSED = "refused"
"""Verdict of a sample that is no possible robot or scenario: it was not run, and `failure` says why."""
RESPONSE = "displacement_"
"""Columns of the response begin so."""
TEXTS = ("verdict", "decided_by", "failure")
CANNOT_RUN = (SimulationError, ValueRangeError)
"""What is raised for a problem that cannot be integrated, as one with a pole beyond all bounds."""
Digest = Callable[[int, Signals], dict[str, Any]]
"""What is made of the number and the signals of a problem."""


def evaluate_samples(text: str, samples: Sequence[int]) -> list[dict[str, Any]]:
    """Return a row for each sample of the campaign of this text; nothing else has a part in it.

    A row has the draws, verdict, measures, and what is kept of the response.

    Raises
    ------
    PassiflexError
        If the robot cannot be read, or is another than the text is marked with: that is no refused sample.
    """
    campaign = _campaign(text)
    require_same_robot(campaign, text)
    names = columns(campaign)
    drawn = draws(campaign, samples)
    known = words(campaign)
    rows: dict[int, dict[str, Any]] = {}
    ready: list[tuple[int, Scenario, Problem]] = []
    for i, values in zip(samples, drawn, strict=True):
        said = {n: known[n][int(v)] if n in known else float(v) for n, v in zip(names, values, strict=True)}
        rows[i] = {"sample": i, **said}
        try:
            scenario = sample_scenario(campaign, i)
            ready.append((i, scenario, resolve(scenario)))
        except PassiflexError as error:
            rows[i] |= _refused(campaign, str(error))
    kept = (*TEXTS, *kept_measures(campaign))

    def row(k: int, run: Signals) -> dict[str, Any]:
        _, scenario, problem = ready[k]
        measured = measures(problem, step_window(scenario), run)
        return {name: measured.get(name, math.nan) for name in kept} | _kept_response(campaign, run)

    def measured(which: Sequence[int]) -> list[dict[str, Any]]:
        return _digested([ready[k][2] for k in which], lambda k, run: row(which[k], run))

    for (i, *_), found in zip(ready, together_or_alone(measured, len(ready)), strict=True):
        rows[i] |= found if isinstance(found, dict) else _refused(campaign, str(found))
    return [rows[i] for i in samples]


def evaluate_problems(problems: Sequence[Problem], scenarios: Sequence[Scenario]) -> list[dict[str, Any]]:
    """Return the measures of problems, run side by side."""
    return _digested(
        problems, lambda k, run: measures(problems[k], step_window(scenarios[k]), run), threads=usable_cores()
    )


def together_or_alone(
    run: Callable[[Sequence[int]], list[dict[str, Any]]], count: int
) -> list[dict[str, Any] | PassiflexError]:
    """Return what `run` makes of the numbers below `count`; of one that cannot be run, why.

    They are run together, and each alone if one of them cannot be: it does not take the others with it.
    """
    try:
        return list(run(range(count)))
    except CANNOT_RUN as error:
        return [error] if count == 1 else [_one(run, k) for k in range(count)]


def _one(run: Callable[[Sequence[int]], list[dict[str, Any]]], k: int) -> dict[str, Any] | PassiflexError:
    return together_or_alone(lambda _: run([k]), 1)[0]


def kept_measures(campaign: Campaign) -> tuple[str, ...]:
    """Return the names of the measures that a campaign keeps; those of contact unasked where there are surfaces."""
    surfaces = any(isinstance(entry, AbstractSurface) for entry in campaign.scenario.environment)
    return campaign.keep.metrics or tuple(name for name in MEASURES if surfaces or name not in OF_CONTACT)


def require_response(campaign: Campaign) -> None:
    """Raise ValueRangeError unless the interval of the response fits the rows, which all samples have alike."""
    interval, step = campaign.keep.response, campaign.scenario.output_interval
    varied = sorted({"duration", "output_interval"} & set(campaign.parameters))
    if interval is not None and varied:
        raise ValueRangeError(
            "keep.response",
            got=f"{' and '.join(varied)} among the parameters",
            needs="rows at the same instants in all samples",
        )
    if interval is not None and abs(interval / step - round(interval / step)) > 1e-9 * interval / step:
        raise ValueRangeError(
            "keep.response", got=f"{interval:g} s", needs=f"a whole multiple of output_interval, {step:g} s"
        )


def replay(folder: str | Path, sample: int) -> Run:
    """Return the full run of one sample of a campaign's folder, with the numbers of its row.

    Raises
    ------
    FolderError, ValueRangeError, OtherRobotError
        If the folder holds no campaign, or it has no such sample, or its robot has changed.
    """
    manifest = load_manifest(as_path(folder, "the folder of a campaign"))
    if manifest.source != source_digest():
        warnings.warn(
            f"the rows in {folder} are from version {manifest.version}, commit {manifest.commit}, and not from "
            "this source: the run may have other numbers",
            PassiflexWarning,
            stacklevel=2,
        )
    campaign = _campaign(manifest.campaign)
    require_same_robot(campaign, manifest.campaign)
    return run_sample(campaign, sample)


def run_sample(campaign: Campaign, sample: int) -> Run:
    """Return the full run of one sample."""
    problem = resolve(sample_scenario(campaign, sample))
    return simulate_in_lane(problem) if isinstance(problem, SampledProblem) else simulate_problem(problem)


def _digested(problems: Sequence[Problem], digest: Digest, *, threads: int = 1) -> list[dict[str, Any]]:
    """Return what `digest` makes of the number and the signals of each problem, side by side where they are sampled."""
    sampled = [k for k, p in enumerate(problems) if isinstance(p, SampledProblem)]
    done = dict(
        zip(
            sampled,
            digest_batch(
                [problems[k] for k in sampled],
                (*SIGNALS, *(contact_signals(problems[sampled[0]]) if sampled else ())),
                lambda k, run: digest(sampled[k], run),
                threads=threads,
            ),
            strict=True,
        )
    )
    return [done[k] if k in done else digest(k, simulate_problem(p)) for k, p in enumerate(problems)]


def _refused(campaign: Campaign, why: str) -> dict[str, Any]:
    numbers = dict.fromkeys(kept_measures(campaign), math.nan)
    texts = {"verdict": REFUSED, "decided_by": "", "failure": why}
    return texts | numbers | {name: _padded(campaign, np.zeros(0)) for name in _response_names(campaign)}


def _kept_response(campaign: Campaign, run: Signals) -> dict[str, list[float]]:
    names = _response_names(campaign)
    if not names or campaign.keep.response is None:
        return {}
    every = round(campaign.keep.response / campaign.scenario.output_interval)
    moved = displacement(run["position"])[::every]
    return {name: _padded(campaign, moved[:, i]) for i, name in enumerate(names)}


def _response_names(campaign: Campaign) -> tuple[str, ...]:
    return tuple(f"{RESPONSE}{a}" for a in "xyz") if campaign.keep.response else ()


def _padded(campaign: Campaign, values: NDArray[np.float64]) -> list[float]:
    """Return the values of a run that may have ended early, at all instants of a whole one."""
    assert campaign.keep.response is not None
    count = int(campaign.scenario.duration / campaign.keep.response + 1e-9) + 1
    out = np.full(count, np.nan)
    out[: min(count, values.size)] = values[:count]
    return out.tolist()


@lru_cache(maxsize=8)
def _campaign(text: str) -> Campaign:
    return parse_campaign(text, source="campaign")
