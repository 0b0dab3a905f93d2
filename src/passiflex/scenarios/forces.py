"""External wrenches in a scenario: constant for some time, or row by row of a table."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, model_validator

from passiflex.scenarios.reference import ZERO
from passiflex.scenarios.spans import Instant, TimeSpan
from passiflex.scenarios.table_rows import in_file, with_rows
from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Mistakes, Section
from passiflex.texts.text_file import UnreadableError
from passiflex.texts.timed_table import columns, timed_table

Array = NDArray[np.float64]
Vector = tuple[float, ...]
FORCE, MOMENT = ("fx", "fy", "fz"), ("mx", "my", "mz")


class Acting(NamedTuple):
    """From `start` on, before `end` [s], this wrench acts (6,)."""

    start: float
    end: float
    wrench: Vector


class Force(TimeSpan):
    """A constant wrench on the end effector for some time; wrenches that overlap add up."""

    force: Annotated[Vector, Quantity("N", ((3,),))] = Field(
        default=ZERO, description="force in world axes, N"
    )
    moment: Annotated[Vector, Quantity("N m", ((3,),))] = Field(
        default=ZERO, description="moment in world axes, N m"
    )

    def acting(self, until: float) -> Iterator[Acting]:
        """Yield what acts, and when."""
        yield Acting(self.start, self.end, (*self.force, *self.moment))

    @property
    def begins(self) -> tuple[str, float]:
        """Return the entry that says when it begins, and that [s]."""
        return "from", self.start

    def words(self) -> str:
        """Return what it is."""
        parts = [f"force {np.linalg.norm(self.force):.3g} N"] if any(self.force) else []
        parts += [f"moment {np.linalg.norm(self.moment):.3g} N m"] if any(self.moment) else []
        return ", ".join(parts) or "force 0 N"


class WrenchTable(Section):
    """A wrench that goes by the rows of a table: each holds until the next, the last one until the end of the run."""

    at: Instant = Field(default=0.0, description="when t = 0 of the table is, s")
    table: str = Field(
        default="",
        description="path of a CSV file: t in s, fx,fy,fz in N, mx,my,mz in N m, one of both at least, in world axes; "
        "its rows are read at once and kept in `rows`",
    )
    rows: str = Field(description="text of the table, packed if it is long; in place of `table`")
    source: str = Field(default="", description="where the rows came from")

    @model_validator(mode="before")
    @classmethod
    def _read(cls, written: Any) -> Any:
        return with_rows(written) if isinstance(written, dict) else written

    @model_validator(mode="after")
    def _of_numbers(self) -> Self:
        try:
            wrench_rows(self.rows)
        except (ValueError, UnreadableError) as error:
            raise Mistakes((("table",), in_file(self.source, str(error)))) from None
        return self

    def acting(self, until: float) -> Iterator[Acting]:
        """Yield what acts, and when; the last row does until then [s]."""
        rows = wrench_rows(self.rows)
        begins = (self.at + rows[:, 0]).tolist()
        for start, end, row in zip(begins, [*begins[1:], until], rows[:, 1:].tolist(), strict=True):
            if start < until:
                yield Acting(start, min(end, until), tuple(row))

    @property
    def begins(self) -> tuple[str, float]:
        """Return the entry that says when it begins, and when its first row does [s]."""
        return "at", self.at + float(wrench_rows(self.rows)[0, 0])

    def words(self) -> str:
        """Return what it is."""
        return f"wrench of {self.source or 'a table'}"


@lru_cache(maxsize=8)
def wrench_rows(text: str) -> Array:
    """Return the rows (N, 7) of a table's text, packed or not: t [s], force [N], moment [N m].

    Raises
    ------
    ValueError
        With line and remedy, for a table that has mistakes.
    UnreadableError
        For packed rows that are damaged.
    """
    table = timed_table(text, ("t", *FORCE, *MOMENT), "t, fx,fy,fz, mx,my,mz")
    time, force, moment = (columns(table, names) for names in (("t",), FORCE, MOMENT))
    assert time is not None
    if force is None and moment is None:
        raise ValueError("has a column t only; needs fx,fy,fz or mx,my,mz beside it")
    none = np.zeros((len(time), 3))
    return np.hstack([time, none if force is None else force, none if moment is None else moment])


def _branch(written: Any) -> str:
    is_table = isinstance(written, dict) and not {"table", "rows"}.isdisjoint(written)
    return "WrenchTable" if is_table or isinstance(written, WrenchTable) else "Force"


AnyForce = Annotated[
    Annotated[Force, Tag("Force")] | Annotated[WrenchTable, Tag("WrenchTable")], Discriminator(_branch)
]
"""An entry of `forces`, by what is in it; the tags are the names of the classes."""


def as_forces(written: Any) -> Any:
    """Return what was written for forces as a list: a table alone stands for a list of one."""
    alone = isinstance(written, Force | WrenchTable) or (
        isinstance(written, dict) and _branch(written) != "Force"
    )
    return [written] if alone else written
