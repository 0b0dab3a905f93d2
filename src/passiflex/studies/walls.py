"""Walls of which neither place nor stiffness is known: how hard a hand hits them, as a campaign says it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.campaigns import Campaign, run_campaign
from passiflex.campaigns.evaluate import run_sample
from passiflex.campaigns.intervals import Quantile, Share, quantile_of, share_of
from passiflex.campaigns.statistics import numbers_of
from passiflex.files import require_writable
from passiflex.plotting.walls import Decade, draw_walls
from passiflex.studies.hands import LIMITS
from passiflex.studies.paper import Report, shipped_scenario
from passiflex.studies.written import Written, write_study

Array = NDArray[np.float64]

SAMPLES = 300
LEVEL = 0.95
"""Of the intervals."""
EXPONENTS = (3, 4, 5, 6)
"""Ends of the decades of stiffness, 10ⁿ N/m."""
NEAR, FAR = -0.04, -0.20
"""Where the wall may be along z, from where the hand starts [m]; the hand's radius is nearer."""
STIFFNESS, PLACE, PEAK = "environment.1.stiffness", "environment.1.point.3", "contact_force_peak"
KEPT = (PEAK, "contact_energy", "contact_bounces", "contact_impulse", "margin", "governed_share")


class Walls(NamedTuple):
    """What is said of some walls.

    Attributes
    ----------
    passive, below: Shares: of passive runs, and of peaks below each of `LIMITS`.
    median, high: Quantiles of the peak force [N], of a half and of nineteen of twenty.
    """

    passive: Share
    below: tuple[Share, ...]
    median: Quantile
    high: Quantile


def campaign(samples: int = SAMPLES) -> Campaign:
    """Return the campaign: the hand goes 20 cm in 0.8 s, and somewhere on its way is a wall."""
    scenario = shipped_scenario("contact").changed(
        {
            "name": "wall",
            "description": "a hand comes to a wall of which neither place nor stiffness is known",
            "reference": [{"at": 0.1, "kind": "move", "by": [0, 0, -0.2], "duration": 0.8}],
            "duration": 2.0,
        }
    )
    low, high = (10.0 ** EXPONENTS[k] for k in (0, -1))
    return Campaign.model_validate(
        {
            "name": "walls",
            "scenario": scenario,
            "samples": samples,
            "parameters": {
                STIFFNESS: {"distribution": "log_uniform", "low": low, "high": high},
                PLACE: {"distribution": "uniform", "low": FAR, "high": NEAR},
            },
            "keep": {"metrics": KEPT, "worst": 1, "by": PEAK},
        }
    )


def told(passive: NDArray[np.bool_], peak: Array) -> Walls:
    """Return what is said of some walls, by the verdict and the peak force of each."""
    return Walls(
        share_of("passive", int(passive.sum()), passive.size, LEVEL),
        tuple(
            share_of(f"below {limit:g} N", int((peak < limit).sum()), peak.size, LEVEL) for limit in LIMITS
        ),
        quantile_of(np.sort(peak), 0.5, LEVEL),
        quantile_of(np.sort(peak), 0.95, LEVEL),
    )


def reproduce_walls(folder: Path, report: Report = lambda text: None, samples: int = SAMPLES) -> Written:
    """Run the campaign, write its figure, page and table; return the paths, and the part of the summary."""
    require_writable(folder)
    asked = campaign(samples)
    report(f"walls: {samples} of them")
    rows = run_campaign(asked, folder / "walls", workers=0).narrow_rows()
    stiffness, place, peak = (numbers_of(rows, name) for name in (STIFFNESS, PLACE, PEAK))
    passive = np.array(rows["verdict"].to_pylist()) == "passive"
    numbers: dict[str, Any] = {}
    decades = []
    table = [
        [
            "stiffness",
            "walls",
            "passive",
            "median peak",
            "19 of 20 below",
            *(f"below {limit:g} N" for limit in LIMITS),
        ]
    ]
    ends = [(low, low + 1) for low in EXPONENTS[:-1]] + [(EXPONENTS[0], EXPONENTS[-1])]
    for low, high in ends:
        here = (np.log10(stiffness) >= low) & (np.log10(stiffness) < high)
        found = told(passive[here], peak[here])
        name = f"1e{low} to 1e{high} N/m"
        numbers[name.replace(" ", "_").replace("/", "_per_")] = {
            "samples": int(here.sum()),
            "passive": found.passive.share,
            **{share.name.replace(" ", "_"): share.share for share in found.below},
            **{f"{share.name.replace(' ', '_')}_low": share.low for share in found.below},
            "median": found.median.value,
            "high": found.high.value,
        }
        table.append(
            [
                name, str(int(here.sum())), f"{found.passive.count}", _force(found.median), _force(found.high),
                *(_share(share) for share in found.below),
            ]
        )  # fmt: skip
        if high == low + 1:
            decades.append(Decade(name, found.below))
    report("walls: drawing")
    worst = run_sample(asked, int(rows["sample"].to_pylist()[int(np.argmax(peak))]))
    figure = draw_walls(stiffness, place, peak, decades, LIMITS, CONDITIONS.format(samples=samples))
    return write_study("walls", folder, figure, {"the hardest blow": worst}, table, numbers)


def _force(quantile: Quantile) -> str:
    high = f"{quantile.high:.0f}" if math.isfinite(quantile.high) else "∞"
    return f"{quantile.value:.0f} N ({quantile.low:.0f} to {high})"


def _share(share: Share) -> str:
    return f"{100 * share.share:.0f} % ({100 * share.low:.0f} to {100 * share.high:.0f})"


CONDITIONS = (
    "{samples} walls, stiffness log-uniform from 1e3 to 1e6 N/m, 2 to 18 cm before the hand, which goes 20 cm in 0.8 s "
    "(0.47 m/s halfway); intervals of 95 %, exact\n"
    "iiwa14 at 1 kHz, each command one period late, sensors, noise and torque limits as in the sampled study; gains by "
    "`recommend`, tank of 5 J"
)
