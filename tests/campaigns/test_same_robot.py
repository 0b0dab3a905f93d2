"""A robot file that changes, or goes away, never makes rows of two robots."""

from __future__ import annotations

import importlib
import shutil
from pathlib import Path

import pytest

from campaigns.small_campaigns import SAMPLED, STIFFNESS, campaign, uniform
from passiflex.campaigns import Campaign, replay, run_campaign
from passiflex.campaigns.evaluate import evaluate_samples
from passiflex.campaigns.same_robot import OtherRobotError, marked, require_same_robot, robot_digest
from passiflex.chunks.manifest import FolderError
from passiflex.chunks.run_chunks import ChunkError
from passiflex.errors import PassiflexError
from worlds import merged

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


@pytest.fixture
def of_a_file(tmp_path: Path) -> Campaign:
    """Return a campaign of two samples whose robot is a file of its own."""
    for name in ("arm3.yaml", "arm3.urdf"):
        shutil.copy(EXAMPLES / name, tmp_path)
    own = {
        "robot": str(tmp_path / "arm3.yaml"),
        "posture": [0, 0.7, -1.4],
        "control": {"allow_unstable": True},
    }
    scenario = merged(SAMPLED, own)
    return campaign(scenario, samples=2, parameters={STIFFNESS: uniform(-0.1, 0.1)})


def heavier(folder: Path) -> None:
    """Change the robot's numbers."""
    urdf = folder / "arm3.urdf"
    text = urdf.read_text()
    assert 'mass value="' in text
    urdf.write_text(text.replace('mass value="', 'mass value="1', 1))


def test_a_digest_is_of_the_numbers(of_a_file: Campaign, tmp_path: Path) -> None:
    before = robot_digest(of_a_file)
    assert robot_digest(of_a_file) == before
    require_same_robot(of_a_file, marked(of_a_file.to_yaml(), before))
    require_same_robot(of_a_file, of_a_file.to_yaml())  # a text without a mark is of any robot
    heavier(tmp_path)
    assert robot_digest(of_a_file) != before
    with pytest.raises(OtherRobotError, match="is not what it was when the campaign began"):
        require_same_robot(of_a_file, marked(of_a_file.to_yaml(), before))


def test_a_robot_that_cannot_be_read_is_no_refused_sample(of_a_file: Campaign, tmp_path: Path) -> None:
    text = marked(of_a_file.to_yaml(), robot_digest(of_a_file))
    assert "refused" not in [row["verdict"] for row in evaluate_samples(text, [0, 1])]
    (tmp_path / "arm3.yaml").unlink()
    with pytest.raises(PassiflexError, match=r"arm3\.yaml"):
        evaluate_samples(text, [0, 1])


def test_a_campaign_whose_robot_changed_neither_goes_on_nor_is_replayed(
    of_a_file: Campaign, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    run_campaign(of_a_file, out, workers=0)
    assert replay(out, 0).failure == ""
    heavier(tmp_path)
    with pytest.raises(OtherRobotError, match="is not what it was"):
        replay(out, 0)
    with pytest.raises(FolderError, match="robot: "):
        run_campaign(of_a_file, out, workers=0, samples=4)


def test_a_robot_that_changes_in_flight_ends_the_campaign(
    of_a_file: Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def changing(text: str, samples: range) -> list[dict[str, object]]:
        heavier(tmp_path)
        return evaluate_samples(text, samples)

    module = importlib.import_module(
        "passiflex.campaigns.run_campaign"
    )  # the name is that of its function, too
    monkeypatch.setattr(module, "evaluate_samples", changing)
    with pytest.raises(ChunkError, match="is not what it was"):
        run_campaign(of_a_file, tmp_path / "out", workers=0)
