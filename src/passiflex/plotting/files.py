"""Figures as files: PNG, PDF and SVG, whole, with text as text, and the same figure as the same bytes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from passiflex.files import OutputError, whole_file
from passiflex.plotting.style import figure_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 200
UNDATED: dict[str, dict[str, None]] = {
    ".png": {},
    ".pdf": {"CreationDate": None},
    ".svg": {"Date": None},
}
"""The kinds of file, and what each must leave out so that it does not change with the day."""
USUAL = (".png", ".pdf")


def save_as(figure: Figure, path: str | Path) -> Path:
    """Write a figure as PNG, PDF or SVG, by how the name ends, close it, and return the path.

    Raises
    ------
    OutputError
        For another kind of file, or if it cannot be written.
    """
    return _written(figure, [Path(path)])[0]


def save_figure(figure: Figure, path: str | Path) -> list[Path]:
    """Write a figure as `save_as` does, or as PNG and as PDF if the name has no end; return the paths.

    Raises
    ------
    OutputError
        For another kind of file, or if it cannot be written.
    """
    path = Path(path)
    return _written(figure, [path] if path.suffix else [path.with_suffix(suffix) for suffix in USUAL])


def _written(figure: Figure, paths: list[Path]) -> list[Path]:
    import matplotlib.pyplot as plt

    for path in paths:
        if path.suffix not in UNDATED:
            needs = f"a name that ends in {', '.join(UNDATED)}"
            raise OutputError("a figure cannot be written as this kind of file", got=str(path), needs=needs)
    for path in paths:
        with whole_file(path) as temporary, figure_style():  # how text is written is decided here
            figure.savefig(temporary, dpi=DPI, metadata=UNDATED[path.suffix])
    plt.close(figure)
    return paths
