"""What is left of a damaged run is shown, and nothing that is not there is made up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from passiflex.passivity import audit
from passiflex.reports.header import NO_ARM, NO_VERDICT
from passiflex.simulation import Run, salvage
from reports.pages import PLANAR, changed, continuous, page, sampled, with_nan

DAMAGE = {
    "one row": lambda: Run(sampled().data.isel(time=[0])),
    "short": lambda: Run(continuous().data.isel(time=slice(0, 7))),
    "failed": lambda: changed(Run(continuous().data.isel(time=slice(0, 30))), failure="it left the numbers"),
    "no energies": lambda: changed(continuous(), without=("link_kinetic_energy", "joint_energy")),
    "no motion": lambda: changed(
        continuous(), without=("q", "theta", "position", "desired_position", "wrench")
    ),
    "no torques": lambda: changed(continuous(), without=("tau_m", "torque_limit")),
    "all NaN": lambda: with_nan(continuous(), "position", slice(None)),
    "NaN at the start": lambda: with_nan(sampled(), "tank_energy", slice(0, 5)),
    "no configuration": lambda: changed(sampled(), scenario=""),
    "no arm": lambda: changed(
        continuous(), robot_description="<robot/>", scenario=PLANAR.replace("planar2r", "nobody")
    ),
    "infinite": lambda: Run(continuous().data.assign(tau_m=continuous().data["tau_m"] * np.inf)),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_what_is_left_of_a_run_is_shown(damage: str) -> None:
    read = page(DAMAGE[damage](), (), ("a notice",))
    assert read.header["notices"][0] == "a notice"
    assert read.header["panels"]
    for panel in read.header["panels"]:
        for curve in panel["curves"]:
            times = read.array(read.header["times"][curve["time"]])
            assert read.array(curve["values"]).shape == times.shape
    count = read.array(read.header["frames"]["time"]).size
    for name in ("q", "theta", "position"):
        assert read.array(read.header["frames"][name]).shape[0] == count


@pytest.mark.parametrize("damage", ["no energies", "NaN at the start"])
def test_without_energies_there_is_no_verdict(damage: str) -> None:
    header = page(DAMAGE[damage]()).header
    assert header["verdict"] is None
    assert NO_VERDICT in header["notices"]


@pytest.mark.parametrize("damage", ["no motion", "no arm"])
def test_without_kinematics_there_is_no_arm(damage: str) -> None:
    header = page(DAMAGE[damage]()).header
    assert header["arm"] is None
    assert NO_ARM in header["notices"]


def test_a_damaged_file_is_shown_as_far_as_it_can_be_read(tmp_path: Path) -> None:
    cut = Run(sampled().data.isel(time=slice(0, 300)))
    read = salvage(with_nan(cut, "tau_m", slice(20, 30)).save(tmp_path / "run.nc"))
    shown = page(read.run, (), read.notices)
    assert shown.header["notices"] == list(read.notices)
    assert len(read.notices) == 2
    _, torque = shown.curve("torque", "joint 1", "motor")
    assert np.isnan(torque[20:30]).all()
    assert np.isfinite(torque[30:]).all()


def test_a_run_of_before_has_the_arm_of_the_catalogue() -> None:
    data = continuous().data.copy()
    del data.attrs["robot_description"]
    assert page(Run(data)).header["arm"] == page(continuous()).header["arm"]
    lost = Run(data.assign_attrs(scenario=data.attrs["scenario"].replace("planar2r", "nobody")))
    header = page(lost).header
    assert header["arm"] is None
    assert header["verdict"]["verdict"] == audit(lost).verdict
    names = [row["name"] for row in header["metrics"]["rows"]]
    assert "margin" in names  # of the audit, which needs no robot
    assert "torque share" not in names
