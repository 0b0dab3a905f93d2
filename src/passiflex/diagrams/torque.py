"""The torques of the joints, against what the motors bear."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from passiflex.diagrams.events import marks_of, spans_of
from passiflex.diagrams.panel import Array, Curve, Level, Panel
from passiflex.diagrams.viewed import Viewed, curve, curves, other_role, with_curves
from passiflex.runs.run import Run
from passiflex.runs.run_arm import chain_of

JOINT_LOOKS = 8
"""So many joints have a look of their own; then the looks begin again."""


def torque_panels(viewed: Viewed, others: Sequence[Viewed] = ()) -> tuple[Panel, ...]:
    """Return the motor torques as shares of their limits, and motor and joint torque joint by joint."""
    run = viewed.run
    spans, marks, limits, units = spans_of(run), marks_of(run), _limits(run), _units(run)
    shares = Panel(
        kind="torque",
        choice="all joints",
        title="motor torque, share of the limit",
        unit="1",
        curves=curves(*(_share(run, i, limit) for i, limit in enumerate(limits))),
        levels=(Level(1.0, "limit"), Level(-1.0, "limit")),
        spans=spans,
        marks=marks,
    )
    return with_curves(
        shares,
        *(
            Panel(
                kind="torque",
                choice=f"joint {i + 1}",
                title=f"{_effort(unit)}, joint {i + 1}",
                unit=unit,
                curves=_of_joint(viewed, others, i, _effort(unit)),
                levels=_levels(float(limits[i]) if i < limits.size else math.inf, unit),
                spans=spans,
                marks=marks,
            )
            for i, unit in enumerate(units)
        ),
    )


def _joints(run: Run) -> int:
    return next((run[name].shape[1] for name in ("tau_m", "tau_a") if name in run.data), 0)


def _limits(run: Run) -> Array:
    return run["torque_limit"] if "torque_limit" in run.data else np.full(_joints(run), np.inf)


def _units(run: Run) -> list[str]:
    """Return the unit of each joint's effort: N m, or N where it slides."""
    named = next((run.data[name] for name in ("torque_limit", "tau_m", "tau_a") if name in run.data), None)
    unit = "N m" if named is None else str(named.attrs.get("units", "N m"))
    chain = chain_of(run) if " or " in unit else None
    return [chain.unit_of(i, unit) if chain else unit for i in range(_joints(run))]


def _effort(unit: str) -> str:
    return "force" if unit == "N" else "torque"


def _share(run: Run, i: int, limit: float) -> Curve | None:
    """Return the share of a joint's limit; None where there is no limit to have a share of."""
    if not (math.isfinite(limit) and limit > 0):
        return None
    role = f"joint {1 + i % JOINT_LOOKS}"
    return curve(run, f"joint {i + 1}", role, lambda: run["tau_m"][:, i] / limit)


def _levels(limit: float, unit: str) -> tuple[Level, ...]:
    if not (math.isfinite(limit) and limit > 0):
        return ()
    return tuple(
        Level(sign * limit, f"limit {'+' if sign > 0 else '−'}{limit:.4g} {unit}") for sign in (1.0, -1.0)
    )


def _of_joint(viewed: Viewed, others: Sequence[Viewed], i: int, effort: str) -> tuple[Curve, ...]:
    run = viewed.run
    return curves(
        curve(run, f"motor {effort} τ_m", "motor", lambda: run["tau_m"][:, i]),
        curve(run, f"joint {effort} τ_a on the link", "joint", lambda: run["tau_a"][:, i]),
        *(_compared(other, other_role(k), i) for k, other in enumerate(others)),
    )


def _compared(other: Viewed, role: str, i: int) -> Curve | None:
    if i >= _joints(other.run):
        return None
    return curve(other.run, f"τ_m, {other.label}", role, lambda: other.run["tau_m"][:, i])
