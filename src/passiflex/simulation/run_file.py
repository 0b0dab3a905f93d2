"""What the file of a run has to hold, and what is wrong with one that does not."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from passiflex.errors import RunFileError

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
ATTRIBUTES = ("name", "failure", "events", "has_tank", "configuration", "control_period")
SIGNATURE = b"\x89HDF\r\n\x1a\n"


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


def require_file(path: Path) -> None:
    """Raise RunFileError unless there is a file."""
    if not path.is_file():
        raise RunFileError(f"no such file: {path}", try_="passiflex simulate SCENARIO.yaml --out RUN.nc")


def unreadable(path: Path, error: Exception) -> RunFileError:
    """Return what to say of a file that no reader can open: whether it is a netCDF file at all, or the rest is lost."""
    if path.read_bytes()[: len(SIGNATURE)] != SIGNATURE:
        return RunFileError(f"{path} is not a netCDF-4 file", got=type(error).__name__)
    return RunFileError(
        f"{path} is a netCDF file that is cut short or damaged",
        got=f"{path.stat().st_size} bytes, {type(error).__name__}",
        try_="copying it again: the index of such a file stands at its end, so that nothing of it can be read",
    )


def foreign(path: Path, data: xr.Dataset) -> RunFileError:
    """Return what to say of a netCDF file that is no run, or one of another version."""
    got = data.attrs.get("format", "no format")
    return RunFileError(f"{path} is not a run of this version", got=got, needs=repr(FORMAT))
