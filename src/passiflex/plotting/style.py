"""One style for all figures: a table of what lines mean and how they look, sizes, readable fonts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from passiflex.errors import NameUnknownError

DASHED, DOTTED, DASH_DOT, LONG = (6.0, 2.5), (1.5, 2.0), (7.0, 2.0, 1.5, 2.0), (11.0, 3.0)
"""Lengths of line and gap in turn: points in print, pixels on a screen, for a line as wide as one of them."""


class Role(NamedTuple):
    """How a line looks: colour on white and on a dark ground, width (pt or px), dash (same unit), name, layer."""

    light: str
    dark: str
    width: float
    dash: tuple[float, ...]
    label: str
    layer: int = 2


def _joints() -> dict[str, Role]:
    """Return the joints: what looks alike to somebody who sees fewer colours differs in its dash."""
    light = ("#0072b2", "#d55e00", "#009e73", "#9c3f78", "#2f8fc9", "#a87400", "#000000", "#767676")
    dark = ("#4aa8ec", "#ff8a3d", "#2fd0a0", "#ffc4ec", "#8fd0ff", "#f0c040", "#f2f2f2", "#a0a0a0")
    dashes = ((), (), (), (), DASHED, DASHED, DASH_DOT, LONG)
    return {
        f"joint {i}": Role(on_white, on_dark, 1.0, dash, f"joint {i}")
        for i, (on_white, on_dark, dash) in enumerate(zip(light, dark, dashes, strict=True), start=1)
    }


def _surfaces() -> dict[str, Role]:
    """Return what touches the hand."""
    looks = (
        ("#8a5a00", "#f0c040", ()),
        ("#0072b2", "#4aa8ec", DASHED),
        ("#9c3f78", "#ffc4ec", DASH_DOT),
        ("#00795a", "#2fd0a0", DOTTED),
    )
    return {
        f"surface {i}": Role(light, dark, 1.2, dash, f"surface {i}")
        for i, (light, dark, dash) in enumerate(looks, start=1)
    }


def _others() -> dict[str, Role]:
    """Return compared runs, each with a second line for its total energy."""
    looks = (
        ("#a63603", "#ff9a5c", LONG),
        ("#00795a", "#2fd0a0", (8.0, 2.0, 1.5, 2.0, 1.5, 2.0)),
        ("#6a51a3", "#b8a2ff", (3.0, 1.5)),
        ("#8a6d00", "#e8c547", (9.0, 2.0, 3.0, 2.0)),
    )
    roles = {}
    for k, (light, dark, dash) in enumerate(looks, start=1):
        roles[f"other {k}"] = Role(light, dark, 1.3, dash, f"run {k + 1}")
        roles[f"other {k} total"] = Role(light, dark, 0.8, (*dash, *DOTTED), f"total of run {k + 1}", 1)
    return roles


PAPER_BLUE, PAPER_MAGENTA, PAPER_ORANGE = (
    ("#0b3fd1", "#4d8dff"),
    ("#c800a1", "#ff8ad0"),
    ("#e07b00", "#ffa94d"),
)
"""The paper's colours, on white and on a dark ground."""

ROLES: dict[str, Role] = {
    # the end effector, as in Figs. 1 and 3
    "proposed": Role(*PAPER_BLUE, 1.6, (), "proposed", 3),
    "msd": Role("#000000", "#f2f2f2", 1.4, DASH_DOT, "ideal MSD, ζ = 0.7", 4),
    "msd_natural": Role("#737373", "#9a9a9a", 0.8, DASH_DOT, "ideal MSD, Λ(q₀)"),
    "baseline": Role(*PAPER_MAGENTA, 1.4, (), "baseline, link inertia"),
    "baseline_motor_aware": Role(*PAPER_MAGENTA, 0.7, DASHED, "baseline, knows B", 1),
    "reference": Role("#595959", "#b4b4b4", 1.0, DOTTED, "reference $x_d$", 1),
    "governed": Role("#595959", "#b4b4b4", 1.2, DASHED, "reference in force"),
    # energies, as in Fig. 2
    "total": Role(*PAPER_ORANGE, 1.6, (), "total H₂ = H₁ + T"),
    "robot": Role(*PAPER_BLUE, 1.4, DASHED, "robot H₁"),
    "tank": Role(*PAPER_MAGENTA, 1.4, DASH_DOT, "tank T", 3),
    "kinetic": Role("#00795a", "#2fd0a0", 0.9, (), "kinetic"),
    "spring": Role("#6b6b6b", "#b0b0b0", 1.1, DOTTED, "springs"),
    "true": Role(*PAPER_BLUE, 1.2, (), "T that is really there"),
    "available": Role("#00795a", "#2fd0a0", 1.2, DASHED, "what may still be given", 1),
    # ports
    "environment": Role("#0072b2", "#4aa8ec", 1.5, (), "environment", 4),
    "motor": Role("#d55e00", "#ff8a3d", 1.0, (), "motors"),
    "joint": Role("#000000", "#f2f2f2", 1.1, DASHED, "joints", 3),
    "loss": Role("#b0568a", "#e79fc9", 1.1, DASH_DOT, "lost in the joints"),
    "friction": Role("#8a6d00", "#e8c547", 1.1, DOTTED, "lost in friction"),
    "granted": Role("#d55e00", "#ff8a3d", 1.2, LONG, "paid for the reference"),
    "refilled": Role("#00795a", "#2fd0a0", 1.2, (), "given to the tank"),
    "moving reference": Role("#595959", "#b4b4b4", 1.2, DOTTED, "moving reference", 3),
    "drawn": Role(*PAPER_MAGENTA, 1.2, DASH_DOT, "drawn from the tank"),
    "spilled": Role("#a87400", "#f0c040", 1.0, DASHED, "past the tank"),
    **_joints(),
    **_surfaces(),
    **_others(),
    # verdicts, told apart by shape as well, and signs
    "passive": Role("#0072b2", "#4aa8ec", 1.0, (), "passive"),
    "violated": Role("#d55e00", "#ff8a3d", 1.0, (), "violated"),
    "inconclusive": Role("#e69f00", "#f0c040", 1.0, (), "inconclusive"),
    "neutral": Role("#737373", "#9a9a9a", 1.0, (), "neither"),
    # what is no signal
    "level": Role("#404040", "#c8c8c8", 0.9, (4.0, 3.0), "level", 9),
    "mark": Role("#808080", "#8a8f98", 0.7, DOTTED, "event", 0),
    "governor": Role("#e69f00", "#e69f00", 0.0, (), "reference held back", 0),
    "fallback": Role("#8c8c8c", "#8c8c8c", 0.0, (), "fallen back", 0),
    "force": Role("#56b4e9", "#56b4e9", 0.0, (), "force", 0),
}
"""What a line or a shade means, and how it looks: the only place where a colour of a signal stands."""

SHADE = 0.25
"""Opacity of a stretch of time that is shaded."""
JOINT_ROLES = tuple(role for role in ROLES if role.startswith("joint "))


class Size(NamedTuple):
    """Width [in] of a figure and height [in] of one diagram in it, font [pt], and how much wider lines are."""

    width: float
    height: float
    font: float
    lines: float


SIZES: dict[str, Size] = {
    "column": Size(3.5, 1.35, 7.0, 0.8),
    "double": Size(7.16, 1.5, 8.0, 1.0),
    "slide": Size(10.0, 2.4, 12.0, 1.6),
}
"""A column of a paper, its whole width, and a slide."""


def size_of(name: str) -> Size:
    """Return a size by its name.

    Raises
    ------
    NameUnknownError
        If there is none of this name.
    """
    if name not in SIZES:
        raise NameUnknownError("size", name, SIZES)
    return SIZES[name]


def line(role: str, scale: float = 1.0) -> dict[str, Any]:
    """Return the keywords of matplotlib for a line of a role, `scale` times as wide."""
    r = ROLES[role]
    style: Any = (0, tuple(length / r.width for length in r.dash)) if r.dash else "-"
    return {
        "color": r.light,
        "lw": scale * r.width,
        "ls": style,
        "label": r.label,
        "zorder": 2 + r.layer / 10,
    }


LINES: dict[str, dict[str, Any]] = {role: line(role) for role, look in ROLES.items() if look.width}
JOINTS = [ROLES[role].light for role in JOINT_ROLES]
BLUE = ROLES["proposed"].light
"""Of what this package proposes, and of all that stands alone."""


def axis_label(text: str, unit: str) -> str:
    """Return the label of an axis: what it shows, and its unit in brackets, [1] for a pure number."""
    return f"{text} [{unit}]"


@contextmanager
def figure_style(size: str = "double") -> Iterator[None]:
    """Use the package's style within the block, with the fonts of a named size."""
    import matplotlib as mpl

    chosen = size_of(size)
    font = chosen.font
    with mpl.rc_context(
        {
            "font.size": font,
            "axes.labelsize": font,
            "axes.titlesize": font + 1,
            "legend.fontsize": font - 1,
            "xtick.labelsize": font,
            "ytick.labelsize": font,
            "axes.linewidth": 0.8 * chosen.lines,
            "axes.grid": True,
            "grid.alpha": 0.3,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "legend.frameon": False,
            "legend.handlelength": 3.0,  # long enough for every dash
            "figure.constrained_layout.use": True,
            "axes.formatter.useoffset": False,
            # text stays text in vector files, and the same figure is the same file
            "pdf.fonttype": 42,
            "svg.fonttype": "none",
            "svg.hashsalt": "passiflex",
        }
    ):
        yield
