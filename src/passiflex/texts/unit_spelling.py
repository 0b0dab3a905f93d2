"""Units as they are spelt on data sheets, in the one spelling that the parser of units knows."""

from __future__ import annotations

import re

_SIGNS = str.maketrans(
    {
        **dict.fromkeys("⋅∙•‧×", "·"),
        **dict.fromkeys("\u00a0\u2009\u202f", " "),
        "º": "°",
        "μ": "µ",
    }
)
_RAISED = str.maketrans("⁻¹²³⁴⁵⁶⁷⁸⁹", "-123456789")
_POWER = re.compile("[⁻¹²³⁴⁵⁶⁷⁸⁹]+")
_JOINED = re.compile(r"(?<=[A-Za-z])[-.](?=[A-Za-z])")
_BARE_POWER = re.compile(r"(?<=[A-Za-z])([23])(?![0-9.])")
_RUN_TOGETHER = re.compile(
    r"(?<![A-Za-z])(?:([kmM]?N)([cmk]?m)?(s(?:ec)?)?|(k?g)([cm]?m)|([kmM]?W)(s|h))(?![A-Za-z])"
)
_ROTATIONS = re.compile(r"(?<![A-Za-z])(?:(RPM|r/min|U/min)|(revs?))(?![A-Za-z])")


def spelt_out(unit: str) -> str:
    """Return a unit with a space between its factors, ^ before its powers, and its rotations by name.

    So `Nm/rad`, `N·m·rad⁻¹` and `N-m/rad` are N m/rad, `kgm²` and `kg m2` are kg m^2, `rev/min` and `RPM` are rpm.
    """
    unit = unit.translate(_SIGNS).replace("**", "^")
    unit = _POWER.sub(lambda m: "^" + m[0].translate(_RAISED), unit)
    unit = _BARE_POWER.sub(r"^\1", _JOINED.sub(" ", unit))
    unit = _RUN_TOGETHER.sub(lambda m: " ".join(part for part in m.groups() if part), unit)
    unit = _ROTATIONS.sub(lambda m: "rpm" if m[1] else "turn", unit)
    return re.sub(r"\s*([·*/ ])\s*", lambda m: " " if m[1] in "·*" else m[1], unit.strip())
