"""Instants, durations and spans of time in a scenario."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Mistakes, Section

Seconds = Annotated[float, Quantity("s", above=0)]
Instant = Annotated[float, Quantity("s", least=0)]


class TimeSpan(Section):
    """From one instant to another."""

    start: Instant = Field(alias="from", description="when it begins, s")
    end: Instant = Field(alias="to", description="when it ends, s")

    @property
    def lasts(self) -> tuple[float, float]:
        """Return from when to when it lasts [s]."""
        return self.start, self.end

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.end > self.start:
            raise Mistakes((("to",), f"needs to be later than from = {self.start:g} s; got {self.end:g} s"))
        return self
