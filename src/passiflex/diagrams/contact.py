"""What touches the robot: with what force, how deep the hand is in it, what its end stops take."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from passiflex.diagrams.events import marks_of, spans_of
from passiflex.diagrams.panel import Array, Curve, Panel
from passiflex.diagrams.torque import JOINT_LOOKS
from passiflex.diagrams.viewed import Viewed, curve, curves, other_role, with_curves
from passiflex.runs.run import Run

SURFACE_LOOKS = 4
"""So many surfaces, loads and persons have a look of their own; then the looks begin again."""
STOPS = "end_stops_torque"


def touched(run: Run) -> tuple[str, ...]:
    """Return the names of the surfaces that a run has the signals of: NAME_force (N, 3) and NAME_depth (N)."""
    deep = {str(name) for name, signal in run.data.items() if signal.shape == run.time.shape}
    return tuple(name for name in _pressing(run) if f"{name}_depth" in deep)


def contact_panels(viewed: Viewed, others: Sequence[Viewed] = ()) -> tuple[Panel, ...]:
    """Return what presses the hand, by size and along the axes, how deep it is in it, and what the end stops take."""
    names = _pressing(viewed.run)  # a curve of that name says as much
    spans, marks = tuple(s for s in spans_of(viewed.run) if s.label not in names), marks_of(viewed.run)
    shown = [
        ("force", "size of force", "N", _each(viewed, others, _pressing, _size)),
        *((f"force {axis}", f"force along {axis}", "N", _each(viewed, others, _pressing, _along(i)))
          for i, axis in enumerate("xyz")),
        ("depth", "depth of the hand", "m", _each(viewed, others, touched, _depth)),
        ("end stops", "torque of the end stops", "N m", _stops(viewed, others)),
    ]  # fmt: skip
    return with_curves(
        *(
            Panel("contact", choice, title, unit, found, (), spans, marks)
            for choice, title, unit, found in shown
        )
    )


def surface_role(k: int) -> str:
    """Return the role of the surface `k`, counted from 0."""
    return f"surface {1 + k % SURFACE_LOOKS}"


def _pressing(run: Run) -> tuple[str, ...]:
    """Return the names of what may press the hand, NAME_force (N, 3): elements of the run, or what has a depth too."""
    shapes = {str(name): signal.shape for name, signal in run.data.items()}
    deep = [name.removesuffix("_depth") for name in shapes if name.endswith("_depth")]
    named = dict.fromkeys([*(element.name for element in run.elements), *deep])
    return tuple(name for name in named if shapes.get(f"{name}_force") == (run.time.size, 3))


def _each(
    viewed: Viewed,
    others: Sequence[Viewed],
    named: Callable[[Run], tuple[str, ...]],
    values: Callable[[Run, str], Array],
) -> tuple[Curve, ...]:
    """Return a curve for each name in a run, and those of the compared runs."""
    return curves(
        *(_of(viewed.run, name, name, surface_role(k), values) for k, name in enumerate(named(viewed.run))),
        *(
            _of(other.run, name, f"{name}, {other.label}", other_role(k + i * len(others)), values)
            for k, other in enumerate(others)
            for i, name in enumerate(named(other.run))
        ),
    )


def _of(run: Run, name: str, label: str, role: str, values: Callable[[Run, str], Array]) -> Curve | None:
    return curve(run, label, role, lambda: values(run, name))


def _size(run: Run, name: str) -> Array:
    """Return the size of the force [N]."""
    with np.errstate(over="ignore"):  # of a strange file
        size: Array = np.linalg.norm(run[f"{name}_force"], axis=1)
    return size


def _depth(run: Run, name: str) -> Array:
    """Return the depth [m]; 0 where they are apart, by however much."""
    return np.maximum(run[f"{name}_depth"], 0)


def _along(axis: int) -> Callable[[Run, str], Array]:
    return lambda run, name: run[f"{name}_force"][:, axis]


def _stops(viewed: Viewed, others: Sequence[Viewed]) -> tuple[Curve, ...]:
    """Return the torque of each joint's stops that ever touched."""
    runs = [(viewed.run, "", None), *((o.run, f", {o.label}", other_role(k)) for k, o in enumerate(others))]
    return curves(
        *(
            curve(run, f"joint {i + 1}{label}", role or f"joint {1 + i % JOINT_LOOKS}", _column(run, i))
            for run, label, role in runs
            for i in _stopped(run)
        )
    )


def _stopped(run: Run) -> list[int]:
    """Return the joints whose stops ever touched."""
    if STOPS not in run.data or run.data[STOPS].ndim != 2:
        return []
    return [int(i) for i in np.flatnonzero((np.nan_to_num(run[STOPS]) != 0).any(axis=0))]


def _column(run: Run, i: int) -> Callable[[], Array]:
    return lambda: run[STOPS][:, i]
