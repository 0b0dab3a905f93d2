"""The tables of `passiflex campaign` and `passiflex search`."""

from __future__ import annotations

import math

from rich.table import Table

from passiflex.campaigns.found import Found
from passiflex.campaigns.importance import Association, Index
from passiflex.campaigns.measures import MEASURES
from passiflex.campaigns.samples import Values
from passiflex.campaigns.statistics import Statistics

MOST = 8
"""Rows for each metric of what it hangs on."""
MOST_VALUES = 12
"""Parameters of the worst that are listed; the files have them all."""


def statistics_tables(found: Statistics) -> tuple[Table, ...]:
    """Return all tables of a campaign's statistics."""
    tables = [share_table(found), quantile_table(found)]
    if found.associations:
        tables.append(importance_table(found))
    if found.worst:
        tables.append(worst_table(found))
    return tuple(tables)


def share_table(found: Statistics) -> Table:
    """Return how often what occurred."""
    table = Table("", "samples", "share", _level(found), title=found.name, caption=found.conditions)
    for s in found.shares:
        share = "none" if math.isnan(s.share) else f"{s.share:.2%}"
        table.add_row(s.name.replace("_", " "), f"{s.count} of {s.of}", share, f"{s.low:.2%} to {s.high:.2%}")
    return table


def quantile_table(found: Statistics) -> Table:
    """Return the quantiles of each metric, with the interval of the median."""
    table = Table(
        "metric", "5 %", "25 %", "median", _level(found), "75 %", "95 %", "not finite",
        title="quantiles of the finite values",
    )  # fmt: skip
    for spread in found.spreads:
        if not spread.finite:
            table.add_row(_named(spread.metric), *[""] * 6, str(spread.not_finite))
            continue
        low, lower, median, upper, high = spread.quantiles
        interval = f"{median.low:.3g} to {median.high:.3g}"
        numbers = [f"{q.value:.4g}" for q in (low, lower, median)]
        table.add_row(
            _named(spread.metric), *numbers, interval, f"{upper.value:.4g}", f"{high.value:.4g}",
            str(spread.not_finite or ""),
        )  # fmt: skip
    return table


def importance_table(found: Statistics, most: int = MOST) -> Table:
    """Return what each metric hangs on, the strongest first."""
    table = Table(
        "metric", "parameter", "joint", "rank correlation", "p, Holm", "first-order index", _level(found),
        title="what matters",
        caption="rank correlation: Spearman's; of words √(H/(n − 1)) by Kruskal and Wallis, without a sign",
    )  # fmt: skip
    for metric in dict.fromkeys(a.metric for a in found.associations):
        of = [a for a in found.associations if a.metric == metric and not math.isnan(a.strength)]
        ranked = sorted(of, key=lambda a: -abs(a.strength))
        for i, a in enumerate(ranked[:most]):
            table.add_row(_named(metric) if i == 0 else "", *_association(a), end_section=i == len(of) - 1)
        if len(ranked) > most:
            table.add_row("", f"and {len(ranked) - most} that matter less", end_section=True)
        if not ranked:
            table.add_row(_named(metric), "nothing that varies", end_section=True)
    return table


def worst_table(found: Statistics) -> Table:
    """Return the worst samples with what was drawn for them."""
    table = Table("sample", _named(found.by), "verdict", "drawn", title=f"the worst by {found.by}")
    for worst in found.worst:
        table.add_row(str(worst.sample), f"{worst.value:.5g}", worst.verdict, _listed(worst.draws))
    return table


def found_table(found: Found) -> Table:
    """Return the worst cases of a search."""
    refused = f", {found.refused} of them impossible" if found.refused else ""
    table = Table(
        "file", _named(found.measure), "verdict", "values",
        title=f"the worst by {found.measure}", caption=f"{found.evaluations} simulations{refused}",
    )  # fmt: skip
    for i, case in enumerate(found.cases):
        number, verdict = _value(case.measures[found.measure]), str(case.measures["verdict"])
        if case.measures["failure"]:
            verdict += f", diverged at {case.measures['end_time']:g} s"
        table.add_row(f"worst_{i + 1}.yaml", number, verdict, _listed(case.values))
    return table


def _association(a: Association) -> list[str]:
    strength = f"{a.strength:+.3f}" if a.test == "spearman" else f"{a.strength:.3f}"
    return [a.parameter, str(a.joint or ""), strength, f"{a.adjusted:.2g}", *_index(a.first_order)]


def _index(index: Index | None) -> list[str]:
    return ["", ""] if index is None else [f"{index.value:.3f}", f"{index.low:.3f} to {index.high:.3f}"]


def _listed(values: Values) -> str:
    lines = [
        f"{path} " + (", ".join(map(_value, v)) if isinstance(v, tuple) else _value(v))
        for path, v in values.items()
    ]
    more = [f"and {len(lines) - MOST_VALUES} more"] if len(lines) > MOST_VALUES else []
    return "\n".join([*lines[:MOST_VALUES], *more])


def _value(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _level(found: Statistics) -> str:
    return f"{found.level:.4g} interval"


def _named(metric: str) -> str:
    unit = MEASURES[metric].unit
    return metric.replace("_", " ") + ("" if unit == "1" else f" [{unit}]")
