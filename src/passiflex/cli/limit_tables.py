"""The tables of `passiflex limits`: borders, and what the simulation says of them."""

from __future__ import annotations

import math

import numpy as np
from rich.table import Table

from passiflex.limits import Confirmation, LimitMap
from passiflex.limits.planes import within
from passiflex.stability.admissible import INERTIA_RATIOS
from passiflex.stability.clock_words import delay_words, hertz

SHOWN = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""K_e/K of the table."""


def border_table(found: LimitMap) -> Table:
    """Return the least stable B_e/B by K_e/K and delay; for the rigid law the radius by rate and delay."""
    delays = [delay_words(float(d)) for d in found.delays]
    if found.shaping is None or found.least_inertia is None:
        table = Table("rate", *delays, title="spectral radius of these gains, with")
        for rate, radii in zip(found.rates, found.radius_by_rate.T, strict=True):
            table.add_row(hertz(float(rate)), *(f"{r:.5f}" for r in radii))
        return table
    table = Table("K_e/K", *delays, title="least stable B_e/B, with")
    for ratio, borders in zip(found.shaping.horizontal, found.least_inertia.T, strict=True):
        if np.isclose(ratio, SHOWN).any():
            table.add_row(f"{ratio:g}", *(_border(float(b)) for b in borders))
    return table


def why_lines(found: LimitMap) -> list[str]:
    """Return the borders around the gains, and each remedy with what to write."""
    lines, advice = [found.admissible.borders], found.admissible.advice
    for remedy in advice.remedies if advice else ():
        written = f": {remedy.entry}" if remedy.entry else ""
        lines.append(f"remedy that was tried: {remedy.words}{written}")
    return lines


def confirmation_table(found: LimitMap) -> Table:
    """Return the confirmed points, with theory and simulation side by side."""
    table = Table("point", "radius", "theory", "simulation", "growth", title="confirmed by simulation")
    for c in found.confirmations:
        verdicts = ["stable" if c.stable else "unstable", "settles" if c.settles else "grows"]
        if not c.agrees:
            verdicts[1] += " (differs)"
        table.add_row(_place(c, found), f"{c.radius:.5f}", *verdicts, f"{c.growth:.3g}")
    return table


def _border(value: float) -> str:
    if within(value):
        return f"{value:.3g}"
    return "none" if math.isinf(value) else f"below {INERTIA_RATIOS[0]:g}"


def _place(c: Confirmation, found: LimitMap) -> str:
    if c.plane == "shaping":
        return f"K_e = {c.horizontal:.3g} K, B_e = {c.vertical:.3g} B"
    if c.plane == "rate":
        gains = "these gains" if found.shaping is None else f"K_e = K, B_e = {c.vertical:.3g} B"
        return f"{hertz(c.horizontal)}: {gains}"
    if (c.horizontal, c.vertical) == (1, 1):
        return "these gains"
    return f"K_x times {c.horizontal:.3g}, D_x times {c.vertical:.3g}"
