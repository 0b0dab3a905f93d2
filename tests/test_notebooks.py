"""The notebooks of the pages: all code of their example, each cell once and in its order, and every cell runs."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import matplotlib
import matplotlib.pyplot as plt
import pytest

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.md"))
CODE = re.compile(r"^```\{code-cell\}\n((?::[^\n]*\n)*)\n*(.*?)\n?```$", re.MULTILINE | re.DOTALL)


@pytest.fixture
def example_cells(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    pytest.importorskip("sphinx")
    monkeypatch.syspath_prepend(ROOT / "docs" / "_ext")
    return importlib.import_module("example_cells")


@pytest.fixture
def without_a_screen() -> Iterator[None]:
    before = matplotlib.get_backend()
    matplotlib.use("agg")
    yield
    plt.close("all")
    matplotlib.use(before)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_holds_its_example(path: Path, example_cells: ModuleType) -> None:
    script = (ROOT / "examples" / path.name).with_suffix(".py").read_text(encoding="utf-8")
    named = example_cells.NAMED.findall(path.read_text(encoding="utf-8"))
    assert named == [(path.stem, name) for name in example_cells.cells(script)]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, example_cells: ModuleType, without_a_screen: None) -> None:
    names: dict[str, object] = {}
    text = example_cells.filled(path.read_text(encoding="utf-8"))
    for options, code in CODE.findall(text):
        if "remove-cell" not in options:  # that one speaks to Jupyter
            exec(compile(code, path.name, "exec"), names)
    assert plt.get_fignums()


def test_what_a_script_is_split_into(example_cells: ModuleType) -> None:
    script = '"""Why?"""\n\n# %% one\na = 1\n\n# %% two\n\nb = 2\n'
    assert example_cells.cells(script) == {"one": "a = 1", "two": "b = 2"}


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("a_step, the end", "no cell 'the end' in a_step.py, but: none"),
        (
            "why_it_trembles, the end",
            "no cell 'the end' in why_it_trembles.py, but: the scenario, the answer",
        ),
        ("nothing, the end", "no cell 'the end' in nothing.py, but: none"),
    ],
)
def test_a_cell_that_is_not_there_ends_the_build(cell: str, message: str, example_cells: ModuleType) -> None:
    errors = pytest.importorskip("sphinx.errors")
    with pytest.raises(errors.ExtensionError, match=re.escape(message)):
        example_cells.filled(f"---\nfile_format: mystnb\n---\n```{{code-cell}}\n:from: {cell}\n```\n")
