"""The YAML file of a robot: its joints' numbers in SI units, every mistake at its line and column."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, StringConstraints, ValidationError, ValidationInfo, field_validator

from passiflex.errors import RobotError
from passiflex.robots.chain import SerialChain
from passiflex.texts.kinds import another_file, of_another_kind
from passiflex.texts.model_mistakes import explained
from passiflex.texts.quantity import Quantity, shown, unit_factor
from passiflex.texts.section import Mistakes, Section
from passiflex.texts.text_file import IN_YAML, UnreadableError, decoded
from passiflex.texts.unit_spelling import spelt_out
from passiflex.texts.yaml_tree import XML, Place, RefusedText, Tree, dotted

Array = NDArray[np.float64]
Text = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]

DEGREE = np.pi / 180.0

UNITS: dict[str, dict[str, dict[str, float]]] = {
    "joint_stiffness": {
        "revolute": {"N m/rad": 1.0, "kN m/rad": 1e3, "N m/deg": 1 / DEGREE},
        "prismatic": {"N/m": 1.0, "kN/m": 1e3, "N/mm": 1e3},
    },
    "joint_damping": {
        "revolute": {"N m s/rad": 1.0, "N m s/deg": 1 / DEGREE},
        "prismatic": {"N s/m": 1.0, "N s/mm": 1e3},
    },
    "motor_inertia": {
        "revolute": {"kg m^2": 1.0, "kg cm^2": 1e-4},
        "prismatic": {"kg": 1.0},
    },
    "torque_limit": {
        "revolute": {"N m": 1.0},
        "prismatic": {"N": 1.0, "kN": 1e3},
    },
    "velocity_limit": {
        "revolute": {"rad/s": 1.0, "deg/s": DEGREE},
        "prismatic": {"m/s": 1.0, "mm/s": 1e-3},
    },
    "position_limit": {
        "revolute": {"rad": 1.0, "deg": DEGREE},
        "prismatic": {"m": 1.0, "mm": 1e-3},
    },
}
"""Entry → kind of joint → usual units, the first one SI → factor to SI. Others go by the parser of units."""


class Entry(Section):
    """Numbers with their unit and their source; one number or unit serves all joints."""

    value: Any = Field(description="one number, or one for each joint")
    unit: Text | tuple[Text, ...] | None = Field(
        default=None, description="unit of all, or one for each joint"
    )
    source: Text = Field(description="where the numbers come from, or the word assumed")

    @field_validator("unit", mode="before")
    @classmethod
    def _texts(cls, written: Any) -> Any:
        if not all(isinstance(unit, str) and unit.strip() for unit in _leaves(written)):
            raise ValueError(f"expected text, or one for each joint; got {shown(written)}")
        return written


class Entries(Section):
    """A robot as it stands in its YAML file; `source` is that of the links."""

    name: Text = Field(description="text")
    description: Text = Field(description="text")
    urdf: Text = Field(description="path of the URDF, absolute or from the folder of this file")
    end_effector: Text = Field(description="a link that is fixed to the last moving link")
    source: Text = Field(description="where the numbers of the links come from")
    joint_stiffness: Entry = Field(description="K, with value, unit and source")
    joint_damping: Entry = Field(description="D, with value, unit and source")
    motor_inertia: Entry = Field(description="B as seen at the link, with value, unit and source")
    torque_limit: Entry = Field(description="largest torque of the motors, with value, unit and source")
    velocity_limit: Entry = Field(description="largest speed of the joints, with value, unit and source")
    position_limit: Entry = Field(description="range of the joints, with value, unit and source")

    @field_validator(*UNITS, mode="before")
    @classmethod
    def _with_a_unit(cls, written: Any, info: ValidationInfo) -> Any:
        usual = next(iter(UNITS[info.field_name or ""]["revolute"]))
        if not isinstance(written, dict | Entry):
            named = any(isinstance(v, str) and not _is_number(v) for v in _leaves(written))
            value = shown(written) if isinstance(written, list) else written
            entry = f"{{value: {value}, {'' if named else f'unit: {usual}, '}source: ...}}"
            needs = "a source" if named else "a unit and a source"
            raise ValueError(f"needs {needs}; got {shown(written)}; try {entry}")
        return written

    @field_validator(*UNITS)
    @classmethod
    def _of_a_unit(cls, entry: Entry, info: ValidationInfo) -> Entry:
        if entry.unit is None and any(not isinstance(v, str) or _is_number(v) for v in _leaves(entry.value)):
            usual = next(iter(UNITS[info.field_name or ""]["revolute"]))
            raise Mistakes((("value",), f"needs a unit; got {shown(entry.value)}; try unit: {usual}"))
        return entry


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

    def numbers(self, entry: str, chain: SerialChain) -> Array:
        """Return the numbers of one entry in SI units, one for each joint; position limits as pairs.

        Raises
        ------
        RobotError
            If a unit does not fit its joint, or there are too many or impossible numbers.
        """
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


def unreadable(path: Path, error: Exception) -> RobotError:
    """Return what to say of a robot file that cannot be read."""
    if (other := another_file(path, "robot file")) is not None:
        return RobotError(f"{path}: {other}")
    return RobotError(f"robot file {str(path)!r} cannot be read", got=error, needs="a YAML file")


def a_urdf(name: str) -> RobotError:
    """Return what to say where a URDF is given in place of a robot file."""
    return RobotError(
        f"{shown(name)} is a URDF, which knows nothing of motors and elastic joints",
        needs="a robot file",
        try_=f"a YAML file with the entries {', '.join(Entries.model_fields)}",
    )


def _shape(written: Any) -> tuple[int, ...]:
    """Return the shape of nested lists; that of rows of different size is that of their first."""
    if not isinstance(written, list):
        return ()
    rows = {_shape(row) for row in written}
    return (len(written), *(rows.pop() if len(rows) == 1 else (0,) * bool(rows)))


def _leaves(written: Any) -> Iterator[Any]:
    for part in written if isinstance(written, list) else ():
        yield from _leaves(part)
    if not isinstance(written, list):
        yield written


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
