"""Fig. 3 as a distribution: a thousand robots, each of them somewhere within ±50 % of what the law believes."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from passiflex.campaigns import Campaign, run_campaign
from passiflex.campaigns.evaluate import run_sample
from passiflex.campaigns.intervals import Share, share_of
from passiflex.campaigns.page import Page, ideal_along, page
from passiflex.campaigns.statistics import Statistics, numbers_of, statistics
from passiflex.chunks.run_chunks import Progress, sparsely
from passiflex.files import require_writable
from passiflex.metrics.steps import step_window
from passiflex.plotting.figures import Series, save_figure
from passiflex.plotting.uncertainty import UncertainColumn, draw_uncertainty
from passiflex.reports import write_report
from passiflex.scenarios.control_settings import Control
from passiflex.scenarios.model_errors import ModelErrors
from passiflex.simulation import Scenario
from passiflex.studies.paper import Report, shipped_scenario, with_baseline, without_noise
from passiflex.studies.sampled import VARIANTS

SAMPLES = 1000
SPREAD = 0.5
ROBOTS: dict[str, dict[str, Any]] = {
    f"deviations.{quantity}": {"distribution": "uniform", "low": -SPREAD, "high": SPREAD, "per": "joint"}
    for quantity in ("joint_stiffness", "joint_damping", "motor_inertia", "link_inertia")
}
"""Each joint and each link deviates by itself."""
WORKSPACE: dict[str, dict[str, Any]] = {
    f"posture.{joint}": {"distribution": "uniform", "low": f"{low} deg", "high": f"{high} deg"}
    for joint, (low, high) in enumerate(
        ((-150, 150), (10, 70), (-60, 60), (-110, -30), (-150, 150), (20, 100), (-150, 150)), start=1
    )
}
"""Postures with a bent elbow and a bent wrist, away from the singular ones, in which no step can be followed."""
KEPT = (
    "margin", "overdraft", "integration_error", "fell_back_at", "torque_share", "joint_limit_margin", "overshoot",
    "settling_time", "rms_to_msd", "tracking_rms",
)  # fmt: skip
RESPONSE = 0.05
"""Interval at which the response is kept [s]."""


IDEAL_RATE = 4000.0
"""Rate at which the baseline, whose gains are low, is as good as continuous, and a tenth of the work [Hz]."""
LEVEL = 0.95
"""Of the intervals."""
CONDITIONS = (
    "Fig. 3's step of 0.1 m, {samples} robots each: K, D and B of each joint and the inertia of each link uniform "
    "within ±50 % of the description, which the law goes by\n"
    "1 kHz: each command one period late, q to 0.01°, θ to 0.0001°, velocities from differences (200 Hz), noise "
    "0.2 (N m)² on τ_a, torque limits, port tank with fallback; continuous: no noise\n"
    "bands: 25 to 75 % and 5 to 95 %; workspace: random postures with bent elbow and wrist"
)


class Way(NamedTuple):
    """One way of controlling a thousand robots.

    Attributes
    ----------
    title: Above its column.
    scenario: Of which the robots are varied.
    everywhere: Whether the posture is varied too.
    """

    title: str
    scenario: Callable[[], Scenario]
    everywhere: bool = False


def _continuous() -> Scenario:
    """Return Fig. 3 with a law that believes the description; noise is for laws that sample."""
    scenario = without_noise(shipped_scenario("fig3"))
    return scenario.model_copy(update={"model_errors": ModelErrors()})


def _continuous_baseline() -> Scenario:
    scenario = with_baseline(_continuous(), motor_aware=False)
    return scenario.model_copy(update={"control": Control(rate=IDEAL_RATE)})


def _sampled(scenario: Scenario, **parts: Any) -> Scenario:
    return scenario.model_copy(update={"output_interval": 0.005, **parts})


def _paper_at_1_khz() -> Scenario:
    return _sampled(VARIANTS["paper_port"].change(shipped_scenario("fig1_sampled")))


def _baseline_at_1_khz() -> Scenario:
    measured = {"control.inner_loop": "plain", "control.external_torque": "measured"}
    plain = shipped_scenario("fig1_sampled").changed(measured)
    return _sampled(with_baseline(plain, motor_aware=False))


def _recommended() -> Scenario:
    return _sampled(shipped_scenario("fig1_sampled"))


WAYS: dict[str, Way] = {
    "continuous": Way("paper's gains,\ncontinuous", _continuous),
    "continuous_baseline": Way("rigid baseline,\nideal sensors, 4 kHz", _continuous_baseline),
    "sampled": Way("paper's gains,\n1 kHz", _paper_at_1_khz),
    "sampled_baseline": Way("rigid baseline,\n1 kHz", _baseline_at_1_khz),
    "recommended": Way("recommended gains,\n1 kHz", _recommended),
    "continuous_workspace": Way("paper's gains,\ncontinuous, workspace", _continuous, everywhere=True),
    "recommended_workspace": Way("recommended gains,\n1 kHz, workspace", _recommended, everywhere=True),
}
SHOWN = "recommended"
"""Of this way, a page shows the worst sample."""


def uncertainty_campaign(way: str, samples: int = SAMPLES) -> Campaign:
    """Return the campaign of one of `WAYS`."""
    chosen = WAYS[way]
    return Campaign.model_validate(
        {
            "name": f"uncertainty_{way}",
            "description": chosen.title.replace("\n", " "),
            "scenario": json.loads(chosen.scenario().model_dump_json(by_alias=True, exclude_none=True)),
            "samples": samples,
            "parameters": ROBOTS | (WORKSPACE if chosen.everywhere else {}),
            "keep": {"metrics": KEPT, "response": RESPONSE},
        }
    )


def reproduce_uncertainty(
    folder: Path, report: Report = lambda text: None, samples: int = SAMPLES, workers: int | None = None
) -> tuple[list[Path], dict[str, Any]]:
    """Run the study into `folder`; return the paths, and the part of the summary. Interrupted, it goes on."""
    require_writable(folder)
    written: list[Path] = []
    summary: dict[str, Any] = {}
    columns = []
    for name in WAYS:
        campaign = uncertainty_campaign(name, samples)
        done = folder / campaign.name

        def show(progress: Progress, title: str = campaign.description) -> None:
            left = f"{progress.done} of {progress.total}, {progress.remaining:.0f} s left"
            report(f"uncertainty, {title}: {left}")

        results = run_campaign(campaign, done, workers=workers, on_progress=sparsely(show))
        rows = results.rows()
        found = statistics(campaign, rows, level=LEVEL)
        summary[campaign.name] = _numbers(found)
        summary[campaign.name]["at_torque_limit"] = at_limit = _at_torque_limit(rows)
        columns.append(_column(campaign, page(campaign, rows, found), Share(**at_limit)))
        written += sorted(done.glob("*.parquet"))
        if name == SHOWN and found.worst:
            worst = run_sample(campaign, found.worst[0].sample)
            written.append(write_report(worst, folder / "uncertainty.html"))
    report("uncertainty: drawing")
    drawing = draw_uncertainty(columns, CONDITIONS.format(samples=samples))
    return [*save_figure(drawing, folder / "uncertainty"), *written], summary


def _numbers(found: Statistics) -> dict[str, Any]:
    """Return shares with their intervals, and the quantiles of what was kept."""
    data = found.to_dict()
    return {name: data[name] for name in ("samples", "refused", "level", "shares", "spreads")}


def _at_torque_limit(rows: pa.Table) -> dict[str, Any]:
    """Return the share of robots that ask a motor for its limit or more: those that tremble do."""
    asked = numbers_of(rows, "torque_share")
    ran = asked[~np.isnan(asked)]
    return share_of("at_torque_limit", int((ran >= 1).sum()), ran.size, LEVEL)._asdict()


def _column(campaign: Campaign, drawn: Page, at_limit: Share) -> UncertainColumn:
    window = step_window(campaign.scenario)
    ideal = ideal_along(campaign)
    assert window is not None
    assert ideal is not None
    by_metric = {ecdf.metric: ecdf for ecdf in drawn.distributions}
    return UncertainColumn(
        title=campaign.description,
        begin=window.begin,
        end=window.end,
        shares=(*(s for s in drawn.shares if s.name in ("passive", "settled", "fell_back")), at_limit),
        band=drawn.band,
        ideal=Series(*ideal),
        overshoot=by_metric["overshoot"],
        margin=by_metric["margin"],
    )
