"""A run as it is looked at, and what all its diagrams share: curves that a damaged file may lack, roles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from passiflex.diagrams.ideal import ideal_motion
from passiflex.diagrams.panel import Array, Curve, Panel
from passiflex.runs.run import Run

OTHERS = 4
"""So many compared runs have a look of their own; then the looks begin again."""


class Viewed(NamedTuple):
    """A run with its name for a reader, and the displacement of the ideal at its rows, (N, 3) m."""

    run: Run
    label: str
    ideal: Array | None = None


def viewed(runs: Sequence[Run]) -> tuple[Viewed, ...]:
    """Return runs as they are looked at: by their names, numbered where they share one; the first with its ideal."""
    names = [str(run.data.attrs.get("name", "run")) for run in runs]
    labels = [
        f"{name} ({names[: i + 1].count(name)})" if names.count(name) > 1 else name
        for i, name in enumerate(names)
    ]
    return tuple(
        Viewed(run, label, ideal_motion(run) if i == 0 else None)
        for i, (run, label) in enumerate(zip(runs, labels, strict=True))
    )


def other_role(k: int) -> str:
    """Return the role of the compared run `k`, counted from 0."""
    return f"other {1 + k % OTHERS}"


def roles_of(viewed: Viewed, others: Sequence[Viewed] = ()) -> tuple[str, ...]:
    """Return the role of each run's end effector: by its law as in the paper, each look once."""
    roles = [_natural(viewed.run)]
    for other in others:
        natural, taken = _natural(other.run), sum(role.startswith("other") for role in roles)
        roles.append(other_role(taken) if natural in roles else natural)
    return tuple(roles)


def curves(*found: Curve | None) -> tuple[Curve, ...]:
    """Return those that are there."""
    return tuple(curve for curve in found if curve is not None)


def curve(run: Run, label: str, role: str, values: Callable[[], Array]) -> Curve | None:
    """Return a curve over the rows of a run; None if signals of it are not in the file, or nothing in it is finite."""
    try:
        drawn = np.asarray(values(), dtype=np.float64)
    except KeyError:  # how a run says that it has no signal of this name
        return None
    return Curve(label, role, run.time, drawn) if np.isfinite(drawn).any() else None


def with_curves(*found: Panel) -> tuple[Panel, ...]:
    """Return the panels that have something to show."""
    return tuple(panel for panel in found if panel.curves)


def first_finite(signal: Array) -> Array:
    """Return the first row that is finite, the row of a signal (N, k) at the start; not finite if there is none."""
    whole = np.isfinite(signal).all(axis=1)
    row: Array = signal[int(whole.argmax())]
    return row


def _natural(run: Run) -> str:
    return "baseline" if str(run.data.attrs.get("law", "")).startswith("Rigid") else "proposed"
