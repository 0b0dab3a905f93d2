"""When a command arrives: so many periods late, and a part of one."""

from __future__ import annotations

from typing import NamedTuple


class Timing(NamedTuple):
    """Period and delay [s], and how many commands are on their way when the law runs.

    A command arrives `part` of a period after the sample `whole` periods later.
    """

    period: float
    delay: float
    whole: int
    part: float
    lined: int

    @classmethod
    def of(cls, period: float, delay: float, least: int = 0) -> Timing:
        """Return the timing, with room for at least so many commands."""
        whole = int(delay / period + 1e-9)
        part = max(delay / period - whole, 0.0)
        part = part if part > 1e-9 else 0.0
        return cls(period, delay, whole, part, max(whole + (part > 0), least))
