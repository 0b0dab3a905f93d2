"""Named slices of one flat vector: how states, inputs and parameters cross into compiled code.

A compiled function takes flat vectors; people think in names, shapes and units. A `Layout` is the
one place where the two meet: it makes the symbols, packs numbers, and unpacks results.
Matrices are stored row by row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cached_property
from inspect import get_annotations
from math import prod
from types import SimpleNamespace
from typing import Any, NamedTuple, NoReturn

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.errors import NameUnknownError, SizeError, ValueRangeError


class Field(NamedTuple):
    """One named entry of a layout, and all that is to be said of it.

    Attributes
    ----------
    axes: Names of its axes in a run; without them, each is the joints.
    kept: Whether a run has it.
    acts: Whether it is remembered and may act back on a command.
    """

    name: str
    shape: tuple[int, ...]
    unit: str
    meaning: str = ""
    axes: tuple[str, ...] = ()
    kept: bool = True
    acts: bool = False

    @property
    def dims(self) -> tuple[str, ...]:
        """Return the names of its axes."""
        return self.axes or ("joint",) * len(self.shape)

    @property
    def size(self) -> int:
        """Return the number of scalars."""
        return prod(self.shape)


class View(SimpleNamespace):
    """Named symbolic views of a vector; of a name that there is not it says which there are."""

    def __getattr__(self, name: str) -> NoReturn:
        raise AttributeError(f"no {name!r}; there are {', '.join(vars(self)) or 'none'}")


class Signal(NamedTuple):
    """What a field is, and the expression that it is made of."""

    field: Field
    value: cs.SX


@dataclass(frozen=True)
class Layout:
    """An ordered set of fields in one flat vector.

    Attributes
    ----------
    numbers: A protocol with an attribute for each field: what those who view the vector say that they have, so
        that a type checker knows the names.
    """

    fields: tuple[Field, ...]
    numbers: type | None = dataclass_field(default=None, compare=False)

    def __post_init__(self) -> None:
        """Refuse two fields of one name, and a protocol of other names."""
        names = [f.name for f in self.fields]
        if len(set(names)) < len(names):
            twice = sorted({name for name in names if names.count(name) > 1})
            raise ValueRangeError("a layout has two fields of one name", got=", ".join(twice))
        if self.numbers is not None:
            promised = set().union(*(get_annotations(c) for c in self.numbers.__mro__))
            if promised != set(names):
                raise ValueRangeError(
                    f"a layout is not what {self.numbers.__name__} says",
                    got=", ".join(sorted(promised ^ set(names))),
                    needs="the same names in both",
                )

    @classmethod
    def of(cls, signals: Iterable[Signal]) -> Layout:
        """Return the fields of signals."""
        return cls(tuple(signal.field for signal in signals))

    def __iter__(self) -> Iterator[Field]:
        return iter(self.fields)

    def __add__(self, other: Layout) -> Layout:
        return Layout(self.fields + other.fields)

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Return name → slice of the flat vector."""
        out, start = {}, 0
        for f in self.fields:
            out[f.name] = slice(start, start + f.size)
            start += f.size
        return out

    @cached_property
    def size(self) -> int:
        """Return the length of the flat vector."""
        return sum(f.size for f in self.fields)

    def columns(self, chosen: Callable[[Field], bool]) -> NDArray[np.intp]:
        """Return the places in the flat vector of the fields that are chosen."""
        return np.flatnonzero(np.repeat([chosen(f) for f in self.fields], [f.size for f in self.fields]))

    @property
    def kept(self) -> Layout:
        """Return the fields that a run has."""
        return Layout(tuple(f for f in self.fields if f.kept))

    def zeros(self) -> dict[str, NDArray[np.float64]]:
        """Return zeros by name."""
        return {f.name: np.zeros(f.shape) for f in self.fields}

    def symbols(self, name: str) -> tuple[cs.SX, Any]:
        """Return a fresh symbolic vector and its named views."""
        vector = cs.SX.sym(name, self.size)
        return vector, self.view(vector)

    def view(self, vector: cs.SX) -> Any:
        """Return named symbolic views of `vector`, matrices in shape; whoever takes them says which, by `numbers`."""
        out = {}
        for f in self.fields:
            part = vector[self.slices[f.name]]
            out[f.name] = cs.reshape(part, f.shape[1], f.shape[0]).T if len(f.shape) == 2 else part
        return View(**out)

    def stack(self, values: Mapping[str, Any]) -> cs.SX:
        """Return the flat symbolic vector of named expressions."""
        parts = []
        for f in self.fields:
            part = cs.vec(cs.densify(cs.SX(values[f.name])).T)
            if part.numel() != f.size:
                raise SizeError(f"{f.name!r} has the wrong size", got=part.numel(), needs=f"shape {f.shape}")
            parts.append(part)
        return cs.vertcat(*parts)

    def stack_of(self, signals: Iterable[Signal]) -> cs.SX:
        """Return the flat symbolic vector of signals."""
        return self.stack({signal.field.name: signal.value for signal in signals})

    def pack(self, values: Mapping[str, ArrayLike]) -> NDArray[np.float64]:
        """Return the flat vector of named numbers.

        Raises
        ------
        NameUnknownError, SizeError, ValueRangeError
            For a name that is missing or not in the layout, a wrong shape, a number that is not finite.
        """
        for name in values:
            if name not in self.slices:
                raise NameUnknownError("parameter", name, list(self.slices))
        out = np.empty(self.size)
        for f in self.fields:
            if f.name not in values:
                raise SizeError(f"parameter {f.name!r} is missing", needs=f"shape {f.shape} in {f.unit}")
            try:
                value = np.asarray(values[f.name], dtype=float)
            except (TypeError, ValueError) as error:
                raise ValueRangeError(
                    f"parameter {f.name!r} is not a number",
                    got=repr(values[f.name]),
                    needs=f"numbers in {f.unit}",
                ) from error
            if value.shape != f.shape:
                raise SizeError(
                    f"parameter {f.name!r} has the wrong shape",
                    got=value.shape,
                    needs=f"{f.shape} in {f.unit}",
                )
            out[self.slices[f.name]] = value.ravel()
        if not np.isfinite(out).all():
            f = next(f for f in self.fields if not np.isfinite(out[self.slices[f.name]]).all())
            raise ValueRangeError(
                f"parameter {f.name!r} is not finite",
                got=np.asarray(values[f.name]),
                needs=f"finite numbers in {f.unit}",
            )
        return out

    def unpack(self, vector: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return named views of the last axis of `vector`, each in its shape."""
        lead = vector.shape[:-1]
        return {f.name: vector[..., self.slices[f.name]].reshape((*lead, *f.shape)) for f in self.fields}
