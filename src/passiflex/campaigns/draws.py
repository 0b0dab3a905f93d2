"""The draws of a campaign: a table of numbers, in which any row can be had alone."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from passiflex.campaigns.campaign import Campaign
from passiflex.campaigns.distributions import Choice
from passiflex.errors import ValueRangeError

Array = NDArray[np.float64]

SEED_BITS = 53
"""Seeds of scenarios are below 2^53, so that a table of floats holds them exactly."""
SMALLEST = 2.0**-54
"""Probabilities are drawn between this and one minus this: a quantile at 0 or 1 may be infinite."""

LARGEST_HYPERCUBE = 10**7
"""Most numbers of a Latin hypercube, which each worker holds whole: 80 MB."""


def columns(campaign: Campaign) -> tuple[str, ...]:
    """Return the names of the columns of the draws: the path of each parameter, with `.1` … for each joint."""
    return tuple(
        f"{path}.{i + 1}" if parameter.per else path
        for path, parameter in campaign.parameters.items()
        for i in range(campaign.joints if parameter.per else 1)
    )


def words(campaign: Campaign) -> dict[str, tuple[str, ...]]:
    """Return the words of the columns that hold indices of words from 0, and not numbers; flags as true, false."""
    return {
        path: tuple(
            str(value).lower() if isinstance(value, bool) else str(value) for value in parameter.values
        )
        for path, parameter in campaign.parameters.items()
        if isinstance(parameter, Choice) and not parameter.numeric
    }


def draws(campaign: Campaign, indices: Sequence[int] | NDArray[np.integer] | range) -> Array:
    """Return the drawn values of some samples, one row each, in the units of the scenario; words as indices.

    Sampling `random` gives sample i its own stream, from the seed and i alone: what is drawn does not depend on
    which other samples are drawn, nor on `samples`, nor on parameters that are listed later. With `sobol` it
    does not depend on other samples and `samples` either, but on the number of columns. With `latin_hypercube`
    it depends on both.

    Parameters
    ----------
    indices: Which samples, from 0; in any order.

    Raises
    ------
    ValueRangeError
        For an index that is none of the campaign's, and for a Latin hypercube of more than 10^7 numbers.
    """
    wanted = _checked(campaign, indices)
    u = np.clip(_probabilities(campaign, wanted), SMALLEST, 1 - SMALLEST)
    out = np.empty_like(u)
    column = 0
    for parameter in campaign.parameters.values():
        end = column + (campaign.joints if parameter.per else 1)
        out[:, column:end] = parameter.quantile(u[:, column:end])
        column = end
    return out


def scenario_seed(campaign: Campaign, index: int) -> int:
    """Return the seed of one sample's noise, jitter and missed periods, whatever the parameters.

    Raises
    ------
    ValueRangeError
        For an index that is none of the campaign's.
    """
    _checked(campaign, [index])
    return _seed(_stream(campaign, index))


def _checked(campaign: Campaign, indices: Sequence[int] | NDArray[np.integer] | range) -> NDArray[np.int64]:
    wanted = np.asarray(indices)
    if wanted.size == 0:
        return np.empty(0, dtype=np.int64)
    if (
        wanted.dtype.kind not in "iu"
        or wanted.ndim != 1
        or wanted.min() < 0
        or wanted.max() >= campaign.samples
    ):
        raise ValueRangeError(
            f"samples of campaign {campaign.name!r}",
            got=str(indices)[:60],
            needs=f"a list of whole numbers from 0 to {campaign.samples - 1}",
        )
    return wanted.astype(np.int64)


def _stream(campaign: Campaign, index: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(campaign.seed, spawn_key=(index,)))


def _seed(stream: np.random.Generator) -> int:
    """Return the first thing drawn from a sample's stream: so it does not depend on what else is drawn."""
    return int(stream.integers(2**SEED_BITS))


def _probabilities(campaign: Campaign, wanted: NDArray[np.int64]) -> Array:
    """Return u of the quantiles, one row per sample."""
    count = len(columns(campaign))
    if wanted.size == 0 or count == 0:
        return np.empty((wanted.size, count))
    if campaign.sampling == "latin_hypercube":
        if campaign.samples * count > LARGEST_HYPERCUBE:
            raise ValueRangeError(
                "a Latin hypercube, which every worker holds whole",
                got=f"{campaign.samples} samples of {count} columns",
                needs=f"at most {LARGEST_HYPERCUBE} numbers",
                try_="sampling: sobol, as evenly spread and drawn row by row",
            )
        return _latin_hypercube(campaign.seed, campaign.samples, count)[wanted]
    if campaign.sampling == "sobol":
        return _sobol(campaign.seed, count, wanted)
    rows = np.empty((wanted.size, count))
    for row, index in zip(rows, wanted.tolist(), strict=True):
        stream = _stream(campaign, index)
        _seed(stream)
        row[:] = stream.random(count)
    return rows


@lru_cache(maxsize=2)
def _latin_hypercube(seed: int, samples: int, count: int) -> Array:
    """Return the whole table, kept because single rows are asked for; not to be changed."""
    from scipy.stats import qmc

    table = qmc.LatinHypercube(count, rng=_table_stream(seed)).random(samples)
    table.flags.writeable = False
    return table


def _sobol(seed: int, count: int, wanted: NDArray[np.int64]) -> Array:
    from scipy.stats import qmc

    sequence = qmc.Sobol(count, scramble=True, rng=_table_stream(seed))
    zeroth = sequence.random(1)  # alone: SciPy warns of a first draw that is no power of two
    first = max(int(wanted.min()), 1)
    if first > 1:
        sequence.fast_forward(first - 1)
    table = np.concatenate([zeroth, sequence.random(max(int(wanted.max()) + 1 - first, 0))])
    return table[np.where(wanted == 0, 0, wanted + 1 - first)]


def _table_stream(seed: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed))
