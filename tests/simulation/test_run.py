"""A run: signals that say what they are, a file that is whole, and everything needed to make it again."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi as cs
import h5py
import numpy as np
import pytest
import xarray as xr
import yaml

from passiflex.errors import FrozenError, RunFileError, SimulationError
from passiflex.files import OutputError
from passiflex.origin import package_version, source_commit
from passiflex.passivity import audit
from passiflex.robots.arm import SerialArm
from passiflex.robots.chain import SerialChain
from passiflex.runs.run_file import FORMAT
from passiflex.simulation import Run, Scenario, parse_scenario, salvage, simulate
from worlds import planar_text

PLANAR = planar_text(reference=[{"at": 0.2, "kind": "step", "by": [0, 0, 0.05]}], duration=1)

DIVERGING = """\
name: diverging
robot: iiwa14
posture: [0, 0.6, 0, -1.2, 0, 1, 0]
law:
  type: rigid
  task: position
  gravity: robot
  stiffness: {translation: 1e4}
  damping: {translation: 200}
  target_inertia: {translation: 0.1}
  motor_inertia: carried
reference: [{at: 0.2, kind: step, by: [0, 0, 0.05]}]
model_errors: {link_inertia: 500}
duration: 1
output_interval: 0.01
"""
"""A law that believes in links 501 times as heavy as they are: its motors push them out of the finite numbers."""

NOISE = {"torque_variance": 0.1, "hold": 0.01}


def planar(**changes: Any) -> Scenario:
    return parse_scenario(yaml.safe_dump(yaml.safe_load(PLANAR) | changes))


@lru_cache
def planar_run() -> Run:
    return simulate(planar())


@lru_cache
def diverged() -> Run:
    return simulate(parse_scenario(DIVERGING))


def test_every_signal_has_its_unit_and_its_meaning() -> None:
    for name, signal in {**planar_run().data.data_vars, "time": planar_run().data["time"]}.items():
        assert signal.attrs["units"], name
        assert signal.attrs["long_name"], name


def test_units_are_those_of_the_names() -> None:
    """Energies in J, powers in W; and each power is the rate of the energy of its name."""
    data = planar_run().data
    for name in map(str, data.data_vars):
        if name.endswith(("_energy", "_power")):
            assert data[name].attrs["units"] == ("J" if name.endswith("_energy") else "W")
    powers = [str(name) for name in data if str(name).endswith("_power")]
    assert len(powers) == 10
    after = data["time"].to_numpy() >= 0.2
    for name in powers:
        energy = data[name.replace("_power", "_energy")].to_numpy()[after]
        integral = np.trapezoid(data[name].to_numpy()[after], data["time"].to_numpy()[after])
        # The trapezoidal rule misses h²/12 · ∫|P″|; with P of the arm's slowest mode, 5 % is generous.
        assert integral == pytest.approx(energy[-1] - energy[0], rel=0.05, abs=1e-3), name


def test_axes_are_named() -> None:
    data = planar_run().data
    assert data["position"].dims == ("time", "axis")
    assert data["rotation"].dims == ("time", "axis", "column")
    assert data["wrench"].dims == ("time", "component")
    assert data["q"].dims == ("time", "joint")
    assert data["tank_energy"].dims == ("time",)
    assert list(data["axis"].values) == ["x", "y", "z"]
    assert list(data["component"].values) == ["fx", "fy", "fz", "mx", "my", "mz"]
    assert list(data["joint"].values) == [1, 2]


def test_a_run_says_what_it_is() -> None:
    run = planar_run()
    assert run.name == "planar"
    assert run.failure == ""
    assert run.data.attrs["robot"] == "planar2r"
    assert run.data.attrs["law"] == "ImpedanceLaw"
    (jump,) = run.events
    assert jump["event"] == "reference jump"
    assert jump["time"] == 0.2
    assert jump["share"] == 1
    # The arm rests at its reference: the jump stores ½ · 60 · 0.05² J.
    assert jump["stored_J"] == pytest.approx(60 * 0.05**2 / 2, rel=1e-9)
    np.testing.assert_array_equal(run["q"], run.data["q"].values)
    np.testing.assert_array_equal(run.time, np.arange(101) * 0.01)


@pytest.mark.parametrize("make", [planar_run, diverged])
def test_a_file_gives_the_same_run_back(tmp_path: Path, make: Any) -> None:
    run = make()
    path = run.save(tmp_path / "folder" / "run.nc")
    again = Run.load(path)
    xr.testing.assert_identical(again.data, run.data)
    assert (again.name, again.failure, again.events) == (run.name, run.failure, run.events)
    assert [p.name for p in path.parent.iterdir()] == ["run.nc"]


def test_the_file_is_plain_netcdf(tmp_path: Path) -> None:
    """Any HDF5 reader finds signals, units and configuration under their names."""
    path = planar_run().save(tmp_path / "run.nc")
    with h5py.File(path) as file:
        assert file.attrs["format"] == FORMAT
        assert file["tank_energy"].attrs["units"] == "J"
        assert file["q"].shape == (101, 2)


@pytest.mark.parametrize("changes", [{}, {"noise": NOISE, "seed": 3}], ids=["smooth", "noise"])
def test_the_stored_configuration_gives_the_same_run_again(tmp_path: Path, changes: dict[str, Any]) -> None:
    """Bit for bit, also from the file."""
    first = Run.load(simulate(planar(**changes)).save(tmp_path / "run.nc"))
    second = simulate(parse_scenario(first.data.attrs["scenario"]))
    xr.testing.assert_identical(second.data, first.data)


def test_the_stored_configuration_is_complete() -> None:
    """Defaults are written out, and everything is in SI units."""
    configuration = yaml.safe_load(planar_run().data.attrs["scenario"])
    assert set(configuration) == set(Scenario.model_fields) - {
        "noise",
        "control",
        "sensors",
        "motors",
        "actions",
        "payload",
    }
    assert configuration["tank"]["initial"] == 2.0
    assert configuration["law"]["regularisation"] == pytest.approx(0.01 / 5)  # kg of the two links
    assert configuration["tolerance"] == 1e-9


def test_the_file_holds_the_arm_with_its_tool() -> None:
    """Its forward kinematics are the recorded pose, whoever reads them."""
    tool = {"position": [0.1, 0.0, 0.2], "rotation_vector": [0.3, 0.0, 0.0]}
    run = simulate(planar(tool=tool))
    arm = SerialArm(SerialChain.from_urdf(run.data.attrs["robot_description"]))
    q, m = cs.SX.sym("q", 2), SimpleNamespace(**{k: cs.SX(cs.DM(v)) for k, v in arm.nominal().items()})
    pose_of = cs.Function("pose", [q], list(arm.pose(q, m)))
    for row in (0, 50, 100):
        position, rotation = pose_of(run["q"][row])
        np.testing.assert_allclose(position.full()[:, 0], run["position"][row], rtol=0, atol=1e-12)
        np.testing.assert_allclose(rotation.full(), run["rotation"][row], rtol=0, atol=1e-12)


def test_version_commit_and_seed_lie_beside_the_result() -> None:
    attributes = simulate(planar(noise=NOISE, seed=7)).data.attrs
    assert attributes["version"] == package_version()
    assert attributes["commit"] == source_commit()
    assert re.fullmatch(r"[0-9a-f]{40}\+?|unknown", attributes["commit"])
    assert attributes["seed"] == 7
    assert attributes["tolerance"] == 1e-9


def test_the_seed_chooses_the_noise() -> None:
    one, same, other = (simulate(planar(noise=NOISE, seed=s))["tau_m"] for s in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert np.abs(one - other).max() > 0.1


def test_a_run_without_noise_does_not_depend_on_the_seed() -> None:
    np.testing.assert_array_equal(simulate(planar(seed=5))["q"], planar_run()["q"])


def refused(path: Path) -> str:
    with pytest.raises(RunFileError) as error:
        Run.load(path)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_a_run_is_frozen() -> None:
    run = Run(xr.Dataset())
    for change in (
        lambda: setattr(run, "data", 5),
        lambda: setattr(run, "foo", 5),
        lambda: delattr(run, "data"),
    ):
        with pytest.raises(FrozenError, match=r"^Run is frozen; .* try Run\(run.data.assign"):
            change()


def test_files_that_are_no_netcdf(tmp_path: Path) -> None:
    run = planar_run().save(tmp_path / "run.nc").read_bytes()
    foreign = {"text.nc": b"time,q\n0,1\n", "empty.nc": b""}
    short = {"half.nc": run[: len(run) // 2], "almost.nc": run[:-1], "head.nc": run[:8]}
    for name, content in (foreign | short).items():
        path = tmp_path / name
        path.write_bytes(content)
        expected = (
            "is not a netCDF-4 file; needs "
            if name in foreign
            else f"is a netCDF file that is cut short or damaged; got {len(content)} bytes, "
        )
        assert refused(path).startswith(f"{path} {expected}")


@pytest.mark.parametrize("name", ["none.nc", "none/run.nc"])
def test_no_file(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    assert refused(path) == f"no such file: {path}; try passiflex simulate SCENARIO.yaml --out RUN.nc"


def test_a_folder(tmp_path: Path) -> None:
    assert refused(tmp_path) == f"{tmp_path} is a folder; needs the file of a run"


def test_a_scenario_is_not_yet_a_run(tmp_path: Path) -> None:
    path = tmp_path / "planar.yaml"
    path.write_text(PLANAR)
    said = f"this is a scenario, not a run; try passiflex simulate {path} --out RUN.nc"
    assert refused(path) == f"{path}: {said}"


def test_a_run_whose_rows_end_early_has_failed() -> None:
    """Whoever cut it: an audit of the rest is no verdict on the run."""
    run = planar_run()
    assert Run(run.data.isel(time=slice(0, 50))).failure == "its rows end at 0.49 s of 1 s"
    assert Run(run.data.isel(time=slice(0, 1))).failure == "its rows end at 0 s of 1 s"
    assert audit(Run(run.data.isel(time=slice(0, 50)))).verdict == "inconclusive"
    assert run.every(7).failure == ""


def test_a_netcdf_of_someone_else(tmp_path: Path) -> None:
    path = tmp_path / "other.nc"
    xr.Dataset({"a": ("x", [1.0, 2.0])}).to_netcdf(path, engine="h5netcdf")
    assert refused(path) == f"{path} is not a run of this version; got no format; needs 'passiflex run 1'"


def test_a_run_of_another_format(tmp_path: Path) -> None:
    path = tmp_path / "older.nc"
    Run(planar_run().data.assign_attrs(format="passiflex run 0")).save(path)
    expected = f"{path} is not a run of this version; got passiflex run 0; needs 'passiflex run 1'"
    assert refused(path) == expected


def test_a_run_with_a_part_missing(tmp_path: Path) -> None:
    path = tmp_path / "part.nc"
    Run(planar_run().data.drop_vars(["tank_energy", "joint_energy"])).save(path)
    assert refused(path) == f"{path} is not a complete run; got no tank_energy, joint_energy"


def test_a_run_that_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(OutputError, match="cannot write"):
        planar_run().save(tmp_path / "taken" / "run.nc")
    assert [p.name for p in tmp_path.iterdir()] == ["taken"]


def test_a_run_that_leaves_the_finite_numbers_is_a_result() -> None:
    """It ends there, says so, and is never called passive."""
    run = diverged()
    assert "finite numbers" in run.failure
    assert 0.2 <= run.time[-1] < 1
    assert run.time.size > 20
    for name in map(str, run.data.data_vars):
        assert np.isfinite(run[name]).all(), name
    result = audit(run)
    assert result.verdict in ("violated", "inconclusive")
    assert result.verdict == "violated" or run.failure in result.remedy


def test_rows_until_a_failure_are_those_of_the_run_without_it() -> None:
    """A push that begins later changes nothing that came before it."""
    calm = simulate(
        parse_scenario(DIVERGING.replace("at: 0.2", "at: 0.9").replace("by: [0, 0, 0.05]", "by: [0, 0, 0]"))
    )
    before = diverged().time < 0.2
    np.testing.assert_allclose(diverged()["q"][before], calm["q"][: before.sum()], rtol=0, atol=1e-9)


@pytest.mark.parametrize("force", [1e30, 1e100])
def test_a_force_beyond_all_steps_is_not_passed_over(force: float) -> None:
    """Whoever cannot be integrated ends the run; the arm must not stand still under the force and go on."""
    run = simulate(planar(forces=[{"from": 0.5, "to": 0.6, "force": [0, 0, force]}]))
    assert run.failure
    assert run.time[-1] < 1
    assert audit(run).verdict != "passive"


@pytest.mark.parametrize(
    ("interval", "times"),
    [
        (0.3, [0, 0.3, 0.6, 0.9, 1]),
        (0.1, np.arange(11) / 10),
        (1.0, [0, 1]),
        (0.7, [0, 0.7, 1]),
    ],
)
def test_the_last_row_is_the_end_whatever_the_interval(interval: float, times: list[float]) -> None:
    """No row is lost to rounding, and none is written twice; rows do not depend on their neighbours."""
    run = simulate(planar(output_interval=interval))
    np.testing.assert_allclose(run.time, times, rtol=0, atol=1e-12)
    at = np.round(run.time / 0.01).astype(int)
    np.testing.assert_allclose(run["q"], planar_run()["q"][at], rtol=0, atol=1e-6)
    np.testing.assert_allclose(run["tank_energy"], planar_run()["tank_energy"][at], rtol=0, atol=1e-6)


def test_too_many_rows() -> None:
    with pytest.raises(SimulationError) as error:
        simulate(planar(output_interval=1e-7))
    assert (
        str(error.value) == "too many rows; got 10000000; needs at most 2000000; try a longer output_interval"
    )


def test_an_event_off_the_grid_of_the_noise() -> None:
    step = [{"at": 0.2055, "kind": "step", "by": [0, 0, 0.05]}]
    with pytest.raises(SimulationError) as error:
        simulate(planar(noise=NOISE, reference=step))
    expected = "time 0.2055 s does not fall on the noise's grid; needs a multiple of its hold, 0.01 s"
    assert str(error.value) == expected


def test_a_file_of_before_has_its_scenario_by_another_name(tmp_path: Path) -> None:
    """It loads, is judged and salvaged as a new one."""
    run = planar_run()
    data = run.data.copy()
    data.attrs = {{"scenario": "configuration"}.get(name, name): value for name, value in data.attrs.items()}
    path = Run(data).save(tmp_path / "old.nc")
    for read in (Run.load(path), salvage(path).run):
        assert "configuration" not in read.data.attrs
        assert read.data.attrs["scenario"] == run.data.attrs["scenario"]
        assert read.scenario == run.scenario is not None
        assert audit(read).verdict == audit(run).verdict
    assert salvage(path).notices == ()


def test_a_run_without_a_scenario_that_can_be_read_has_none() -> None:
    run = planar_run()
    for text in ("", "law: [", "name: 3"):
        assert Run(run.data.assign_attrs(scenario=text)).scenario is None
