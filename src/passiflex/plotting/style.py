"""One style for all figures: the paper's line styles, readable colours, vector fonts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

LINES: dict[str, dict[str, Any]] = {
    "proposed": {"color": "#0b3fd1", "lw": 1.6, "label": "proposed", "zorder": 3},
    "msd": {"color": "black", "lw": 1.4, "ls": "-.", "label": "ideal MSD, ζ = 0.7", "zorder": 4},
    "msd_natural": {"color": "0.45", "lw": 0.8, "ls": "-.", "label": "ideal MSD, Λ(q₀)", "zorder": 2},
    "baseline": {"color": "#c800a1", "lw": 1.4, "label": "baseline, link inertia", "zorder": 2},
    "baseline_motor_aware": {
        "color": "#c800a1",
        "lw": 0.7,
        "ls": "--",
        "label": "baseline, knows B",
        "zorder": 1,
    },
    "reference": {"color": "0.35", "lw": 0.9, "ls": ":", "label": "reference $x_d$", "zorder": 1},
    "total": {"color": "#e07b00", "lw": 1.6, "label": "total 𝓗₂ = 𝓗₁ + T".replace("𝓗", "H")},
    "robot": {"color": "#0b3fd1", "lw": 1.4, "ls": "--", "label": "robot H₁"},
    "tank": {"color": "#c800a1", "lw": 1.4, "ls": "-.", "label": "tank T"},
}
BLUE = "#0b3fd1"
"""Of what this package proposes, and of all that stands alone."""
JOINTS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000", "#999999"]


@contextmanager
def figure_style() -> Iterator[None]:
    """Use the package's style within the block."""
    import matplotlib as mpl

    with mpl.rc_context(
        {
            "font.size": 8,
            "axes.labelsize": 8,
            "axes.titlesize": 9,
            "legend.fontsize": 7,
            "axes.grid": True,
            "grid.alpha": 0.3,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "legend.frameon": False,
            "figure.constrained_layout.use": True,
            "pdf.fonttype": 42,
            "axes.formatter.useoffset": False,
        }
    ):
        yield
