"""What the rows of a campaign say: shares, quantiles, which parameters matter, and the worst samples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from passiflex.campaigns.campaign import Campaign
from passiflex.campaigns.draws import columns, words
from passiflex.campaigns.evaluate import REFUSED
from passiflex.campaigns.importance import Association, Column, associations
from passiflex.campaigns.intervals import Quantile, Share, quantile_of, require_level, share_of
from passiflex.campaigns.ranking import worst_first
from passiflex.campaigns.samples import Values
from passiflex.errors import NameUnknownError
from passiflex.metrics.measures import MEASURES
from passiflex.metrics.steps import step_window

Array = NDArray[np.float64]

PROBABILITIES = (0.05, 0.25, 0.5, 0.75, 0.95)
VERDICTS = ("passive", "violated", "inconclusive")
OF_INTEREST = (
    "margin", "contact_force_peak", "overshoot", "settling_time", "torque_share", "rms_to_msd", "tank_energy_min",
)  # fmt: skip
"""Metrics for which it is asked what they hang on, unless the caller names others."""


class Spread(NamedTuple):
    """The quantiles of a metric over its finite values, and how many were not finite."""

    metric: str
    unit: str
    finite: int
    not_finite: int
    quantiles: tuple[Quantile, ...]


class WorstSample(NamedTuple):
    """A sample at the bad end of a metric, with what was drawn for it by parameter; one value per joint is a tuple."""

    sample: int
    value: float
    verdict: str
    draws: Values


@dataclass(frozen=True)
class Statistics:
    """The statistics of a campaign; `campaign_tables` of the command line show them.

    Attributes
    ----------
    name, sampling: Of the campaign.
    samples: Number of rows; of those `refused` were no possible robot or scenario, and are not counted in anything
        but their own share, which is of all rows.
    level: Of all intervals, each by itself.
    shares: By name: refused; passive, violated, inconclusive; settled (within 2 %, where there is a step); fell_back.
    spreads: By metric.
    associations: By metric, then by column of the draws.
    by, worst: The worst samples by this metric, the worst first.
    """

    name: str
    sampling: str
    samples: int
    refused: int
    level: float
    shares: tuple[Share, ...]
    spreads: tuple[Spread, ...]
    associations: tuple[Association, ...]
    by: str
    worst: tuple[WorstSample, ...]

    @property
    def conditions(self) -> str:
        """Return what the numbers are of, and what the intervals take for granted."""
        text = f"{self.samples} samples, {self.sampling}; {self.refused} refused, in no other number"
        held = f"{text}; intervals of {100 * self.level:.4g} % for independent samples"
        return held if self.sampling == "random" else f"{held}, rather too wide for these"

    def share(self, name: str) -> Share:
        """Return a share by its name.

        Raises
        ------
        NameUnknownError
            If the rows do not tell.
        """
        found = {share.name: share for share in self.shares}
        if name not in found:
            raise NameUnknownError("share", name, found)
        return found[name]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; a number that is not finite becomes None."""
        data: dict[str, Any] = _plain(
            asdict(self)
            | {
                "conditions": self.conditions,
                "shares": [s._asdict() for s in self.shares],
                "spreads": [
                    s._asdict() | {"quantiles": [q._asdict() for q in s.quantiles]} for s in self.spreads
                ],
                "associations": [
                    a._asdict() | {"first_order": a.first_order and a.first_order._asdict()}
                    for a in self.associations
                ],
                "worst": [w._asdict() for w in self.worst],
            }
        )
        return data


def statistics(
    campaign: Campaign,
    rows: pa.Table,
    *,
    level: float = 0.95,
    metrics: Sequence[str] | None = None,
    worst: int = 5,
    by: str | None = None,
) -> Statistics:
    """Return the statistics of the rows of a campaign, which need not be all of its samples.

    Parameters
    ----------
    rows: As `stored_rows.read_rows` gives them.
    level: Of the intervals.
    metrics: For which it is asked what they hang on; those of `OF_INTEREST` that were kept, if left out.
    worst: How many of the worst samples.
    by: Metric by which they are the worst; the campaign's `keep.by`, or else the margin, if left out.

    Raises
    ------
    NameUnknownError
        For a metric that was not kept.
    ValueRangeError
        For a level that is none.
    """
    require_level(level)
    kept = [name for name in MEASURES if name in rows.column_names]
    if rows.num_rows:
        for name in (*(metrics or ()), *((by,) if by else ())):
            if name not in kept:
                raise NameUnknownError("metric that was kept", name, kept)
    verdicts = np.array(rows["verdict"].to_pylist() if rows.num_rows else [], dtype=object)
    run = verdicts != REFUSED
    numbers = {name: numbers_of(rows, name)[run] for name in kept}
    drawn = [c._replace(values=c.values[run]) for c in drawn_columns(campaign, rows)]
    by = by or campaign.keep.by or ("margin" if "margin" in kept or not kept else kept[0])
    asked = metrics or [name for name in OF_INTEREST if name in kept] or kept
    return Statistics(
        name=campaign.name,
        sampling=campaign.sampling,
        samples=rows.num_rows,
        refused=int((~run).sum()),
        level=level,
        shares=tuple(_shares(campaign, verdicts, numbers, level)),
        spreads=tuple(_spread(name, values, level) for name, values in numbers.items()),
        associations=tuple(
            a
            for name in asked
            if name in numbers
            for a in associations(name, numbers[name], drawn, level, campaign.seed)
        ),
        by=by,
        worst=tuple(_worst(rows, run, numbers[by], drawn, by, worst)) if by in numbers else (),
    )


def numbers_of(rows: pa.Table, name: str) -> Array:
    """Return a column of numbers; what is missing is NaN."""
    return np.asarray(rows[name].cast(pa.float64()).to_numpy(), dtype=float)


def drawn_columns(campaign: Campaign, rows: pa.Table) -> list[Column]:
    """Return what was drawn, as it stands in the rows."""
    if not rows.num_rows:
        return []
    known, names, found = words(campaign), iter(columns(campaign)), []
    for path, parameter in campaign.parameters.items():
        for joint in range(1, campaign.joints + 1) if parameter.per else (None,):
            name = next(names)
            own = known.get(path, ())
            values = (
                np.array([own.index(word) for word in rows[name].to_pylist()], dtype=float)
                if own
                else numbers_of(rows, name)
            )
            found.append(Column(name, path, joint, own, values))
    return found


def _shares(
    campaign: Campaign, verdicts: NDArray[np.object_], numbers: dict[str, Array], level: float
) -> list[Share]:
    refused = int((verdicts == REFUSED).sum())
    of = verdicts.size - refused
    counts = {verdict: int((verdicts == verdict).sum()) for verdict in VERDICTS}
    if "settling_time" in numbers and step_window(campaign.scenario) is not None:
        counts["settled"] = int(np.isfinite(numbers["settling_time"]).sum())
    if "fell_back_at" in numbers and campaign.scenario.control is not None:
        counts["fell_back"] = int(np.isfinite(numbers["fell_back_at"]).sum())
    return [
        share_of(REFUSED, refused, verdicts.size, level),
        *(share_of(name, count, of, level) for name, count in counts.items()),
    ]


def _spread(name: str, values: Array, level: float) -> Spread:
    finite = np.sort(values[np.isfinite(values)])
    quantiles = tuple(quantile_of(finite, p, level) for p in PROBABILITIES)
    return Spread(name, MEASURES[name].unit, finite.size, values.size - finite.size, quantiles)


def _worst(
    rows: pa.Table, run: NDArray[np.bool_], values: Array, drawn: list[Column], by: str, count: int
) -> list[WorstSample]:
    """Return the worst first, as `worst_first` ranks them."""
    which = np.flatnonzero(run)
    verdicts, failures = (rows[name].to_pylist() for name in ("verdict", "failure"))
    index = rows["sample"].to_pylist()
    ranked = worst_first(by, values.tolist(), [failures[k] for k in which])
    return [
        WorstSample(
            index[which[i]],
            float(values[i]),
            verdicts[which[i]],
            _drawn(drawn, i),
        )
        for i in ranked[:count]
    ]


def _drawn(columns: list[Column], i: int) -> Values:
    found: Values = {}
    for c in columns:
        value = c.words[int(c.values[i])] if c.words else float(c.values[i])
        before = found.get(c.parameter, ())
        found[c.parameter] = value if c.joint is None else (*before, value)  # type: ignore[misc]
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
