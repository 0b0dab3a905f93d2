"""What the README and the pages show is true: Python runs, commands exist, code is where they say."""

from __future__ import annotations

import importlib
import re
import shlex
import shutil
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
EXAMPLES = ROOT / "docs" / "examples"
FENCE = re.compile(r"^```(\w+)[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
SKIPPED = "<!-- no-run -->"
ROOMS = (
    "robots|phs|control|sampled|native|simulation|passivity|responses|limits|pieces|campaigns|plotting|studies|cli"
    "|errors|layout|files"
)
CODE_NAME = re.compile(rf"`((?:{ROOMS})(?:\.\w+)+)`")


def blocks(text: str, language: str) -> Iterator[tuple[int, str]]:
    """Yield line and text of the fenced blocks in a language that are not marked as not to be run."""
    for block in FENCE.finditer(text):
        before = text[: block.start()].rstrip("\n")
        if block[1] == language and not before.endswith(SKIPPED):
            yield text.count("\n", 0, block.start()) + 1, block[2]


def shown(language: str) -> list[object]:
    return [
        pytest.param(block, id=f"{page.name}:{line}")
        for page in PAGES
        for line, block in blocks(page.read_text(encoding="utf-8"), language)
    ]


def named() -> list[str]:
    return sorted({name for page in PAGES for name in CODE_NAME.findall(page.read_text(encoding="utf-8"))})


def code(dotted: str) -> object:
    """Return what a name like `control.tank.EnergyTank.flow` stands for; a field of a class is enough."""
    parts = ["passiflex", *dotted.split(".")]
    for end in range(len(parts), 0, -1):
        try:
            found: object = importlib.import_module(".".join(parts[:end]))
        except ModuleNotFoundError:
            continue
        for part in parts[end:]:
            fields = getattr(found, "__annotations__", {})
            found = fields[part] if part in fields and not hasattr(found, part) else getattr(found, part)
        return found
    raise AttributeError(dotted)


@pytest.mark.parametrize("block", shown("python"))
def test_python_runs(block: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(EXAMPLES, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    exec(compile(block, "<documentation>", "exec"), {"__name__": "__main__"})


@pytest.mark.parametrize("block", shown("sh"))
def test_commands_exist(block: str) -> None:
    from passiflex.cli import application

    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    for line in block.splitlines():
        words = shlex.split(line, comments=True)
        if words[:1] == ["passiflex"]:
            application().parse_args(words[1:], print_error=False, exit_on_error=False)
        elif words[:1] == ["make"]:
            assert words[1] in targets


def test_the_mistakes_shown_are_those_reported() -> None:
    from passiflex.errors import ScenarioError
    from passiflex.simulation import parse_scenario

    ((_, expected),) = blocks((ROOT / "docs" / "scenarios.md").read_text(encoding="utf-8"), "text")
    with pytest.raises(ScenarioError) as error:
        parse_scenario((EXAMPLES / "mistakes.yaml").read_text(encoding="utf-8"), "mistakes.yaml")
    assert str(error.value) == expected.strip()


@pytest.mark.parametrize("name", named())
def test_code_is_where_the_pages_say(name: str) -> None:
    assert code(name) is not None


@pytest.mark.parametrize("number", range(1, 37))
def test_every_equation_of_the_paper_is_in_the_theory(number: int) -> None:
    text = (ROOT / "docs" / "theory.md").read_text(encoding="utf-8")
    assert f"\\tag{{{number}}}" in text
    assert f"(eq-{number})=" in text


def test_every_section_of_a_scenario_has_its_table(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("sphinx")
    monkeypatch.syspath_prepend(ROOT / "docs" / "_ext")
    sections = [s.__name__ for s in importlib.import_module("scenario_tables").sections()]
    text = (ROOT / "docs" / "scenarios.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"\{scenario-table\} (\w+)", text)) == sorted(sections)


def test_the_finder_of_blocks_sees_languages_lines_and_marks() -> None:
    text = textwrap.dedent(
        f"""\
        A

        ```python
        one
        ```

        {SKIPPED}
        ```python
        two
        ```

        ```sh
        three
        ```
        """
    )
    assert list(blocks(text, "python")) == [(3, "one\n")]
    assert list(blocks(text, "sh")) == [(12, "three\n")]


def test_a_wrong_name_is_seen() -> None:
    with pytest.raises(AttributeError):
        code("control.tank.EnergyTank.flows")
