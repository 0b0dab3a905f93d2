"""The signals of a run as columns of numbers, each with a name and one unit."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
import xarray as xr

from passiflex.robots.bodies import Array
from passiflex.runs.run import Run
from passiflex.runs.run_arm import chain_of


class Signal(NamedTuple):
    """A signal over time: name, meaning, numbers (N, k), and name and unit of each of the k columns."""

    name: str
    meaning: str
    values: Array
    columns: tuple[str, ...]
    units: tuple[str, ...]

    @property
    def titles(self) -> list[str]:
        """Return the columns with their units, as `q_1 [rad]`."""
        return [f"{column} [{unit}]" for column, unit in zip(self.columns, self.units, strict=True)]


def signals_of(run: Run) -> Iterator[Signal]:
    """Yield all signals over time in the order of the file; a matrix row by row."""
    chain = chain_of(run)
    for name, variable in run.data.data_vars.items():
        if variable.dims[:1] != ("time",):
            continue
        shape, numbers = variable.shape[1:], variable.to_numpy()
        indices = [_indices(run.data, str(d), n) for d, n in zip(variable.dims[1:], shape, strict=True)]
        columns = tuple("_".join([str(name), *words]) for words in product(*indices))
        unit = str(variable.attrs.get("units", "1"))
        if "joint" in variable.dims:
            units = tuple(chain.unit_of(i, unit) if chain else unit for i, *_ in np.ndindex(*shape))
        else:
            units = tuple(_of_block(unit, place) for place in np.ndindex(*shape))
        values = np.asarray(numbers, dtype=float).reshape(len(numbers), -1)
        yield Signal(str(name), str(variable.attrs.get("long_name", "")), values, columns, units)


def _indices(data: xr.Dataset, dimension: str, size: int) -> list[str]:
    """Return what tells the entries of a dimension apart: its coordinate, or 1, 2, ..."""
    words = data[dimension].to_numpy() if dimension in data.coords else np.arange(1, size + 1)
    return [str(word) for word in words]


def _of_block(unit: str, place: tuple[int, ...]) -> str:
    """Return the unit of one entry: "N, N m" are the halves of a wrench, "N/m, N, N m/rad" blocks of a stiffness.

    The blocks of a 6×6 stiffness are that of translation, the two of both, and that of rotation.
    """
    parts, turns = unit.split(", "), [i // 3 for i in place]
    return parts[sum(turns)] if len(parts) == len(place) + 1 and set(turns) <= {0, 1} else unit
