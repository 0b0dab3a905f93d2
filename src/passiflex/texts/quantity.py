"""Numbers with units: what a person writes in a file becomes plain SI numbers."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from passiflex.errors import shown as shown
from passiflex.texts.unit_spelling import spelt_out

Numbers = float | tuple["Numbers", ...]

_LONGEST = 80  # characters of one quantity; longer text is no quantity, and is not parsed
_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[+-]?\.?inf(?![A-Za-z])"
_TEXT = re.compile(rf"({_NUMBER})\s*(.*)")
# Names, products, quotients and small powers only: the unit parser evaluates whatever it is given.
_OFTEN, _TURNING = (
    re.compile("Hz|hertz|min|hour"),
    re.compile("rad|deg|°|turn|rp[ms]|revolution|rotation|cycle|arc"),
)
_UNIT = re.compile(r"(?:1\s*/)?(?:[A-Za-zµ°%/() ]|\^-?[1-9](?![0-9^.]))*")

_PER_TIME = re.compile(r"1\s*/\s*[A-Za-zµ]+|[A-Za-zµ]+\^-1")
PER_SECOND = ("1/s", "s^-1")
"""Units of SI for a speed of turning, which leaves rad out. Per any other time, data sheets count turns."""
USUAL = {
    ("kHz", "Hz"): 1000.0,
    ("ms", "s"): 0.001,
    ("us", "s"): 1e-6,
    ("cm", "m"): 0.01,
    ("mm", "m"): 0.001,
    ("deg", "rad"): math.pi / 180,
    ("%", "1"): 0.01,
}
"""What most files write, in the spelling of `spelt_out`; all else waits for the registry of units, most of a second."""


@dataclass(frozen=True)
class Quantity:
    """The annotation of a field that holds a quantity: `Annotated[float, Quantity("N/m")]`.

    A quantity is written as a number or nested list of numbers (taken in `unit`), as text ("10 cm",
    "50 %", "inf"), as a list of such texts, or as a mapping {value: …, unit: …}. It becomes a float or
    nested tuples of floats in `unit`.

    Parameters
    ----------
    unit: Unit of the result; "1" for a pure number, "" for plain SI numbers of mixed units.
    shapes: The shapes that are allowed; None stands for any length ≥ 1. The default is one number.
    above, least, most: Bounds of the numbers, the first one exclusive; entries of matrices are not bounded.
    finite: False allows inf.
    names: Words that may stand in place of numbers.
    """

    unit: str
    shapes: tuple[tuple[int | None, ...], ...] = ((),)
    above: float | None = None
    least: float | None = None
    most: float | None = None
    finite: bool = True
    names: tuple[str, ...] = ()

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return the schema of a field that is validated by `convert`."""
        return core_schema.no_info_plain_validator_function(self.convert)

    @property
    def words(self) -> str:
        """Return what the field expects, in words: "N/m, one number or 3 numbers, > 0"."""
        shapes = [_shape_words(s) for s in self.shapes]
        parts = [{"": "SI units", "1": ""}.get(self.unit, self.unit), _either(shapes)]
        if self.above is not None:
            parts.append(f"> {self.above:g}")
        if self.least is not None:
            parts.append(f"≥ {self.least:g}")
        if self.most is not None:
            parts.append(f"≤ {self.most:g}")
        return " or ".join([*self.names, ", ".join(p for p in parts if p)])

    def convert(self, written: Any) -> Numbers | str:
        """Return what was written, in the field's unit.

        Raises
        ------
        ValueError
            For text that is no quantity, a unit of another dimension, a wrong size, a number out of bounds,
            NaN, or inf where it is not allowed. The message says what was expected and what was got.
        """
        if isinstance(written, str) and written in self.names:
            return written
        try:
            value = self._numbers(written)
            shape = _shape(value)
            if not any(_fits(shape, allowed) for allowed in self.shapes):
                raise ValueError(_shape_words(shape))
            for number in _flat(value):
                self._check(number, bounded=len(shape) < 2)
        except ValueError as mistake:
            raise ValueError(f"expected {self.words}; got {shown(written)} ({mistake})") from None
        return value

    def _numbers(self, written: Any, unit: str | None = None) -> Numbers:
        """Return floats in the field's unit; `unit` is that of plain numbers, where the file names one."""
        if hasattr(written, "tolist"):
            written = written.tolist()
        if isinstance(written, bool) or written is None:
            raise ValueError("not a number")
        if isinstance(written, int | float):
            return _in_unit(float(written), unit, self.unit)
        if isinstance(written, str):
            found = _TEXT.fullmatch(written.strip()) if len(written) <= _LONGEST else None
            if found is None:
                raise ValueError("not a number with a unit" if self.unit else "not a number")
            if found[2] and unit is not None:
                raise ValueError("two units" if _UNIT.fullmatch(spelt_out(found[2])) else "not a number")
            named = "1" + found[2] if found[2].startswith("/") else found[2]
            return _in_unit(float(found[1].replace(".inf", "inf")), named or unit, self.unit)
        if isinstance(written, list | tuple):
            return tuple(self._numbers(w, unit) for w in written)
        if isinstance(written, dict) and unit is None and {"value"} <= set(written) <= {"value", "unit"}:
            named = written.get("unit", self.unit)
            if not isinstance(named, str):
                raise ValueError("the unit is not a text")
            return self._numbers(written["value"], named)
        raise ValueError("not a quantity")

    def _check(self, number: float, *, bounded: bool) -> None:
        if math.isnan(number):
            raise ValueError("not a number")
        if self.finite and math.isinf(number):
            raise ValueError("not finite")
        if not bounded:
            return
        if (self.above is not None and number <= self.above) or (
            self.least is not None and number < self.least
        ):
            raise ValueError("too small")
        if self.most is not None and number > self.most:
            raise ValueError("too large")


@lru_cache(maxsize=1)
def _registry() -> Any:
    """Return the one registry of units; made on first use, as it takes a third of a second."""
    import pint

    return pint.UnitRegistry()


@lru_cache(maxsize=1024)
def unit_factor(unit: str, wanted: str) -> float:
    """Return how many `wanted` are one `unit`.

    Raises
    ------
    ValueError
        If the unit is unknown, of another dimension, or not proportional.
    """
    if not wanted:
        raise ValueError("plain SI numbers only, as the units are mixed")
    spelt, aim = spelt_out(unit) if len(unit) <= _LONGEST else "", spelt_out(wanted)
    if spelt == aim:
        return 1.0
    if not spelt or not _UNIT.fullmatch(spelt):
        raise ValueError(f"unknown unit {shown(unit)}")
    if (spelt, aim) in USUAL:
        return USUAL[spelt, aim]
    bare = aim == "rad/s" and _PER_TIME.fullmatch(spelt) and spelt not in PER_SECOND
    if bare or any(_often(a) and _TURNING.search(b) for a, b in ((spelt, aim), (aim, spelt))):
        raise ValueError(f"{unit}: of a frequency and a speed, one counts turns and the other radians")
    units = _registry()
    try:
        got = units.parse_units(spelt)
    except Exception:  # the parser raises whatever its evaluation of the text ran into
        raise ValueError(f"unknown unit {shown(unit)}") from None
    try:
        target = units.parse_units(aim)
        none, factor = (float(units.Quantity(k, got).to(target).magnitude) for k in (0.0, 1.0))
    except Exception:  # another dimension
        raise ValueError(unit) from None
    if none != 0 or not 0 < factor < math.inf:
        raise ValueError(f"not a proportional unit: {shown(unit)}")
    return factor


def _often(unit: str) -> bool:
    """Return whether a unit says how often something is: in Hz, or by the minute, as data sheets have turns."""
    return _OFTEN.search(unit) is not None and _TURNING.search(unit) is None


def _in_unit(number: float, unit: str | None, wanted: str) -> float:
    """Return the number in the wanted unit, rounded as if it had been written so: 3 ms is exactly 0.003 s."""
    if unit is None or unit == wanted:
        return number
    factor = unit_factor(unit, wanted)
    inverse = 1 / factor
    if inverse > 1 and math.isclose(inverse, round(inverse), rel_tol=1e-12):
        return number / round(inverse)
    return number * factor


def _shape(value: Numbers) -> tuple[int, ...]:
    if not isinstance(value, tuple):
        return ()
    inner = {_shape(v) for v in value}
    if len(inner) > 1:
        raise ValueError("rows of different size")
    return (len(value), *(inner.pop() if inner else ()))


def _fits(shape: tuple[int, ...], allowed: tuple[int | None, ...]) -> bool:
    sizes = zip(shape, allowed, strict=False)
    return len(shape) == len(allowed) and all(s > 0 and a in (None, s) for s, a in sizes)


def _flat(value: Numbers) -> list[float]:
    return [x for v in value for x in _flat(v)] if isinstance(value, tuple) else [value]


def _shape_words(shape: tuple[int | None, ...]) -> str:
    if shape == ():
        return "one number"
    if len(shape) == 1:
        return "a list of numbers" if shape[0] is None else f"{shape[0]} number{'s' * (shape[0] != 1)}"
    return "×".join(str(s) for s in shape)


def _either(words: list[str]) -> str:
    return " or ".join(filter(None, [", ".join(words[:-1]), words[-1]]))
