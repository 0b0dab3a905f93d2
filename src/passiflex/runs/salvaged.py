"""Reading what is left of a damaged run, to look at it; whoever judges a run reads it by `Run.load`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from passiflex.errors import RunFileError
from passiflex.files import as_path
from passiflex.runs.run import Run
from passiflex.runs.run_attributes import renamed, without_units, wrong_attributes, wrong_units
from passiflex.runs.run_bounds import require_bounded
from passiflex.runs.run_file import FORMAT, cut_short, foreign, remarks, require_file, unreadable
from passiflex.runs.sound import sound_signals

KIND = FORMAT.rsplit(" ", 1)[0]
DEFAULTS: dict[str, Any] = {
    "name": "a run without a name",
    "failure": "",
    "events": "[]",
    "scenario": "",
    "control_period": 0.0,
    "duration": 0.0,
}
"""What stands in for attributes that a run lacks, or that are of another kind."""
LATEST = 10
"""An instant after so many times the duration of a run is damage."""
SHOWN = ("q", "position", "tank_energy", "tau_m")
"""Without any of these there is nothing to look at."""


class Salvaged(NamedTuple):
    """What could be read of a run, and a sentence on each thing that is wrong with it."""

    run: Run
    notices: tuple[str, ...]


def salvage(path: str | Path) -> Salvaged:
    """Read as much of a run as is there; a run without damage has no notices.

    Rows end before the first instant that is no number or does not follow the one before. Signals that
    cannot be read or do not fit a run are left out; numbers that are not finite, or larger than anything
    of a robot, are NaN.

    Raises
    ------
    RunFileError
        If the file is not there, is no run of any version, or holds nothing that can be shown.
    """
    path = as_path(path, "the file of a run")
    require_file(path)
    _require_bounded(path)
    notices: list[str] = []
    data, in_file = _readable(path, notices)
    if not str(data.attrs.get("format", "")).startswith(f"{KIND} "):
        raise foreign(path, data)
    if data.attrs["format"] != FORMAT:
        notices.append(
            f"The file is a {data.attrs['format']!r}, not a {FORMAT!r}: shown is what has the same name in both."
        )
    data = _with_attributes(renamed(data), notices)
    data = _rows_in_order(_with_seconds(path, data), notices)
    data = sound_signals(data, notices)
    if (lacking := _lacking(data)) is not None:
        raise RunFileError(f"{path} holds nothing that can be shown", got=lacking)
    return Salvaged(Run(data), (*notices, *remarks(data, in_file), *_end(data)))


def _lacking(data: xr.Dataset) -> str | None:
    """Return what is not there of the least that can be shown."""
    if not data.sizes.get("time"):
        return "no rows"
    if "time" not in data.variables:
        return "no readable time"  # the number of a row is none
    shown = any("time" in data[name].dims for name in SHOWN if name in data)
    return None if shown else f"none of {', '.join(SHOWN)}"


def _require_bounded(path: Path) -> None:
    try:
        require_bounded(path)
    except RunFileError:
        raise
    except Exception as error:
        raise unreadable(path, error) from error


def _readable(path: Path, notices: list[str]) -> tuple[xr.Dataset, list[str]]:
    """Return the variables that can be read, one by one, as damage in one leaves the others; and the names of all."""
    try:
        with xr.open_dataset(path, engine="h5netcdf") as opened:
            lost, names = [], [str(name) for name in opened.variables]
            for name in names:
                try:
                    opened[name].load()
                except Exception:  # the readers raise many kinds for damaged bytes
                    lost.append(name)
            data = opened.drop_vars(lost).load()
    except Exception as error:
        raise unreadable(path, error) from error
    if lost:
        notices.append(f"The file is damaged: {', '.join(lost)} could not be read.")
    return data, names


def _with_attributes(data: xr.Dataset, notices: list[str]) -> xr.Dataset:
    """Return the run with attributes that a run can have, and units that are text."""
    wrong = wrong_attributes(data.attrs)
    defaults = DEFAULTS | {"has_tank": int("tank_energy" in data)}
    absent = {name: value for name, value in defaults.items() if name not in data.attrs or name in wrong}
    left_out = [name for name in wrong if name not in absent]
    if absent:
        notices.append(f"The file does not say its {', '.join(absent)}.")
    if left_out:
        notices.append(f"Left out, as no run says it: {', '.join(left_out)}.")
    if units := wrong_units(data):
        notices.append(f"Signals whose units are no text: {', '.join(units)}.")
        data = without_units(data, units)
    data = data.assign_attrs(absent)
    data.attrs = {name: value for name, value in data.attrs.items() if name not in left_out}
    return data


def _with_seconds(path: Path, data: xr.Dataset) -> xr.Dataset:
    """Return the run with its time in double precision."""
    if "time" not in data.variables:
        return data
    time = data["time"]
    if time.dtype.kind not in "fiu" or time.dims != ("time",):
        raise RunFileError(
            f"{path} holds nothing that can be shown", got=f"time of {time.dtype} {time.shape}"
        )
    return data.assign_coords(time=time.astype(np.float64))


def _rows_in_order(data: xr.Dataset, notices: list[str]) -> xr.Dataset:
    if not data.sizes.get("time") or "time" not in data.variables:
        return data
    time = data["time"].to_numpy()
    latest = LATEST * data.attrs["duration"] or np.inf
    good = (np.abs(time) < latest) & np.append(True, np.diff(time) > 0)
    if good.all():
        return data
    count = int(np.argmin(good))
    notices.append(f"Time goes wrong after row {count} of {time.size}: shown are the rows before.")
    return data.isel(time=slice(None, count))


def _end(data: xr.Dataset) -> list[str]:
    """Return a sentence on why the run does not reach its duration, if it does not."""
    if data.attrs["failure"]:
        end, wanted = float(data["time"][-1]), float(data.attrs["duration"])
        return [f"The run ended early, at {end:.4g} s of {wanted:.4g} s: {data.attrs['failure']}."]
    short = cut_short(data)
    return [f"The run is cut short: {short}."] if short else []
