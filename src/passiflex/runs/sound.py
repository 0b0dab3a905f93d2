"""Which signals of a damaged run can be used: real numbers, in the shape that their name says."""

from __future__ import annotations

import numpy as np
import xarray as xr

from passiflex.loops.joint_extremes import JointExtremes
from passiflex.loops.recorded import axes_of_signals
from passiflex.loops.witness import Witness

Dims = tuple[str, ...]

SIZES = {"axis": 3, "column": 3, "component": 6}
"""How long the axes of space are; the others are as long as the run and the robot have it."""
OF_TIME = ("_energy", "_power", "_storage", "_share", "_time")
"""Ends of the names of signals that are one number at each instant."""
OF_ROBOT = ("torque_limit", "velocity_limit", "lower_position_limit", "upper_position_limit")
NOTED = {
    f.name: ("joint",) * len(f.shape)
    for f in Witness(JointExtremes(1, "", "", "", motors=True), has_tank=True, sampled=True).extremes
}
"""What was noted at every step, and its axes."""
USUAL: tuple[Dims, ...] = (
    ("time",), ("time", "joint"), ("joint",), ("time", "axis"), ("time", "axis", "column"), ("time", "component"),
)  # fmt: skip
"""Axes that a signal may have which nobody here knows, as the state of somebody's element."""
LARGEST = 1e30
"""No quantity of a robot is larger, in SI units; squares of it are still finite. Energies, which only add, may be."""


def sound_signals(data: xr.Dataset, notices: list[str]) -> xr.Dataset:
    """Return the signals that can be used, time first; what is not finite in them, or too large, is NaN."""
    kept, lost = {}, []
    for name, values in data.data_vars.items():
        if values.dtype.kind not in "fiub" or (dims := _ordered(str(name), values, data)) is None:
            lost.append(f"{name} {tuple(values.shape)} of {values.dtype}")
            continue
        kept[name] = _bounded(str(name), values.transpose(*dims))
    if lost:
        notices.append(f"Left out, as they do not fit a run: {', '.join(lost)}.")
    return data.drop_vars(list(data.data_vars)).assign(kept)


def _ordered(name: str, values: xr.DataArray, data: xr.Dataset) -> Dims | None:
    """Return the axes of a signal in their order; None if it has others, or one of a wrong length."""
    if any(data.sizes[axis] != size for axis, size in SIZES.items() if axis in values.dims):
        return None
    return next((dims for dims in _possible(name) if sorted(dims) == sorted(map(str, values.dims))), None)


def _possible(name: str) -> tuple[Dims, ...]:
    """Return the axes that a signal of this name may have; one that is not known here may be of any usual kind."""
    if (axes := axes_of_signals().get(name)) is not None:
        return (("time", *axes),)
    if name in NOTED:
        return (NOTED[name],)
    if name in OF_ROBOT:
        return (("joint",),)
    return (("time",),) if name.endswith(OF_TIME) else USUAL


def _bounded(name: str, values: xr.DataArray) -> xr.DataArray:
    """Return numbers in double precision; a limit may be infinite, an energy as large as a diverging run makes it."""
    numbers = values.astype(np.float64)
    largest = np.inf if name.endswith(OF_TIME) else LARGEST
    return numbers.where(np.abs(numbers) < largest) if "time" in values.dims else numbers
