"""What touches the hand: with what force, and how deep the hand is in it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from passiflex.diagrams.events import marks_of, spans_of
from passiflex.diagrams.panel import Array, Curve, Panel
from passiflex.diagrams.viewed import Viewed, curve, curves, other_role, with_curves
from passiflex.runs.run import Run

SURFACE_LOOKS = 4
"""So many surfaces have a look of their own; then the looks begin again."""


def touched(run: Run) -> tuple[str, ...]:
    """Return the names of the surfaces that a run has the signals of: NAME_force (N, 3) and NAME_depth (N)."""
    rows = run.time.size
    shapes = {str(name): signal.shape for name, signal in run.data.items()}
    names = [name.removesuffix("_depth") for name, shape in shapes.items() if name.endswith("_depth")]
    return tuple(
        name
        for name in names
        if shapes[f"{name}_depth"] == (rows,) and shapes.get(f"{name}_force") == (rows, 3)
    )


def surface_role(k: int) -> str:
    """Return the role of the surface `k`, counted from 0."""
    return f"surface {1 + k % SURFACE_LOOKS}"


def contact_panels(viewed: Viewed, others: Sequence[Viewed] = ()) -> tuple[Panel, ...]:
    """Return the force of each surface on the hand, and how deep the hand is in it; none without surfaces."""
    if not touched(viewed.run):
        return ()
    spans, marks = spans_of(viewed.run), marks_of(viewed.run)
    return with_curves(
        Panel("contact", "force", "size of force", "N", _each(viewed, others, _force), (), spans, marks),
        Panel("contact", "depth", "depth of the hand", "m", _each(viewed, others, _depth), (), spans, marks),
    )


def _each(viewed: Viewed, others: Sequence[Viewed], values: Callable[[Run, str], Array]) -> tuple[Curve, ...]:
    """Return a curve for each surface, and those of the compared runs that have one of that name."""
    names = touched(viewed.run)
    return curves(
        *(_of(viewed.run, name, name, surface_role(k), values) for k, name in enumerate(names)),
        *(
            _of(other.run, name, f"{name}, {other.label}", other_role(k), values)
            for k, other in enumerate(others)
            for name in names
            if name in touched(other.run)
        ),
    )


def _of(run: Run, name: str, label: str, role: str, values: Callable[[Run, str], Array]) -> Curve | None:
    return curve(run, label, role, lambda: values(run, name))


def _force(run: Run, name: str) -> Array:
    """Return the size of the force [N]."""
    with np.errstate(over="ignore"):  # of a strange file
        size: Array = np.linalg.norm(run[f"{name}_force"], axis=1)
    return size


def _depth(run: Run, name: str) -> Array:
    """Return the depth [m]; 0 where they are apart, by however much."""
    return np.maximum(run[f"{name}_depth"], 0)
