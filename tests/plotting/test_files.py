"""Figures as files: the same bytes for the same figure, text as text, and no other kinds of file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from passiflex.errors import PassiflexError
from passiflex.plotting.files import UNDATED, save_as, save_figure
from passiflex.plotting.style import LINES, figure_style


def figure() -> Figure:
    with figure_style():
        made, axes = plt.subplots(figsize=(2, 2))
        axes.plot(np.arange(5.0), np.arange(5.0) ** 2, **LINES["tank"])
        axes.fill_between(np.arange(5.0), 0, 1, alpha=0.3)
        axes.set_xlabel("time [s]")
        axes.legend()
        return made


@pytest.mark.parametrize("suffix", UNDATED)
def test_the_same_figure_is_the_same_file(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    open_before = plt.get_fignums()  # by whoever ran in this process
    first = save_as(figure(), tmp_path / f"a{suffix}")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")  # another day
    second = save_as(figure(), str(tmp_path / f"b{suffix}"))
    assert first.read_bytes() == second.read_bytes()
    assert plt.get_fignums() == open_before


def test_the_kinds_of_file(tmp_path: Path) -> None:
    assert save_as(figure(), tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert save_as(figure(), tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
    text = save_as(figure(), tmp_path / "a.svg").read_text()
    assert "time [s]</text>" in text
    assert "tank T</text>" in text


def test_a_bare_name_is_a_png_and_a_pdf(tmp_path: Path) -> None:
    assert save_figure(figure(), tmp_path / "a") == [tmp_path / "a.png", tmp_path / "a.pdf"]
    assert save_figure(figure(), tmp_path / "b.svg") == [tmp_path / "b.svg"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.pdf", "a.png", "b.svg"]


@pytest.mark.parametrize("name", ["a.jpg", "a.nc", "a"])
def test_another_kind_of_file_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(PassiflexError) as error:
        save_as(figure(), Path(name))
    assert str(error.value) == (
        f"a figure cannot be written as this kind of file; got {name}; needs a name that ends in .png, .pdf, .svg"
    )
    assert not list(tmp_path.iterdir())
    plt.close("all")
