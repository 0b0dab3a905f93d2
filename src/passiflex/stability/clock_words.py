"""Rates and delays in words."""

from __future__ import annotations


def hertz(rate: float) -> str:
    """Return a rate in words."""
    return f"{rate / 1e3:.3g} kHz" if rate >= 1e3 else f"{rate:.3g} Hz"


def delay_words(periods: float) -> str:
    """Return a delay in words."""
    return counted(periods, "delay") if round(periods, 9) else "no delay"


def counted(periods: float, what: str) -> str:
    """Return so many periods of something in words."""
    periods = round(periods, 9)
    return f"{periods:g} period{'s' * (periods != 1)} of {what}"
