"""The YAML file of a robot: its joints' numbers in SI units, every mistake at its line and column."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    ValidationError,
)

from passiflex.errors import RobotError
from passiflex.robots.chain import SerialChain
from passiflex.robots.robot_entries import OF_URDF, UNITS, Entries
from passiflex.texts.kinds import another_file, of_another_kind
from passiflex.texts.model_mistakes import explained
from passiflex.texts.quantity import Quantity, shown, unit_factor
from passiflex.texts.text_file import IN_YAML, UnreadableError, decoded
from passiflex.texts.unit_spelling import spelt_out
from passiflex.texts.yaml_tree import XML, Place, RefusedText, Tree, dotted

Array = NDArray[np.float64]


class RobotFile:
    """The entries of one robot file, and the text in which they stand.

    Raises
    ------
    RobotError
        If the text is no YAML, or an entry is missing, unknown or of another kind.
    """

    def __init__(self, path: Path, data: bytes):
        self.path, self._tree = path, Tree()
        try:
            text = decoded(data, IN_YAML)
            if XML.match(text):
                raise a_urdf(str(path))
            content = self._tree.read(text, "a robot file has its entries")
            if (other := of_another_kind(content, "robot file", str(path))) is not None:
                raise RobotError(f"{path}: {other}")
        except UnreadableError as error:
            raise unreadable(path, error) from None
        except RefusedText as error:
            raise RobotError(
                f"{path} is not a robot file", got=error, needs=f"YAML with {', '.join(Entries.model_fields)}"
            ) from None
        try:
            self.entries = Entries.model_validate(content)
        except ValidationError as error:
            for place, message, at_key in explained(error, content, Entries):
                self._tree.report(place, message, at_key=at_key)
        if self._tree.mistakes:
            raise RobotError(f"{path} has wrong entries", got="; ".join(self._tree.lines()))

    @property
    def frozen(self) -> dict[str, float]:
        """Return where other joints stand [rad, m]."""
        out = {}
        for name, written in self.entries.frozen.items():
            try:
                out[name] = _number(written, "rad")
            except ValueError as error:
                try:
                    out[name] = _number(written, "m")
                except ValueError:
                    raise self.mistake(("frozen", name), f": {error}") from None
        return out

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Return the shares of an entry's numbers between which the true ones may be."""
        found = {}
        for entry in UNITS:
            written = getattr(self.entries, entry)
            if written is None or written.range is None:
                continue
            low, high = written.range
            if not 0 < low <= 1 <= high < np.inf:
                needs = "shares of the value, the first up to 1, the second from 1 on"
                raise self.mistake((entry, "range"), " is impossible", got=list(written.range), needs=needs)
            found[entry] = (low, high)
        return found

    def source(self, entry: str) -> str:
        """Return where the numbers of an entry come from."""
        found = getattr(self.entries, entry)
        return "the URDF" if found is None else found.source

    def numbers(self, entry: str, chain: SerialChain) -> Array:
        """Return the numbers of one entry in SI units, one for each joint; position limits as pairs.

        Raises
        ------
        RobotError
            If a unit does not fit its joint, or there are too many or impossible numbers.
        """
        if getattr(self.entries, entry) is None:
            return _of_urdf(entry, chain)
        units = self._units(entry, chain)
        written, n, pairs = getattr(self.entries, entry).value, chain.n, entry == "position_limit"
        shape = _shape(written)
        if shape not in ((), (n,)) and not (pairs and shape == (n, 2)):
            needs = f"one number, {n} numbers{f', or {n} pairs [lower, upper]' if pairs else ''}"
            raise self.mistake((entry, "value"), " has the wrong size", got=shape, needs=needs)
        rows = written if shape else [written] * n
        value = np.array(
            [self._joint(entry, i, chain, row, units[i]) for i, row in enumerate(rows)], dtype=float
        )
        if value.ndim == 2:
            if not (value[:, 0] < value[:, 1]).all():
                needs = "pairs with lower < upper"
                raise self.mistake((entry, "value"), " is impossible", got=value.tolist(), needs=needs)
            return value
        limit = entry.endswith("limit")
        if not ((np.isfinite(value) | (limit & ~np.isnan(value))) & (value > 0)).all():
            needs = "numbers above 0" if limit else "finite numbers above 0"
            raise self.mistake((entry, "value"), " is impossible", got=value.tolist(), needs=needs)
        return np.stack([-value, value], axis=1) if pairs else value

    def _units(self, entry: str, chain: SerialChain) -> list[str | None]:
        """Return the unit of each joint's numbers, None where they have their own."""
        unit = getattr(self.entries, entry).unit
        units = list(unit) if isinstance(unit, tuple) else [unit] * chain.n
        if len(units) != chain.n:
            needs = f"one unit, or {chain.n}"
            raise self.mistake((entry, "unit"), " has the wrong size", got=len(units), needs=needs)
        for i, (unit, joint) in enumerate(zip(units, chain.joints, strict=True)):
            known = UNITS[entry][joint.kind]
            try:
                if unit is not None and spelt_out(unit) not in known:
                    unit_factor(unit, next(iter(known)))
            except ValueError:
                what = f" does not fit {joint.kind} joint {i + 1}"
                needs = f"one of {', '.join(known)}"
                raise self.mistake((entry, "unit"), what, got=repr(unit), needs=needs) from None
        return units

    def _joint(self, entry: str, i: int, chain: SerialChain, written: Any, unit: str | None) -> Any:
        """Return the number of one joint in SI units, or its pair of them."""
        if isinstance(written, list):
            return [self._joint(entry, i, chain, w, unit) for w in written]
        known = UNITS[entry][chain.joints[i].kind]
        factor = None if unit is None else known.get(spelt_out(unit))
        if factor is not None and isinstance(written, int | float) and not isinstance(written, bool):
            return float(written) * factor
        quantity = written if unit is None else {"value": written, "unit": unit}
        try:
            return Quantity(next(iter(known)), finite=False).convert(quantity)
        except ValueError as error:
            raise self.mistake((entry, "value"), f" is wrong at joint {i + 1}: {error}") from None

    def mistake(self, place: Place, what: str, **more: Any) -> RobotError:
        """Return what is to be said of an entry, with its line and column; `what` follows its name."""
        mark = self._tree.values.get(place) or self._tree.values[place[:1]]
        where = f"{self.path}, line {mark.line}, column {mark.column}"
        return RobotError(f"{where}: entry {dotted(place)}{what}", **more)


def _number(written: Any, unit: str) -> float:
    value = Quantity(unit).convert(written)
    assert isinstance(value, float)  # as the shape says
    return value


def _of_urdf(entry: str, chain: SerialChain) -> Array:
    """Return the limits of the URDF; a torque or speed of 0 stands for none there."""
    if entry == "position_limit":
        return np.array([[j.lower, j.upper] for j in chain.joints])
    found = np.array([getattr(j, OF_URDF[entry]) for j in chain.joints])
    return np.where(found > 0, found, np.inf)


def unreadable(path: Path, error: Exception) -> RobotError:
    """Return what to say of a robot file that cannot be read."""
    if (other := another_file(path, "robot file")) is not None:
        return RobotError(f"{path}: {other}")
    return RobotError(f"robot file {str(path)!r} cannot be read", got=error, needs="a YAML file")


SHORT = 80
"""Letters of a path that is repeated."""


def a_urdf(name: str) -> RobotError:
    """Return what to say where a URDF is given in place of a robot file."""
    return RobotError(
        f"{shown(name)} is a URDF, which knows nothing of motors and elastic joints",
        needs="a robot file",
        try_=f"passiflex robot new {name if len(name) < SHORT else 'ARM.urdf'}, which writes one",
    )


def _shape(written: Any) -> tuple[int, ...]:
    """Return the shape of nested lists; that of rows of different size is that of their first."""
    if not isinstance(written, list):
        return ()
    rows = {_shape(row) for row in written}
    return (len(written), *(rows.pop() if len(rows) == 1 else (0,) * bool(rows)))
