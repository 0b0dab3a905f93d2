"""The study of unknown walls: its campaign, and what its page says of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from passiflex.campaigns import load_campaign, run_campaign
from passiflex.campaigns.statistics import numbers_of
from passiflex.studies.walls import FAR, KEPT, NEAR, PEAK, PLACE, STIFFNESS, campaign, told

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "wall_campaign.yaml"


def test_the_example_of_the_pages_is_the_campaign_of_the_study() -> None:
    ours, its = campaign(), load_campaign(EXAMPLE)
    assert (its.name, its.samples, its.seed, its.sampling) == (
        ours.name,
        ours.samples,
        ours.seed,
        ours.sampling,
    )
    assert its.parameters == ours.parameters
    spoken = {"name", "description"}
    assert its.scenario.model_dump(exclude=spoken) == ours.scenario.model_dump(exclude=spoken)


def test_shares_and_quantiles_are_those_of_the_walls() -> None:
    found = told(np.array([True, True, False, True]), np.array([100.0, 150.0, 200.0, 300.0]))
    assert (found.passive.count, found.passive.of) == (3, 4)
    assert [share.count for share in found.below] == [1, 3]
    assert found.median.value == pytest.approx(175)


@pytest.mark.slow
def test_what_the_page_says_of_walls(tmp_path: Path) -> None:
    rows = run_campaign(campaign(), tmp_path / "walls", workers=0).narrow_rows()
    stiffness, place, peak = (numbers_of(rows, name) for name in (STIFFNESS, PLACE, PEAK))
    assert set(KEPT) <= set(rows.column_names)
    assert ((place >= FAR) & (place <= NEAR)).all()
    assert set(rows["verdict"].to_pylist()) == {"passive"}
    assert peak[stiffness < 1e4].max() < 140
    assert peak[stiffness > 1e5].min() > 140
    middle = peak[(stiffness > 1e4) & (stiffness < 1e5)]
    assert 0.35 < (middle < 140).mean() < 0.56
    assert (middle < 280).mean() > 0.92
    assert 0.04 < (peak[stiffness > 1e5] < 280).mean() < 0.15
    assert np.corrcoef(np.log(stiffness), np.log(peak))[0, 1] > 0.9
