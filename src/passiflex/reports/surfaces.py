"""What touches the hand, as a page draws it: bodies, where they are, and their forces while it plays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.diagrams import surface_role, touched
from passiflex.diagrams.viewed import first_finite
from passiflex.reports.arrays import Arrays
from passiflex.reports.thinning import frame_rows
from passiflex.reports.touching_point import touching_point
from passiflex.scenarios.environment import labelled
from passiflex.scenarios.surface_settings import AbstractSurface, Box, Cylinder, Plane, Sphere
from passiflex.simulation import Run

Array = NDArray[np.float64]

MOST = 24
"""So many surfaces are drawn."""
LARGEST = 100.0
"""What is larger, or further from the base, than this [m] is not drawn."""
SQUARE = 1e-6
"""Axes that are less at right angles than this are none."""


def drawn_surfaces(run: Run) -> tuple[str, ...]:
    """Return the names of the surfaces that a page shows."""
    return touched(run)[:MOST]


def surfaces_header(run: Run, arrays: Arrays) -> list[dict[str, Any]]:
    """Return each surface: its body, null where the file says none that can be drawn, and what it does over time."""
    rows, scenario = frame_rows(run.time.size), run.scenario
    known = {} if scenario is None else labelled(scenario.environment)
    start = first_finite(run["position"]) if "position" in run.data else np.full(3, np.nan)
    found = []
    for k, name in enumerate(drawn_surfaces(run)):
        entry = known.get(name)
        body = _body(entry, start) if isinstance(entry, AbstractSurface) else None
        moved = f"{name}_place"
        shift, shift_of = None, None
        if isinstance(entry, AbstractSurface) and entry.motion:
            there = run.data.get(moved)
            known_there = there is not None and there.shape == (run.time.size, 3)
            place = run[moved][rows] if known_there else np.full((rows.size, 3), np.nan)
            shift_of = place - _place(entry, start)
            shift = arrays.add(shift_of)
        found.append(
            {
                "name": name,
                "role": surface_role(k),
                "body": body,
                "shift": shift,
                "force": arrays.add(run[f"{name}_force"][rows]),
                "depth": arrays.add(run[f"{name}_depth"][rows]),
                "point": None if body is None else _point(run, entry, start, rows, shift_of, arrays),
            }
        )
    return found


def _point(
    run: Run, entry: Any, start: Array, rows: NDArray[np.intp], shift: Array | None, arrays: Arrays
) -> Any:
    """Return where the hand touches at the rows; None where its pose is not known."""
    turned = run.data.get("rotation")
    if (
        run.scenario is None
        or "position" not in run.data
        or turned is None
        or turned.shape != (run.time.size, 3, 3)
    ):
        return None
    place = _place(entry, start) + (np.zeros(3) if shift is None else shift)
    with np.errstate(all="ignore"):
        where = np.broadcast_to(place, (rows.size, 3))
        return arrays.add(
            touching_point(
                entry, entry.axes, run.scenario.hand, where, run["position"][rows], run["rotation"][rows]
            )
        )


def surface_notices(surfaces: list[dict[str, Any]], run: Run) -> list[str]:
    """Return sentences on the surfaces that are not drawn."""
    hidden = [s["name"] for s in surfaces if s["body"] is None]
    left = len(touched(run)) - len(surfaces)
    said = (
        [f"Not drawn, but felt: {', '.join(hidden)}; too large, too far, or not described."] if hidden else []
    )
    return said + ([f"{left} more surfaces are not drawn."] if left else [])


def without_contact(run: Run, rows: NDArray[np.intp]) -> Array:
    """Return the force [N] on the end effector, (rows, 3), beside that of the surfaces."""
    whole: Array = run["wrench"][rows, :3]
    rest = whole - sum((run[f"{name}_force"][rows] for name in drawn_surfaces(run)), np.zeros(3))
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(rest) <= 1e-9 * np.abs(whole), 0.0, rest)  # what is left of round-off


def _place(entry: AbstractSurface, start: Array) -> Array:
    return np.array(entry.place) + (start if entry.relative else 0.0)


def _body(entry: AbstractSurface, start: Array) -> dict[str, Any] | None:
    """Return kind, place, axes row by row and sizes [m]; None for what cannot be drawn."""
    with np.errstate(all="ignore"):
        place, axes = _place(entry, start), _axes(entry)
        if axes is None:
            return None
        if isinstance(entry, Plane) and np.isfinite(start).all():  # the part that the hand is next to
            place = start - axes[:, 2] * (axes[:, 2] @ (start - place))
    sizes: list[float | None]
    match entry:
        case Plane():
            sizes = []
        case Sphere():
            sizes = [entry.radius]
        case Cylinder():
            sizes = [entry.radius, entry.length if entry.length <= LARGEST else None]
        case Box():
            sizes = list(entry.size)
        case _:
            return None
    known = [*place, *(size for size in sizes if size is not None)]
    if not np.abs(known).max() <= LARGEST:
        return None
    return {
        "kind": entry.kind,
        "place": [float(v) for v in place],
        "rotation": [float(v) for v in axes.ravel()],
        "sizes": sizes,
    }


def _axes(entry: AbstractSurface) -> Array | None:
    """Return the axes; None where a direction is too short or too long to be one."""
    try:
        axes = entry.axes
    except ValueError:  # how SciPy says so
        return None
    return axes if np.allclose(axes @ axes.T, np.eye(3), rtol=0, atol=SQUARE) else None
