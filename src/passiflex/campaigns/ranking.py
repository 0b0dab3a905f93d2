"""Which samples are the worst."""

from __future__ import annotations

import math
from collections.abc import Iterable

from passiflex.metrics.measures import MEASURES


def worst_first(measure: str, values: Iterable[float | None], failures: Iterable[str]) -> list[int]:
    """Return the places of samples from the worst by a measure to the best; of equals, the earlier is first.

    Runs that left the finite numbers come before all others, also where the measure is no number for them;
    of the others those without a number are left out.
    """
    sign = 1.0 if MEASURES[measure].worst == "low" else -1.0
    ranked = []
    for i, (value, failure) in enumerate(zip(values, failures, strict=True)):
        known = value is not None and not math.isnan(value)
        if known or failure:
            ranked.append((not failure, sign * value if known and value is not None else -math.inf, i))
    return [i for *_, i in sorted(ranked)]
