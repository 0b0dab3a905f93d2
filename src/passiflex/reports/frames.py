"""The motion in space at the instants that are played: of the arm, and of what it is compared with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.diagrams import Viewed
from passiflex.diagrams.viewed import first_finite
from passiflex.reports.arm import same_kinematics
from passiflex.reports.arrays import Arrays
from passiflex.reports.surfaces import drawn_surfaces, without_contact
from passiflex.reports.thinning import frame_rows
from passiflex.robots import SerialChain
from passiflex.runs.run_arm import chain_of
from passiflex.simulation import Run

Array = NDArray[np.float64]

NOW = 1e-9
"""Two instants closer than this are one [s]."""
OPTIONAL = {"reference": "desired_position", "governed": "governed_position"}


def frames_header(run: Run, joints: int, arrays: Arrays) -> dict[str, Any]:
    """Return rows of the run, thinned by a stride; what the run lacks is NaN, or null where the page allows it."""
    rows = frame_rows(run.time.size)

    def signal(name: str, size: int) -> Array:
        return run[name][rows] if name in run.data else np.full((rows.size, size), np.nan)

    force, moment = _rest(run, rows) if "wrench" in run.data else (None, None)
    return {
        "time": arrays.add(run.time[rows], "f64"),
        "q": arrays.add(signal("q", joints)),
        "theta": arrays.add(signal("theta", joints)),
        "position": arrays.add(signal("position", 3)),
        **{key: arrays.add(run[name][rows]) if name in run.data else None for key, name in OPTIONAL.items()},
        "force": None if force is None else arrays.add(force),
        "moment": None if moment is None else arrays.add(moment),
    }


def _rest(run: Run, rows: NDArray[np.intp]) -> tuple[Array, Array | None]:
    """Return force and moment; with surfaces the force beside theirs, and no moment: whose it is no run says."""
    if drawn_surfaces(run):
        return without_contact(run, rows), None
    wrench = run["wrench"][rows]
    return wrench[:, :3], wrench[:, 3:]


def ghosts_header(
    main: Viewed,
    others: Sequence[Viewed],
    roles: Sequence[str],
    chain: SerialChain | None,
    arrays: Arrays,
) -> list[dict[str, Any]]:
    """Return the compared runs at the instants of the frames; without any, the ideal mass-spring-damper."""
    run = main.run
    rows = frame_rows(run.time.size)
    time = run.time[rows]
    ghosts = []
    for other, role in zip(others, roles, strict=True):
        there = other.run
        if "position" not in there.data:
            continue
        arm = "q" in there.data and same_kinematics(chain, chain_of(there))
        ghosts.append(
            {
                "label": other.label,
                "kind": "run",
                "role": role,
                "q": arrays.add(_at(time, there.time, there["q"])) if arm else None,
                "position": arrays.add(_at(time, there.time, there["position"])),
            }
        )
    if not others and main.ideal is not None and "position" in run.data:
        moved = first_finite(run["position"]) + main.ideal[rows]
        ghosts.append(
            {"label": "ideal", "kind": "ideal", "role": "msd", "q": None, "position": arrays.add(moved)}
        )
    return ghosts


def _at(time: Array, known: Array, values: Array) -> Array:
    """Return columns at other instants, between rows on a straight line; NaN before the first and after the last."""
    inside = (time >= known[0] - NOW) & (time <= known[-1] + NOW)
    columns = [np.where(inside, np.interp(time, known, column), np.nan) for column in values.T]
    return np.column_stack(columns)
