"""Where the end effector is, and where it should be: against reference, ideal and other runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from passiflex.diagrams.events import marks_of, spans_of
from passiflex.diagrams.panel import Array, Curve, Panel
from passiflex.diagrams.viewed import Viewed, curve, curves, first_finite, roles_of, with_curves
from passiflex.runs.run import Run

SAME = 1e-9
"""A reference in force that is never further than this [m] from x_d was never held back."""


def tracking_panels(viewed: Viewed, others: Sequence[Viewed] = ()) -> tuple[Panel, ...]:
    """Return X, Y, Z as displacement from the start, the distance to the reference, and the angle to it."""
    run = viewed.run
    spans, marks = spans_of(run), marks_of(run)
    all_runs = tuple(zip((viewed, *others), roles_of(viewed, others), strict=True))
    shown = [
        (axis, f"{axis.upper()} displacement", "m", _along(viewed, i, all_runs))
        for i, axis in enumerate("xyz")
    ]
    ideal = curve(run, "ideal MSD, ζ = 0.7", "msd", lambda: _length(_ideal_error(viewed)))
    distances = [_distance(*pair) for pair in all_runs]
    shown.append(("distance", "distance to the reference", "m", curves(*distances, ideal)))
    if _orients(run):
        angles = curves(*(_angle(*pair) for pair in all_runs))
        shown.append(("orientation", "angle to the reference", "rad", angles))
    return with_curves(
        *(
            Panel("tracking", choice, title, unit, found, (), spans, marks)
            for choice, title, unit, found in shown
        )
    )


def orientation_error(rotation: Array, desired: Array) -> Array:
    """Return the angle between two orientations [rad], (N,), from matrices (N, 3, 3); exact near 0 as well.

    From sine and cosine together: the cosine alone, (tr R − 1) / 2, loses half the digits near 0.
    """
    R = np.swapaxes(rotation, 1, 2) @ desired
    skew = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    angle: Array = np.arctan2(_length(skew) / 2, (np.trace(R, axis1=1, axis2=2) - 1) / 2)
    return angle


def _along(viewed: Viewed, i: int, all_runs: Sequence[tuple[Viewed, str]]) -> tuple[Curve, ...]:
    run = viewed.run
    return curves(
        curve(run, "reference x_d", "reference", lambda: _from_start(run, "desired_position")[:, i]),
        curve(run, "reference in force", "governed", lambda: _governed(run)[:, i]),
        *(_moved(one, role, i) for one, role in all_runs),
        curve(run, "ideal MSD, ζ = 0.7", "msd", lambda: _ideal(viewed)[:, i]),
    )


def _moved(viewed: Viewed, role: str, i: int) -> Curve | None:
    return curve(viewed.run, viewed.label, role, lambda: _from_start(viewed.run, "position")[:, i])


def _distance(viewed: Viewed, role: str) -> Curve | None:
    run = viewed.run
    return curve(run, viewed.label, role, lambda: _length(run["position"] - run["desired_position"]))


def _angle(viewed: Viewed, role: str) -> Curve | None:
    run = viewed.run
    return curve(run, viewed.label, role, lambda: orientation_error(run["rotation"], run["desired_rotation"]))


def _from_start(run: Run, signal: str) -> Array:
    """Return a position as seen from where the end effector was at the start, (N, 3) m."""
    return run[signal] - first_finite(run["position"])


def _governed(run: Run) -> Array:
    """Return the reference in force; nothing finite where it never differs from x_d, which then stands for both."""
    held = run["governed_position"]
    apart = np.abs(held - run["desired_position"])
    return _from_start(run, "governed_position") if (apart > SAME).any() else np.full_like(held, np.nan)


def _ideal(viewed: Viewed) -> Array:
    return np.full((viewed.run.time.size, 3), np.nan) if viewed.ideal is None else viewed.ideal


def _ideal_error(viewed: Viewed) -> Array:
    wished = viewed.run["desired_position"]
    return _ideal(viewed) - (wished - first_finite(wished))


def _length(vectors: Array) -> Array:
    return np.asarray(np.linalg.norm(vectors, axis=1), dtype=np.float64)


def _orients(run: Run) -> bool:
    """Return whether the orientation is controlled: a position task leaves it to the null space."""
    scenario = run.scenario
    return scenario is None or scenario.law.task == "pose"
