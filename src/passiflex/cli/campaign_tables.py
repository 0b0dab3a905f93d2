"""The tables of `passiflex campaign` and `passiflex search`."""

from __future__ import annotations

import math

from rich.table import Column, Table
from rich.text import Text

from passiflex.campaigns.found import Found
from passiflex.campaigns.importance import Association, Index
from passiflex.campaigns.samples import Values
from passiflex.campaigns.statistics import Statistics
from passiflex.metrics.measures import with_unit

MOST = 5
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
    """Return the quantiles of each metric, with the interval of the median; statistics.json has more of them."""
    table = _table(
        "metric", "5 %", "median", _level(found), "95 %", "n/a", title="quantiles of the finite values",
        caption=f"{_level(found)}: of the median; n/a: samples without a finite value",
    )  # fmt: skip
    for spread in found.spreads:
        none = str(spread.not_finite or "")
        if not spread.finite:
            table.add_row(with_unit(spread.metric), *[""] * 4, none)
            continue
        low, _, median, _, high = spread.quantiles
        interval = f"{median.low:.3g} – {median.high:.3g}"
        numbers = [f"{q.value:.3g}" for q in (low, median, high)]
        table.add_row(with_unit(spread.metric), *numbers[:2], interval, numbers[2], none)
    return table


def importance_table(found: Statistics, most: int = MOST) -> Table:
    """Return what each metric hangs on, the strongest first."""
    table = _table(
        "parameter, joint", "rank corr.", "p, Holm", "first order", title="what matters",
        caption="rank correlation: Spearman's; of words √(H/(n − 1)) by Kruskal and Wallis, without a sign\n"
        f"first order: share of the variance, with its {_level(found)}",
    )  # fmt: skip
    for metric in dict.fromkeys(a.metric for a in found.associations):
        of = [a for a in found.associations if a.metric == metric and not math.isnan(a.strength)]
        ranked = sorted(of, key=lambda a: -a.weight)
        heading = Text.assemble((with_unit(metric), "bold"), "" if ranked else ": nothing that varies")
        table.add_row(heading)
        for a in ranked[:most]:
            table.add_row(*_association(a))
        if len(ranked) > most:
            table.add_row(f"  and {len(ranked) - most} that matter less")
    return table


def worst_table(found: Statistics) -> Table:
    """Return the worst samples with what was drawn for them."""
    drawn = Column("drawn", overflow="fold")
    table = Table("sample", with_unit(found.by), "verdict", drawn, title=f"the worst by {found.by}")
    for worst in found.worst:
        table.add_row(str(worst.sample), f"{worst.value:.5g}", worst.verdict, _listed(worst.draws))
    return table


def found_table(found: Found) -> Table:
    """Return the worst cases of a search."""
    refused = f", {found.refused} of them impossible" if found.refused else ""
    table = Table(
        "file", with_unit(found.measure), "verdict", Column("values", overflow="fold"),
        title=f"the worst by {found.measure}", caption=f"{found.evaluations} simulations{refused}",
    )  # fmt: skip
    for i, case in enumerate(found.cases):
        number, verdict = _value(case.measures[found.measure]), str(case.measures["verdict"])
        if case.measures["failure"]:
            verdict += f", diverged at {case.measures['end_time']:g} s"
        table.add_row(f"worst_{i + 1}.yaml", number, verdict, _listed(case.values))
    return table


def _table(*columns: str, title: str, caption: str) -> Table:
    """Return a narrow table whose cells stay on one line."""
    return Table(
        *(Column(c, no_wrap=True) for c in columns), title=title, caption=caption, box=None, pad_edge=False
    )  # fmt: skip


def _association(a: Association) -> list[str]:
    name = f"  {a.parameter}" + (f", {a.joint}" if a.joint else "")
    strength = f"{a.strength:+.2f}" if a.test == "spearman" else f"{a.strength:.2f}"
    return [name, strength, f"{a.adjusted:.1g}", _index(a.first_order)]


def _index(index: Index | None) -> str:
    return "" if index is None else f"{index.value:.2f} ({index.low:.2f} – {index.high:.2f})"


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
    return f"{100 * found.level:.4g} % interval"
