"""Notebooks whose code is that of the examples: a cell may name one of a script, and is filled when the page is read.

    ```{code-cell}
    :from: circle_with_tank, the run
    ```

stands for what is below `# %% the run` in `examples/circle_with_tank.py`.
"""

from __future__ import annotations

import re
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

EXAMPLES = Path(__file__).parents[2] / "examples"
NOTEBOOK = "file_format: mystnb\n"
NAMED = re.compile(r"^```\{code-cell\}\n:from: (\w+), (.+)\n```$", re.MULTILINE)
BEGINS = re.compile(r"^# %% (.+)\n", re.MULTILINE)
SHARP = """
```{code-cell}
:tags: [remove-cell]

%matplotlib inline
%config InlineBackend.figure_formats = ["retina"]
```
"""
"""A first cell that nobody sees: figures with two pixels for one."""


def cells(script: str) -> dict[str, str]:
    """Return the cells of a script by their names, in their order; what is above the first one is none."""
    _, *parts = BEGINS.split(script)
    return {name: code.strip() for name, code in zip(parts[::2], parts[1::2], strict=True)}


def filled(text: str) -> str:
    """Return the text of a notebook with the cells of the examples in it."""

    def code(named: re.Match[str]) -> str:
        path = EXAMPLES / f"{named[1]}.py"
        known = cells(path.read_text(encoding="utf-8")) if path.exists() else {}
        if named[2] not in known:
            raise ExtensionError(f"no cell {named[2]!r} in {path.name}, but: {', '.join(known) or 'none'}")
        return f"```{{code-cell}}\n{known[named[2]]}\n```"

    head, rule, body = text.partition("\n---\n")
    return NAMED.sub(code, f"{head}{rule}{SHARP}{body}")


def fill(app: Sphinx, name: str, source: list[str]) -> None:
    """Fill a page that is a notebook."""
    if source[0].startswith(f"---\n{NOTEBOOK}"):
        for script, _ in NAMED.findall(source[0]):
            app.env.note_dependency(str(EXAMPLES / f"{script}.py"))
        source[0] = filled(source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to Sphinx."""
    app.connect("source-read", fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
