"""The uncertainty study: which robots are drawn, what is asked of whom, and what comes out for a few of them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from passiflex.campaigns import columns, draws, require_possible, sample_scenario
from passiflex.control.law import ImpedanceLaw
from passiflex.control.posture import posture
from passiflex.control.rigid import RigidImpedanceLaw
from passiflex.limits.workspace import REGULAR
from passiflex.problems.problem import SampledProblem
from passiflex.simulation import resolve
from passiflex.studies.reproduce import reproduce
from passiflex.studies.uncertainty import (
    RESPONSE,
    SAMPLES,
    SPREAD,
    WAYS,
    WORKSPACE,
    reproduce_uncertainty,
    uncertainty_campaign,
)

QUANTITIES = ("joint_stiffness", "joint_damping", "motor_inertia", "link_inertia")


@pytest.mark.parametrize("way", WAYS)
def test_every_way_has_its_campaign(way: str) -> None:
    campaign = uncertainty_campaign(way)
    assert campaign.samples == SAMPLES == 1000
    assert campaign.keep.response == RESPONSE
    assert len(columns(campaign)) == 7 * len(QUANTITIES) + WAYS[way].everywhere * 7
    require_possible(campaign)


def test_the_robots_are_the_same_for_all_ways() -> None:
    """Law against law on the same thousand robots; over the workspace they stand elsewhere too."""
    robots = draws(uncertainty_campaign("continuous"), range(200))
    assert robots.shape == (200, 28)
    assert np.abs(robots).max() <= SPREAD
    assert robots.mean() == pytest.approx(0, abs=3 * SPREAD / np.sqrt(3 * robots.size))
    assert robots.std() == pytest.approx(SPREAD / np.sqrt(3), rel=0.05)
    for way in WAYS:
        drawn = draws(uncertainty_campaign(way), range(200))
        np.testing.assert_array_equal(drawn[:, :28], robots)


def test_what_is_believed_and_what_is_true() -> None:
    """The law of every way goes by the description; only the robot differs."""
    for way in ("continuous", "sampled", "sampled_baseline", "recommended"):
        problem = resolve(sample_scenario(uncertainty_campaign(way), 3))
        robot, law = problem.law.robot, problem.law
        model, plant = robot.layout.unpack(problem.model), robot.layout.unpack(problem.plant)
        np.testing.assert_array_equal(model["joint_stiffness"], robot.joint_stiffness)
        ratio = plant["joint_stiffness"] / model["joint_stiffness"] - 1
        assert 0 < np.abs(ratio).max() <= SPREAD
        assert isinstance(law, RigidImpedanceLaw if way == "sampled_baseline" else ImpedanceLaw)
        assert (not isinstance(problem, SampledProblem)) == (way == "continuous")


def test_the_workspace_is_away_from_singular_postures() -> None:
    """The ratio of the singular values of J, lengths in units of the reach, is half of what `limits` calls regular."""
    campaign = uncertainty_campaign("recommended_workspace")
    drawn = draws(campaign, range(300))
    where = [columns(campaign).index(f"posture.{joint}") for joint in range(1, 8)]
    problem = resolve(sample_scenario(campaign, 7))
    np.testing.assert_array_equal(problem.q, drawn[7, where])
    robot = problem.law.robot
    jacobians = [posture(robot, q, robot.nominal()).jacobian for q in drawn[:, where]]
    reach = max(np.linalg.norm(J[:3], axis=0).max() for J in jacobians)
    units = np.array([1 / reach] * 3 + [1.0] * 3)[:, None]
    values = np.array([np.linalg.svd(units * J, compute_uv=False) for J in jacobians])
    assert (values[:, -1] / values[:, 0]).min() > REGULAR / 2
    assert len(WORKSPACE) == robot.n


@pytest.mark.slow
def test_a_few_robots_of_each_way(tmp_path: Path) -> None:
    """What the study shows with a thousand holds for any sixteen but for the width of the intervals."""
    paths, summary = reproduce_uncertainty(tmp_path, samples=16)
    assert all(path.is_file() for path in paths)
    share = {way: {s["name"]: s["share"] for s in summary[f"uncertainty_{way}"]["shares"]} for way in WAYS}
    spread = {
        way: {s["metric"]: s["quantiles"][2]["value"] for s in summary[f"uncertainty_{way}"]["spreads"]}
        for way in WAYS
    }
    for way in ("continuous", "recommended", "continuous_workspace", "recommended_workspace"):
        assert share[way]["passive"] == 1
    assert share["sampled"]["passive"] < 0.5
    assert share["sampled"]["fell_back"] == 1
    assert share["recommended"]["fell_back"] == 0
    assert spread["continuous"]["rms_to_msd"] < spread["recommended"]["rms_to_msd"]
    assert spread["recommended"]["rms_to_msd"] < spread["sampled_baseline"]["rms_to_msd"]
    assert (
        summary["uncertainty_continuous"]["at_torque_limit"]["share"] == 1
    )  # it asks 15 times of what there is
    assert summary["uncertainty_recommended"]["at_torque_limit"]["share"] < 0.5
    json.dumps(summary, allow_nan=False)
    again = [path.stat().st_mtime_ns for path in paths if path.suffix == ".parquet"]
    repeated, _ = reproduce_uncertainty(tmp_path, samples=16)
    assert [p.stat().st_mtime_ns for p in repeated if p.suffix == ".parquet"] == again


def test_the_study_is_one_of_those_that_are_reproduced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    called = []

    def study(folder: Path, report: object) -> tuple[list[Path], dict[str, object]]:
        called.append(folder)
        return [], {"uncertainty_x": {"samples": 1}}

    monkeypatch.setitem(
        __import__("passiflex.studies.reproduce", fromlist=["STUDIES"]).STUDIES, "uncertainty", study
    )
    reproduce(["uncertainty"], tmp_path)
    assert called == [tmp_path]
    assert json.loads((tmp_path / "summary.json").read_text())["uncertainty_x"] == {"samples": 1}
