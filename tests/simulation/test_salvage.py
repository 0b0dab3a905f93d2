"""What is left of a damaged run is shown, and everything that is wrong with it is said."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from passiflex.errors import RunFileError
from passiflex.passivity import audit
from passiflex.runs.run_file import FORMAT
from passiflex.runs.salvaged import salvage
from passiflex.simulation import Run, parse_scenario, simulate
from worlds import PLANAR


@pytest.fixture(scope="module")
def run() -> Run:
    return simulate(parse_scenario(PLANAR))


def changed(run: Run, path: Path, change: Callable[[xr.Dataset], xr.Dataset]) -> Path:
    return Run(change(run.data.copy(deep=True))).save(path)


def with_numbers(name: str, rows: slice, number: float) -> Callable[[xr.Dataset], xr.Dataset]:
    def change(data: xr.Dataset) -> xr.Dataset:
        values = data[name].to_numpy().copy()
        values[rows] = number
        return data.assign({name: (data[name].dims, values, data[name].attrs)})

    return change


def without(attribute: str) -> Callable[[xr.Dataset], xr.Dataset]:
    def change(data: xr.Dataset) -> xr.Dataset:
        del data.attrs[attribute]
        return data

    return change


def test_a_whole_run_has_no_notices(run: Run, tmp_path: Path) -> None:
    path = run.save(tmp_path / "run.nc")
    read, notices = salvage(path)
    assert notices == ()
    xr.testing.assert_identical(read.data, Run.load(path).data)


def test_a_thinned_run_is_not_called_short(run: Run, tmp_path: Path) -> None:
    assert salvage(run.every(7).save(tmp_path / "run.nc")).notices == ()


@pytest.mark.parametrize(
    ("change", "notice"),
    [
        (
            with_numbers("tau_m", slice(10, 12), np.nan),
            "Numbers that are not finite or too large, shown as gaps: tau_m (first at 0.1 s).",
        ),
        (
            with_numbers("tank_energy", slice(20, None), np.inf),
            "Numbers that are not finite or too large, shown as gaps: tank_energy (first at 0.2 s).",
        ),
        (
            with_numbers("tau_m", slice(10, 12), 1e300),
            "Numbers that are not finite or too large, shown as gaps: tau_m (first at 0.1 s).",
        ),
        (
            lambda data: data.isel(time=slice(None, 31)),
            "The run is cut short: its rows end at 0.3 s of 0.5 s.",
        ),
        (
            lambda data: data.isel(time=slice(None, 31)).assign_attrs(failure="the motors stopped"),
            "The run ended early, at 0.3 s of 0.5 s: the motors stopped.",
        ),
        (without("events"), "The file does not say its events."),
        (
            lambda data: data.assign_attrs(has_tank=np.array([1, 0]), duration="long", control_period=np.nan),
            "The file does not say its control_period, duration, has_tank.",
        ),
        (
            lambda data: data.assign_attrs(format="passiflex run 0"),
            f"The file is a 'passiflex run 0', not a {FORMAT!r}: shown is what has the same name in both.",
        ),
    ],
    ids=["gap", "infinite", "huge", "short", "failed", "attribute", "kind of attribute", "version"],
)
def test_damage_is_said_and_the_rest_is_there(
    run: Run, tmp_path: Path, change: Callable[[xr.Dataset], xr.Dataset], notice: str
) -> None:
    read, notices = salvage(changed(run, tmp_path / "run.nc", change))
    assert notices == (notice,)
    np.testing.assert_array_equal(read["q"], run["q"][: read.time.size])


@pytest.mark.parametrize("number", [np.nan, np.inf, 0.05, 0.19, 1e300])
def test_rows_end_where_time_goes_wrong(run: Run, tmp_path: Path, number: float) -> None:
    path = changed(
        run,
        tmp_path / "run.nc",
        lambda data: data.assign_coords(
            time=("time", np.where(np.arange(51) == 20, number, data["time"]), {"units": "s"})
        ),
    )
    read, notices = salvage(path)
    assert notices[0] == "Time goes wrong after row 20 of 51: shown are the rows before."
    np.testing.assert_array_equal(read.time, run.time[:20])


def test_damaged_bytes_of_one_signal_leave_the_others(run: Run, tmp_path: Path) -> None:
    path = run.save(tmp_path / "run.nc")
    with h5py.File(path) as file:
        chunk = file["tau_m"].id.get_chunk_info(0)
    content = bytearray(path.read_bytes())
    content[chunk.byte_offset : chunk.byte_offset + chunk.size] = bytes(chunk.size)
    path.write_bytes(content)
    read, notices = salvage(path)
    assert notices == ("The file is damaged: tau_m could not be read.",)
    assert "tau_m" not in read.data
    np.testing.assert_array_equal(read["q"], run["q"])
    with pytest.raises(RunFileError, match="cut short or damaged"):
        Run.load(path)


@pytest.mark.parametrize("signal", [True, False])
def test_a_file_that_does_not_say_whether_it_has_a_tank_has_one_if_there_is_its_level(
    run: Run, tmp_path: Path, signal: bool
) -> None:
    def change(data: xr.Dataset) -> xr.Dataset:
        return without("has_tank")(data if signal else data.drop_vars("tank_energy"))

    read, notices = salvage(changed(run, tmp_path / "run.nc", change))
    lacks = () if signal else ("The file lacks tank_energy.",)
    assert notices == ("The file does not say its has_tank.", *lacks)
    assert read.has_tank is signal


def test_signals_that_are_missing_are_named(run: Run, tmp_path: Path) -> None:
    names = ["joint_energy", "theta", "position", "tau_m", "torque_limit", "valve"]
    _, notices = salvage(changed(run, tmp_path / "run.nc", lambda data: data.drop_vars(names)))
    # Of valve, nothing is judged, and nobody looks at it.
    assert notices == ("The file lacks joint_energy, theta, position, tau_m, torque_limit.",)


def test_a_run_that_diverged_keeps_its_verdict(run: Run, tmp_path: Path) -> None:
    given = with_numbers("joint_energy", slice(40, None), 1e200)
    moving = with_numbers("link_kinetic_energy", slice(40, None), 1e200)
    path = changed(run, tmp_path / "run.nc", lambda data: moving(given(data)))
    read, notices = salvage(path)
    assert notices == ()
    assert audit(read).verdict == audit(Run.load(path)).verdict == "violated"


def replaced(name: str, dims: tuple[str, ...], values: np.ndarray) -> Callable[[xr.Dataset], xr.Dataset]:
    return lambda data: data.drop_vars(name).assign({name: (dims, values)})


@pytest.mark.parametrize(
    ("change", "lost"),
    [
        (replaced("tau_m", ("time",), np.zeros(51)), "tau_m (51,) of float64"),
        (replaced("tau_m", (), np.array(1.0)), "tau_m () of float64"),
        (replaced("tau_m", ("row", "joint"), np.zeros((9, 2))), "tau_m (9, 2) of float64"),
        (replaced("tau_m", ("time", "joint"), np.zeros((51, 2), complex)), "tau_m (51, 2) of complex128"),
        (replaced("position", ("time", "few"), np.zeros((51, 2))), "position (51, 2) of float64"),
        (replaced("tank_energy", ("time", "joint"), np.zeros((51, 2))), "tank_energy (51, 2) of float64"),
        (replaced("external_energy", ("time",), np.full(51, "1 J")), "external_energy (51,) of <U3"),
        (replaced("torque_limit", (), np.array(1.0)), "torque_limit () of float64"),
    ],
)
def test_a_signal_of_another_shape_or_kind_is_left_out(
    run: Run, tmp_path: Path, change: Callable[[xr.Dataset], xr.Dataset], lost: str
) -> None:
    read, notices = salvage(changed(run, tmp_path / "run.nc", change))
    assert notices == (f"Left out, as they do not fit a run: {lost}.",)
    assert lost.split()[0] not in read.data
    np.testing.assert_array_equal(read["q"], run["q"])


def test_space_has_three_axes(run: Run, tmp_path: Path) -> None:
    path = changed(run, tmp_path / "run.nc", lambda data: data.isel(axis=slice(None, 2)))
    read, notices = salvage(path)
    assert "position (51, 2) of float64" in notices[0]
    assert "position" not in read.data


def test_a_signal_on_its_side_is_turned(run: Run, tmp_path: Path) -> None:
    path = changed(run, tmp_path / "run.nc", lambda data: data.assign(q=data["q"].T, wrench=data["wrench"].T))
    read, notices = salvage(path)
    assert notices == ()
    np.testing.assert_array_equal(read["q"], run["q"])
    np.testing.assert_array_equal(read["wrench"], run["wrench"])


def refused(path: Path) -> str:
    with pytest.raises(RunFileError) as error:
        salvage(path)
    return str(error.value)


def test_what_cannot_be_shown(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "run.nc"
    assert refused(path) == f"no such file: {path}; try passiflex simulate SCENARIO.yaml --out RUN.nc"
    path.write_text("time,q\n0,1\n")
    assert refused(path).startswith(f"{path} is not a netCDF-4 file; needs ")
    whole = run.save(path).read_bytes()
    path.write_bytes(whole[:-100])
    assert refused(path).startswith(
        f"{path} is a netCDF file that is cut short or damaged; got {len(whole) - 100} bytes, "
    )
    xr.Dataset({"a": ("x", [1.0])}).to_netcdf(path, engine="h5netcdf")
    assert refused(path) == f"{path} is not a run of this version; got no format; needs {FORMAT!r}"
    changed(run, path, lambda data: data.assign_coords(time=("time", np.full(51, "noon"))))
    assert refused(path) == f"{path} holds nothing that can be shown; got time of <U4 (51,)"
    changed(run, path, lambda data: data.isel(time=slice(0, 0)))
    assert refused(path) == f"{path} holds nothing that can be shown; got no rows"
    changed(run, path, lambda data: data.drop_vars("time"))
    assert refused(path) == f"{path} holds nothing that can be shown; got no readable time"
    changed(run, path, lambda data: data.drop_vars(["q", "position", "tank_energy", "tau_m"]))
    expected = f"{path} holds nothing that can be shown; got none of q, position, tank_energy, tau_m"
    assert refused(path) == expected
