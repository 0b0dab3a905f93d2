"""The picture of a card, the arm where its gains are nearest to their limit, and the card on one page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from passiflex.robots.frames import world_frames

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from passiflex.cards import Card

LINK, JOINT = "#33658a", "#f26419"
A4 = (8.27, 11.69)
"""[in]"""
MARGIN, LARGEST, SMALLEST_PICTURE = 0.05, 7.5, 0.16
"""Share of the page around the text; size of the letters at most [pt]; share of the page left for the picture."""
TITLE, BENEATH, LARGEST_PICTURE, WIDTH = 0.035, 0.06, 0.25, 0.4
"""Shares of the page: above the picture for its title, beneath it for its numbers; its height at most, its width."""
WIDE, HIGH = 0.63, 1.26
"""Width of a letter and height of a line, in sizes of the letters."""


def draw_posture(axes: Axes, card: Card) -> None:
    """Draw the arm from the side, in the plane in which it reaches farthest."""
    q = card.bare.border.posture
    chain = card.robot.arm.chain
    points = world_frames(chain, np.atleast_2d(q)).position[0] @ chain.mount.T
    away = points[-1, :2] - points[0, :2]
    size = float(np.linalg.norm(away))
    along = away / size if size > 1e-9 else np.array([1.0, 0.0])
    x, z = points[:, :2] @ along, points[:, 2]
    axes.plot(x, z, color=LINK, linewidth=4, solid_capstyle="round")
    axes.plot(x[1:-1], z[1:-1], "o", color=JOINT, markersize=6)
    axes.plot(x[-1], z[-1], "s", color=JOINT, markersize=5)
    axes.axhline(points[0, 2], color="0.7", linewidth=1)
    middle, half = (x.min() + x.max()) / 2, max(np.ptp(x), np.ptp(z)) / 2
    axes.set_xlim(middle - 1.1 * half, middle + 1.1 * half)
    axes.set_aspect("equal")
    axes.set_xlabel("m")
    axes.set_title("where it is nearest to its limit", fontsize=8)
    axes.tick_params(labelsize=7)


def draw_card(card: Card) -> Figure:
    """Return the picture alone."""
    figure = Figure(figsize=(3, 3), layout="constrained")
    FigureCanvasSVG(figure)
    draw_posture(figure.add_subplot(), card)
    return figure


def draw_page(card: Card, text: str) -> Figure:
    """Return the card on a page: its text, and the picture below it."""
    figure = Figure(figsize=A4)
    lines, room = text.rstrip("\n").split("\n"), 1 - 2 * MARGIN
    by_width = room * A4[0] * 72 / (WIDE * max(map(len, lines)))
    by_height = (room - SMALLEST_PICTURE) * A4[1] * 72 / (HIGH * len(lines))
    size = min(LARGEST, by_width, by_height)
    figure.text(MARGIN, 1 - MARGIN, "\n".join(lines), family="monospace", fontsize=size, va="top")
    below = 1 - MARGIN - HIGH * len(lines) * size / 72 / A4[1]
    top = below - TITLE
    height = min(top - BENEATH, LARGEST_PICTURE)
    draw_posture(figure.add_axes((1 - MARGIN - WIDTH, top - height, WIDTH, height)), card)
    return figure
