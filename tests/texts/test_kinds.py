"""One kind of file in place of another is said as that, not as a list of wrong entries."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from passiflex.campaigns import load_campaign
from passiflex.errors import PassiflexError, RobotError, ScenarioError
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.simulation import Run, load_scenario, salvage
from passiflex.studies import shipped_scenario
from passiflex.texts.kinds import KINDS, NETCDF
from worlds import PLANAR

TEXTS = {
    "scenario": PLANAR,
    "campaign": "name: many\nscenario: given.yaml\nsamples: 4\nparameters: {}\n",
    "robot file": "name: arm\nurdf: arm.urdf\n",
}
READERS: dict[str, Callable[[Path], Any]] = {
    "scenario": load_scenario,
    "campaign": load_campaign,
    "robot file": FlexibleJointRobot.load,
}


@pytest.mark.parametrize("wanted", TEXTS)
@pytest.mark.parametrize("given", TEXTS)
def test_another_kind_is_named_with_what_to_do(wanted: str, given: str, tmp_path: Path) -> None:
    path = tmp_path / "given.yaml"
    path.write_text(TEXTS[given])
    if (
        wanted == given
    ):  # of which a campaign names itself for its scenario, and a robot file what is not there
        said = ""
        try:
            READERS[wanted](path)
        except (RobotError, ScenarioError) as error:
            said = str(error)
        assert f"not a {wanted}" not in said
        return
    with pytest.raises(PassiflexError) as refused:
        READERS[wanted](path)
    use = KINDS[given][1].format(path)
    assert f"this is a {given}, not a {wanted}; try {use}" in str(refused.value)
    assert str(refused.value).count("\n") <= 1


def test_each_kind_has_its_entry_and_no_other() -> None:
    scenario = shipped_scenario("fig1").model_dump(by_alias=True)
    assert [entry in scenario for entry, _ in KINDS.values()] == [True, False, False, False, False]


def test_a_robot_of_the_catalogue_is_no_scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        PassiflexError, match=r"this is a robot, not a scenario; try passiflex recommend iiwa14 --rate"
    ):
        load_scenario("iiwa14")
    (tmp_path / "planar2r").write_text(
        TEXTS["scenario"]
    )  # which is no path, and means the one of the catalogue
    assert FlexibleJointRobot.load("planar2r").n == 2
    (tmp_path / "mine").write_text(TEXTS["scenario"])
    with pytest.raises(PassiflexError, match=r"mine: this is a scenario, not a robot file"):
        FlexibleJointRobot.load("mine")
    with pytest.raises(PassiflexError, match=r"small: 1 mistake\n  cannot be read: No such file"):
        load_scenario("small")


@pytest.mark.parametrize("wanted", READERS)
@pytest.mark.parametrize("megabytes", [0, 2])
def test_a_run_is_named_whatever_its_size(wanted: str, megabytes: int, tmp_path: Path) -> None:
    path = tmp_path / "run.nc"
    path.write_bytes(NETCDF + b"\0" * (megabytes * 10**6))
    with pytest.raises(
        PassiflexError, match=r"this is a run, not a .*; try passiflex audit .* or passiflex show"
    ):
        READERS[wanted](path)


@pytest.mark.parametrize("given", TEXTS)
def test_what_is_no_run_is_named(given: str, tmp_path: Path) -> None:
    path = tmp_path / "given.yaml"
    path.write_text(TEXTS[given])
    with pytest.raises(PassiflexError, match=rf"this is a {given}, not a run; try passiflex"):
        Run.load(path)
    path.write_text("<robot/>")
    with pytest.raises(PassiflexError, match=r"this is a URDF, not a run; try a robot file"):
        Run.load(path)
    with pytest.raises(PassiflexError, match=r"XML in place of YAML, as of a URDF, which a robot file names"):
        load_scenario(path)


@pytest.mark.parametrize("name", ["a" * 300, "a" * 300 + ".yaml", "a" * 300 + ".nc", "x/" * 3000])
def test_a_name_that_is_too_long_is_one_of_no_file(name: str, tmp_path: Path) -> None:
    for reader in (*READERS.values(), Run.load, salvage):
        with pytest.raises(PassiflexError) as error:
            reader(tmp_path / name)  # type: ignore[operator]
        assert "\n  " in str(error.value) or "\n" not in str(error.value)
    with pytest.raises(PassiflexError):
        load_scenario(name)
    with pytest.raises(PassiflexError, match=r"unknown robot|cannot be read"):
        FlexibleJointRobot.load(name)
