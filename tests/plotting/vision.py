"""Colours as people see them: in CIELAB, with all cones or without one kind, and their contrast with a ground."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import to_rgb

VISION = {
    "all cones": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
}
"""Machado, Oliveira and Fernandes (2009), severity 1, on linear RGB."""
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
WHITE = TO_XYZ @ np.ones(3)


def linear(color: str) -> np.ndarray:
    rgb = np.array(to_rgb(color))
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def lab(color: str, vision: str) -> np.ndarray:
    """Return L*, a*, b*."""
    xyz = TO_XYZ @ np.clip(VISION[vision] @ linear(color), 0, 1) / WHITE
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def distance(first: str, second: str) -> float:
    """Return the least distance of two colours to anybody; 2.3 is just noticeable side by side."""
    return min(float(np.linalg.norm(lab(first, v) - lab(second, v))) for v in VISION)


def contrast(color: str, ground: str) -> float:
    """Return the contrast by WCAG, 1 to 21."""
    bright = sorted(float(TO_XYZ[1] @ linear(c)) + 0.05 for c in (color, ground))
    return bright[1] / bright[0]
