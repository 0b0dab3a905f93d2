"""The numbers of a campaign's page of figures, ready to be drawn."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from passiflex.campaigns.campaign import Campaign
from passiflex.campaigns.distributions import LogUniform
from passiflex.campaigns.evaluate import REFUSED
from passiflex.campaigns.importance import Association, Index
from passiflex.campaigns.intervals import Share
from passiflex.campaigns.statistics import Statistics, drawn_columns, numbers_of
from passiflex.control.gain_design import target_inertia
from passiflex.metrics.closed_form import ideal_displacement
from passiflex.metrics.measures import IDEAL_RATIO, MEASURES
from passiflex.metrics.steps import step_window
from passiflex.simulation import resolve

Array = NDArray[np.float64]

DISTRIBUTIONS = ("margin", "contact_force_peak", "overshoot", "settling_time", "torque_share")
"""Metrics whose distributions are drawn, of those that were kept; those of a step only where there is one."""
OF_STEP = ("overshoot", "settling_time")
MOST_METRICS, MOST_COLUMNS = 3, 14
"""Of the bars: metrics beside each other, and parameters below each other."""
BESIDE = 0.25
"""How far from the index of a word its points lie, at most."""
GOLDEN = (5**0.5 - 1) / 2
"""Multiples of it, without their whole parts, are evenly spread."""
BAND = (0.05, 0.25, 0.5, 0.75, 0.95)


class Ecdf(NamedTuple):
    """An empirical distribution: the share of samples at or below each value.

    Attributes
    ----------
    endless: Share of samples whose value is not finite; the curve ends that far below one, or above zero.
    """

    metric: str
    unit: str
    values: Array
    shares: Array
    endless: float


class Band(NamedTuple):
    """Displacement along the step [m] over time [s]: its quantiles (5, times) over the runs that still run."""

    time: Array
    quantiles: Array


class Bars(NamedTuple):
    """How much a metric hangs on some columns, which all bars share: −1 to 1, or 0 to 1 for words."""

    metric: str
    strengths: Array
    signed: NDArray[np.bool_]
    significant: NDArray[np.bool_]
    first_order: Array
    """Square root of the share of the variance that hangs on the column alone; NaN where it cannot be had."""


class Scatter(NamedTuple):
    """A metric against one column; of words x is the index, and the points of a word lie beside each other.

    What is drawn evenly in its logarithm is `logarithmic`.
    """

    parameter: str
    words: tuple[str, ...]
    x: Array
    metric: str
    y: Array
    verdicts: NDArray[np.str_]
    logarithmic: bool = False


class Page(NamedTuple):
    """What is drawn of a campaign.

    Attributes
    ----------
    columns: Labels of the bars, the most important first.
    chance: Largest p-value that counts as more than chance.
    band, scatter: None where there is nothing to show.
    """

    title: str
    conditions: str
    shares: tuple[Share, ...]
    distributions: tuple[Ecdf, ...]
    band: Band | None
    columns: tuple[str, ...]
    bars: tuple[Bars, ...]
    chance: float
    scatter: Scatter | None


def page(
    campaign: Campaign, rows: pa.Table, found: Statistics, blocks: Iterable[pa.Table] | None = None
) -> Page:
    """Return the page of a campaign's rows and their statistics.

    Parameters
    ----------
    blocks: Of the verdicts and responses, which are wide, if the rows come without them.
    """
    run = np.array([v != REFUSED for v in rows["verdict"].to_pylist()] if rows.num_rows else [], dtype=bool)
    chance, stepped = 1 - found.level, step_window(campaign.scenario) is not None
    columns, bars = _bars(campaign, found, chance)
    return Page(
        title=f"{campaign.name}: {found.samples} samples",
        conditions=found.conditions,
        shares=found.shares,
        distributions=tuple(
            _ecdf(name, numbers_of(rows, name)[run])
            for name in DISTRIBUTIONS
            if name in rows.column_names and (stepped or name not in OF_STEP)
        ),
        band=_band(campaign, [rows] if blocks is None else blocks),
        columns=columns,
        bars=bars,
        chance=chance,
        scatter=_scatter(campaign, rows, run, found),
    )


def ideal_along(campaign: Campaign) -> tuple[Array, Array] | None:
    """Return time [s] and displacement [m] along the step of the ideal mass-spring-damper.

    None without a step, and where something touches the robot.
    """
    scenario, window = campaign.scenario, step_window(campaign.scenario)
    if window is None or scenario.environment:
        return None
    problem = resolve(scenario)
    gains = problem.law.layout.unpack(problem.gains)
    stiffness, damping = gains["stiffness"], gains["damping"]
    inertia = target_inertia(stiffness, damping, IDEAL_RATIO)
    interval = campaign.keep.response or scenario.output_interval
    count = int(scenario.duration / interval + 1e-9) + 1
    moved = ideal_displacement(inertia, stiffness, damping, problem.events, interval, count)
    return np.arange(count, dtype=np.float64) * interval, moved @ window.direction


def label(campaign: Campaign, parameter: str, joint: int | None = None) -> str:
    """Return a short name of a parameter: its last part where that says which, and the joint."""
    last = parameter.rpartition(".")[2]
    others = [path for path in campaign.parameters if path != parameter]
    clear = not last.isdigit() and all(path.rpartition(".")[2] != last for path in others)
    name = last.replace("_", " ") if clear else parameter
    return name if joint is None else f"{name}, joint {joint}"


def _ecdf(name: str, values: Array) -> Ecdf:
    known = values[~np.isnan(values)]
    finite = np.sort(known[np.isfinite(known)])
    below = int((known == -math.inf).sum())
    shares = (below + np.arange(1, finite.size + 1)) / max(known.size, 1)
    endless = 1 - finite.size / values.size if values.size else math.nan
    return Ecdf(name, MEASURES[name].unit, finite, shares, endless)


def _band(campaign: Campaign, blocks: Iterable[pa.Table]) -> Band | None:
    window, interval = step_window(campaign.scenario), campaign.keep.response
    if window is None or interval is None:
        return None
    moved = [_along(block, window.direction) for block in blocks if block.num_rows]
    along = np.concatenate(moved) if moved else np.zeros((0, 0), np.float32)
    if not along.size:
        return None
    going = ~np.isnan(along).all(axis=0)
    time: Array = np.arange(along.shape[1], dtype=np.float64) * interval
    quantiles: Array = np.asarray(np.nanquantile(along[:, going], BAND, axis=0), dtype=np.float64)
    return Band(time[going], quantiles)


def _along(block: pa.Table, direction: Array) -> NDArray[np.float32]:
    """Return the displacement along the step (samples, instants) of those that ran, in single precision."""
    ran = block.filter(pc.not_equal(block["verdict"], REFUSED))
    out: Any = np.float32(0)
    for axis, share in zip("xyz", direction, strict=True):
        flat = ran[f"displacement_{axis}"].combine_chunks().flatten().to_numpy(zero_copy_only=False)
        out = out + np.float32(share) * flat.astype(np.float32).reshape(ran.num_rows, -1)
    return np.asarray(out, dtype=np.float32)


def _bars(campaign: Campaign, found: Statistics, chance: float) -> tuple[tuple[str, ...], tuple[Bars, ...]]:
    by_metric: dict[str, dict[str, Association]] = {}
    for a in found.associations:
        by_metric.setdefault(a.metric, {})[a.column] = a
    metrics = [m for m, of in by_metric.items() if any(math.isfinite(a.strength) for a in of.values())]
    shown = {m: by_metric[m] for m in metrics[:MOST_METRICS]}
    if not shown:
        return (), ()
    first = next(iter(shown.values()))
    names = sorted(first, key=lambda c: -_strongest([of[c] for of in shown.values()]))[:MOST_COLUMNS]
    bars = tuple(
        Bars(
            metric,
            np.array([of[c].strength for c in names]),
            np.array([of[c].test == "spearman" for c in names]),
            np.array([of[c].adjusted <= chance for c in names]),
            np.array([_root(of[c].first_order) for c in names]),
        )
        for metric, of in shown.items()
    )
    return tuple(label(campaign, first[c].parameter, first[c].joint) for c in names), bars


def _strongest(of: Sequence[Association]) -> float:
    return max(a.weight for a in of)


def _root(index: Index | None) -> float:
    return math.nan if index is None else math.sqrt(max(index.value, 0.0))


def _scatter(campaign: Campaign, rows: pa.Table, run: NDArray[np.bool_], found: Statistics) -> Scatter | None:
    """Return the metric by which samples are the worst against what it hangs on most."""
    of = [a for a in found.associations if a.metric == found.by and math.isfinite(a.strength)]
    if not of:
        return None
    best = max(of, key=lambda a: a.weight)
    column = next(c for c in drawn_columns(campaign, rows) if c.name == best.column)
    quantity = campaign.targets[best.parameter].quantity
    unit = f" [{quantity.unit or 'SI'}]" if quantity and quantity.unit != "1" else ""
    return Scatter(
        label(campaign, best.parameter, best.joint) + unit,
        column.words,
        column.values[run] + (_beside(int(run.sum())) if column.words else 0.0),
        found.by,
        numbers_of(rows, found.by)[run],
        np.array(rows["verdict"].to_pylist())[run],
        isinstance(campaign.parameters[best.parameter], LogUniform),
    )


def _beside(count: int) -> Array:
    """Return even offsets, so that points of the same word do not hide each other."""
    return np.array([BESIDE * (2 * (i * GOLDEN % 1) - 1) for i in range(count)])
