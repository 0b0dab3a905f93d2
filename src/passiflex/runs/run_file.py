"""What the file of a run has to hold, and what is wrong with one that does not."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from passiflex.errors import RunFileError
from passiflex.texts.kinds import NETCDF, another_file

FORMAT = "passiflex run 1"
PHYSICAL = (
    "tank_energy",
    "external_energy",
    "motor_energy",
    "joint_energy",
    "joint_loss_energy",
    "reference_energy",
    "link_kinetic_energy",
    "motor_kinetic_energy",
    "joint_spring_energy",
    "potential_energy",
    "compensated_energy",
    "shaped_kinetic_energy",
    "shaped_spring_energy",
    "cartesian_spring_energy",
    "gravity_storage",
    *(f"{flow}_power" for flow in ("external", "motor", "joint", "joint_loss")),
)
"""What the energy balances of any run are made of."""
SAMPLED = (
    *PHYSICAL,
    "friction_energy",
    "friction_power",
    "law_storage",
    *(f"{flow}_energy" for flow in ("measured_port", "granted", "drawn", "refilled", "spilled")),
)
CONTINUOUS = (
    *PHYSICAL,
    "drawn_energy",
    "spilled_energy",
    *(f"{flow}_power" for flow in ("reference", "drawn", "spilled")),
)
ATTRIBUTES = ("name", "failure", "events", "has_tank", "scenario", "control_period")
LOOKED_AT = (
    "q", "theta", "dq", "dtheta", "position", "rotation", "desired_position", "desired_rotation", "tau_m", "tau_a",
    "tau_e", "wrench", "torque_limit",
)  # fmt: skip
"""What people look at besides, and every run has."""


class Defects(NamedTuple):
    """What keeps the books of a run from being read: parts that are not there, or not finite everywhere."""

    missing: tuple[str, ...]
    broken: tuple[str, ...]


def defects(data: xr.Dataset) -> Defects:
    """Return what of the signals and attributes that an audit needs is missing, or has numbers that are not finite."""
    needed = (*(SAMPLED if data.attrs.get("control_period") else CONTINUOUS), "time")
    missing = [name for name in needed if name not in data.variables]
    missing += [name for name in ATTRIBUTES if name not in data.attrs]
    there = [name for name in needed if name in data.variables]
    broken = [name for name in there if not np.isfinite(data[name].to_numpy()).all()]
    return Defects(tuple(missing), tuple(broken))


def cut_short(data: xr.Dataset) -> str:
    """Return where the rows of a run end if that is before its duration; a thinned run may end one row before."""
    time, duration = data["time"].to_numpy(), float(data.attrs.get("duration", 0.0))
    row = float(time[-1] - time[-2]) if time.size > 1 else 0.0
    if not time.size or time[-1] >= duration * (1 - 1e-9) - row:
        return ""
    return f"its rows end at {time[-1]:.4g} s of {duration:.4g} s"


def remarks(data: xr.Dataset, explained: Collection[str] = ()) -> list[str]:
    """Return a sentence on the signals that a run lacks, but for the `explained`, and one on those with gaps."""
    said = []
    there = (*data.variables, *ATTRIBUTES, *explained)
    missing = [name for name in (*defects(data).missing, *LOOKED_AT) if name not in there]
    if missing:
        said.append(f"The file lacks {', '.join(missing)}.")
    first: dict[str, float] = {}
    for name, values in data.data_vars.items():
        if "time" in values.dims and values.dtype.kind == "f":
            finite = np.isfinite(values.to_numpy()).all(axis=tuple(range(1, values.ndim)))
            if not finite.all():
                first[str(name)] = float(data["time"][int(np.argmin(finite))])
    if first:
        signals = ", ".join(f"{name} (first at {at:.4g} s)" for name, at in first.items())
        said.append(f"Numbers that are not finite or too large, shown as gaps: {signals}.")
    return said


def require_file(path: Path) -> None:
    """Raise RunFileError unless there is a file."""
    if os.path.isdir(path):
        raise RunFileError(f"{path} is a folder", needs="the file of a run")
    if os.path.exists(path) and not os.path.isfile(path):
        raise RunFileError(f"{path} is no regular file", needs="the file of a run")
    if not os.path.isfile(path):
        raise RunFileError(f"no such file: {path}", try_="passiflex simulate SCENARIO.yaml --out RUN.nc")


def unreadable(path: Path, error: Exception) -> RunFileError:
    """Return what to say of a file that no reader can open: whether it is a netCDF file at all, or the rest is lost."""
    with path.open("rb") as file:
        begin = file.read(len(NETCDF))
    if begin != NETCDF:
        if (other := another_file(path, "run")) is not None:
            return RunFileError(f"{path}: {other}")
        return RunFileError(f"{path} is not a netCDF-4 file", needs="a file that passiflex simulate wrote")
    return RunFileError(
        f"{path} is a netCDF file that is cut short or damaged",
        got=f"{path.stat().st_size} bytes, {type(error).__name__}",
        try_="copying it again: the index of such a file stands at its end, so that nothing of it can be read",
    )


def foreign(path: Path, data: xr.Dataset) -> RunFileError:
    """Return what to say of a netCDF file that is no run, or one of another version."""
    got = data.attrs.get("format", "no format")
    return RunFileError(f"{path} is not a run of this version", got=got, needs=repr(FORMAT))
