"""How a parameter is distributed: its quantile function, and where its values may lie."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BeforeValidator, Field, model_validator
from scipy.special import ndtr, ndtri

from passiflex.texts.quantity import Quantity, shown
from passiflex.texts.section import Mistakes, Section

Array = NDArray[np.float64]
Value = float | str | bool
"""One value of a parameter: a number, a word, or a flag."""
End = tuple[tuple[str | int, ...], Value]
"""An end of a support: the entry of the distribution that sets it, and the value there."""

RARE = 1e-9
"""An unbounded end is tested at this quantile, six standard deviations out."""
_PLAIN = Quantity("")


@dataclass(frozen=True)
class Refused:
    """A value that does not fit the parameter's field, in place of what was written; `message` says why."""

    message: str


def _number(written: Any) -> float:
    if isinstance(written, Refused):
        raise ValueError(written.message)
    number = _PLAIN.convert(written)
    assert isinstance(number, float)
    return number


def _value(written: Any) -> Value:
    if isinstance(written, Refused):
        raise ValueError(written.message)
    if isinstance(written, bool | str):
        return written
    if isinstance(written, int | float) and not math.isnan(written):
        return float(written)
    raise ValueError(f"expected a number, a word, or true or false; got {shown(written)}")


Number = Annotated[float, BeforeValidator(_number)]


class AbstractDistribution(Section, ABC):
    """A distribution of one parameter, in the unit of the parameter's field."""

    per: Literal["joint"] | None = Field(
        default=None, description="joint: one draw per joint, independent; one draw for all if left out"
    )

    @property
    @abstractmethod
    def support(self) -> tuple[float, float]:
        """Return the least and the largest value that `quantile` gives."""

    @abstractmethod
    def quantile(self, u: ArrayLike) -> Array:
        """Return the values below which a share u of the draws lies, 0 < u < 1; of u's shape."""

    @abstractmethod
    def ends(self) -> tuple[End, ...]:
        """Return the values at which a scenario must be possible, each with the entry that sets it."""

    def value(self, drawn: float) -> Value:
        """Return what a drawn number stands for."""
        return drawn


def _require_ordered(low: float, high: float) -> None:
    if not low < high:
        raise Mistakes((("high",), f"needs more than low = {low:g}; got {high:g}"))


class _Interval(AbstractDistribution):
    """All values between two ends."""

    low: Number = Field(description="least value")
    high: Number = Field(description="largest value")

    @property
    def support(self) -> tuple[float, float]:
        """Return low and high."""
        return self.low, self.high

    def ends(self) -> tuple[End, ...]:
        """Return low and high."""
        return (("low",), self.low), (("high",), self.high)


class Uniform(_Interval):
    """All values between low and high are equally likely: x = low + u (high - low)."""

    distribution: Literal["uniform"] = Field(default="uniform", description="kind of distribution")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        _require_ordered(self.low, self.high)
        return self

    def quantile(self, u: ArrayLike) -> Array:
        """Return low + u (high - low)."""
        u = np.asarray(u, dtype=float)
        return np.clip((1 - u) * self.low + u * self.high, self.low, self.high)


class LogUniform(_Interval):
    """The logarithm is uniform: every decade between low and high is equally likely."""

    distribution: Literal["log_uniform"] = Field(default="log_uniform", description="kind of distribution")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.low > 0:
            needs = "log_uniform needs numbers > 0; try uniform, or a small low"
            raise Mistakes((("low",), f"{needs}; got {self.low:g}"))
        _require_ordered(self.low, self.high)
        return self

    def quantile(self, u: ArrayLike) -> Array:
        """Return low^(1-u) high^u."""
        u = np.asarray(u, dtype=float)
        logarithm = (1 - u) * math.log(self.low) + u * math.log(self.high)
        return np.clip(np.exp(logarithm), self.low, self.high)


class Normal(AbstractDistribution):
    """A normal distribution, cut off at `low` and `high` where they are given."""

    distribution: Literal["normal"] = Field(default="normal", description="kind of distribution")
    mean: Number = Field(description="mean, before the ends are cut off")
    deviation: Number = Field(description="standard deviation, before the ends are cut off")
    low: Number | None = Field(default=None, description="least value; no limit if left out")
    high: Number | None = Field(default=None, description="largest value; no limit if left out")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.deviation > 0:
            raise Mistakes((("deviation",), f"needs a number > 0; got {self.deviation:g}"))
        low, high = self.support
        if low < high and not low <= self.mean <= high:
            raise Mistakes((("mean",), f"needs to lie between low and high; got {self.mean:g}"))
        _require_ordered(low, high)
        return self

    @property
    def support(self) -> tuple[float, float]:
        """Return low and high, infinite where they are left out."""
        return (
            -math.inf if self.low is None else self.low,
            math.inf if self.high is None else self.high,
        )

    def quantile(self, u: ArrayLike) -> Array:
        """Return μ + σ Φ⁻¹(Φ(a) + u (Φ(b) - Φ(a))), a and b the ends in standard deviations."""
        u = np.asarray(u, dtype=float)
        low, high = self.support
        a, b = (low - self.mean) / self.deviation, (high - self.mean) / self.deviation
        mass = ndtr(b) - ndtr(a)
        below, above = ndtr(a) + u * mass, ndtr(-b) + (1 - u) * mass
        # Each half from its own tail: Φ is near 1 in the upper one, where its last digits are lost.
        standard = np.where(below < 0.5, ndtri(below), -ndtri(above))
        return np.clip(self.mean + self.deviation * standard, low, high)

    def ends(self) -> tuple[End, ...]:
        """Return low and high; where one is left out, the value beyond which a share of RARE lies."""
        far = self.quantile([RARE, 1 - RARE]).tolist()
        return (
            (("low",), self.low) if self.low is not None else ((), far[0]),
            (("high",), self.high) if self.high is not None else ((), far[1]),
        )


class Choice(AbstractDistribution):
    """One of a few values. Words and flags are drawn as their index in `values`, from 0."""

    distribution: Literal["choice"] = Field(default="choice", description="kind of distribution")
    values: tuple[Annotated[Value, BeforeValidator(_value)], ...] = Field(
        description="list of numbers, of words, or of true and false"
    )
    weights: tuple[Number, ...] | None = Field(
        default=None, description="how likely they are, relative to each other; all equally if left out"
    )

    @model_validator(mode="after")
    def _fitting(self) -> Self:
        found: list[tuple[tuple[str | int, ...], str]] = []
        if not self.values:
            found.append((("values",), "needs one value at least; got []"))
        if len({type(v) for v in self.values}) > 1:
            found.append((("values",), f"needs all numbers, or all words; got {shown(list(self.values))}"))
        for i, value in enumerate(self.values):
            if value in self.values[:i]:
                found.append((("values", i), "is there twice; remove one, or give it a weight"))
        weights = self.weights or ()
        if self.weights is not None and len(weights) != len(self.values):
            needs = f"needs {len(self.values)} numbers, one for each value"
            found.append((("weights",), f"{needs}; got {len(weights)}"))
        for i, weight in enumerate(weights):
            if not weight > 0:
                found.append((("weights", i), f"needs a number > 0; got {weight:g}"))
        if found:
            raise Mistakes(*found)
        return self

    @property
    def numeric(self) -> bool:
        """Return whether the values are numbers."""
        return isinstance(self.values[0], float)

    @property
    def support(self) -> tuple[float, float]:
        """Return the least and the largest value; of words and flags the first and last index."""
        numbers = self._numbers()
        return float(numbers.min()), float(numbers.max())

    def quantile(self, u: ArrayLike) -> Array:
        """Return the value, or the index of the word, whose share of the weights u falls in."""
        shares = np.cumsum(self.weights or np.ones(len(self.values)))
        at = np.searchsorted(shares[:-1] / shares[-1], np.asarray(u, dtype=float), side="right")
        return self._numbers()[at]

    def ends(self) -> tuple[End, ...]:
        """Return all values."""
        return tuple((("values", i), value) for i, value in enumerate(self.values))

    def value(self, drawn: float) -> Value:
        """Return the number, or the word or flag of an index."""
        return drawn if self.numeric else self.values[int(drawn)]

    def _numbers(self) -> Array:
        return np.array(self.values if self.numeric else range(len(self.values)), dtype=float)


Distribution = Annotated[Uniform | LogUniform | Normal | Choice, Field(discriminator="distribution")]
