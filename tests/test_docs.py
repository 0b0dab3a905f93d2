"""What the README and the pages show is true: every block runs, names are those of the code, links lead somewhere."""

from __future__ import annotations

import importlib
import re
import textwrap
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

import pages
import passiflex as pf
from cli.shell import Shell
from pages import EXAMPLES, FENCE, PAGES, ROOT, Block, Walk, blocks, furnish, lines, validate
from passiflex.errors import PassiflexError
from passiflex.robots.catalogue import read_description

ROOMS = "|".join(p.stem for p in (ROOT / "src" / "passiflex").iterdir() if re.match("[a-z]", p.name))
CODE_NAME = re.compile(rf"`((?:{ROOMS})(?:\.\w+)+)`")
ROLE = re.compile(r"\{report\}`[^<]*<(\w+)>`")
COMMAND = re.compile(r"`passiflex ([a-z]\w*)[^`]*`")

at_the_smaller_size = pages.at_the_smaller_size
without_a_screen = pages.without_a_screen


def shown() -> list[object]:
    return [
        pytest.param(block, id=f"{page.name}:{block.line}", marks=[pytest.mark.slow] * block.slow)
        for page in PAGES
        for block in blocks(page)
        if block.mark is None
    ]


def found(pattern: re.Pattern[str]) -> list[str]:
    return sorted({name for page in PAGES for name in pattern.findall(page.read_text(encoding="utf-8"))})


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


@pytest.fixture(scope="module")
def walks(tmp_path_factory: pytest.TempPathFactory) -> dict[Path, Walk]:
    return {page: Walk(page, tmp_path_factory.mktemp(page.stem)) for page in PAGES}


@pytest.mark.parametrize("block", shown())
def test_block_runs(
    block: Block,
    walks: dict[Path, Walk],
    at_the_smaller_size: None,
    without_a_screen: None,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    walks[block.page].to(block, Shell(monkeypatch, capsys), capsys)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_block_that_is_not_run_says_why(page: Path) -> None:
    assert [block.line for block in blocks(page) if block.mark == ""] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_no_block_hides_from_the_finder(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert len(re.findall(r"^[ \t]*(?:```|~~~)", text, re.MULTILINE)) == 2 * len(FENCE.findall(text))


@pytest.mark.parametrize(
    "example", sorted(set(EXAMPLES.glob("*.yaml")) - {EXAMPLES / "mistakes.yaml"}), ids=lambda path: path.name
)
def test_example_files_are_right(example: Path, tmp_path: Path) -> None:
    furnish(tmp_path)
    assert validate(example.read_text(encoding="utf-8"), tmp_path).name


@pytest.mark.parametrize("name", found(CODE_NAME))
def test_code_is_where_the_pages_say(name: str) -> None:
    assert code(name) is not None


@pytest.mark.parametrize("name", found(COMMAND))
def test_commands_of_the_text_exist(name: str) -> None:
    from passiflex.cli import application

    assert name in application()


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


def test_everything_that_is_made_is_shown_and_what_is_shown_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs" / "_ext")
    made = {name for group in importlib.import_module("makers").GROUPS for name in group.names}
    figures = found(re.compile(r"\{figure\} generated/(\S+)"))
    reports = found(re.compile(r"reports/(\w+\.html)")) + [f"{name}.html" for name in found(ROLE)]
    tables = found(re.compile(r"\{include\} generated/(\S+)"))
    arms = [name for name in pf.catalogue() if read_description(name).commanded is not None]
    assert len(arms) >= 10
    cards = [f"card_{name}.html" for name in arms]  # to which the table links
    assert made == {*figures, *reports, *tables, *cards}


def no_viewer(folder: Path) -> None:
    raise PassiflexError("the viewer of reports is not built", try_="building it")


def too_large(folder: Path) -> None:
    (folder / "run.html").write_bytes(bytes(3_000_001))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (no_viewer, "run.html cannot be made: the viewer of reports is not built; try building it"),
        (too_large, "run.html has 3000001 bytes, more than 3000000"),
    ],
)
def test_a_report_that_cannot_be_made_ends_the_build(
    make: Callable[[Path], None], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    errors = pytest.importorskip("sphinx.errors")
    monkeypatch.syspath_prepend(ROOT / "docs" / "_ext")
    extension, makers = importlib.import_module("made_figures"), importlib.import_module("makers")
    monkeypatch.setattr(extension, "GROUPS", (makers.Group(("run.html",), make),))
    with pytest.raises(errors.ExtensionError, match=re.escape(message)):
        extension.make(SimpleNamespace(srcdir=tmp_path))
    assert list(tmp_path.glob("generated/*")) == []


def test_the_keys_of_a_report_are_those_of_its_viewer() -> None:
    viewer = (ROOT / "web" / "src" / "keys.ts").read_text(encoding="utf-8")
    page = (ROOT / "docs" / "reports.md").read_text(encoding="utf-8")
    table = page.partition("| key | does |")[2].partition("\n\n")[0]
    told = re.findall(r"^\| (.+?) \| (.+?) \|$", table, re.MULTILINE)[1:]
    keys = [
        (set(re.findall('"([^"]+)"', names)), does)
        for names, does in re.findall(r'\[\[([^\]]+)\], "([^"]+)"\]', viewer)
    ]
    assert [does for _, does in told] == [does for _, does in keys]
    for (names, _), (known, _) in zip(told, keys, strict=True):
        assert set(names.split(", ")) == known


def test_every_page_is_in_the_contents() -> None:
    entries = [
        (page.parent / f"{entry}.md").resolve()
        for page in PAGES[1:]
        for contents in re.findall(r"\{toctree\}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
        for entry in re.findall(r"^([a-z_/]+)$", contents, re.MULTILINE)
    ]
    assert sorted(entries) == sorted(set(PAGES[1:]) - {ROOT / "docs" / "index.md"})


def test_every_public_name_is_in_the_reference() -> None:
    pages = [page for page in PAGES if page.parent.name == "reference"]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    whole = re.findall(r"automodule:: passiflex\.(\w+)\n   :members:\n   :imported-members:", text)
    rooms = {path.parent.name for path in (ROOT / "src" / "passiflex").glob("*/__init__.py")}
    for room in sorted(rooms - {"cli"} - set(whole)):  # cli is for the shell
        module = importlib.import_module(f"passiflex.{room}")
        names = [name for name in dir(module) if not name.startswith("_")]
        public = [
            n for n in names if str(getattr(getattr(module, n), "__module__", "")).startswith("passiflex")
        ]
        assert [name for name in public if not re.search(rf"\b{name}\b", text)] == [], room


def test_the_glossary_is_in_the_order_of_the_alphabet() -> None:
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    words = re.findall(r"^(\w.*)\n  \w", text.partition("```{glossary}")[2], re.MULTILINE)
    assert len(words) == len(set(words)) > 40
    assert words == sorted(words)


PAGE = textwrap.dedent(
    """\
    A

    ```python
    one = 1
    print("one", 0.5)
    ```

    ```text
    one …
    ```

    <!-- no-run: a reason -->
    ```python
    two
    ```

    <!-- no-run -->
    ```sh
    three
    ```

    ```{directive} four
    five
    ```
    """
)


@pytest.fixture
def page(tmp_path: Path) -> Path:
    (tmp_path / "page.md").write_text(PAGE, encoding="utf-8")
    return tmp_path / "page.md"


def test_the_finder_of_blocks_sees_languages_lines_and_marks(page: Path) -> None:
    assert [block[1:] for block in blocks(page)] == [
        (3, "python", 'one = 1\nprint("one", 0.5)\n', None),
        (8, "text", "one …\n", None),
        (13, "python", "two\n", "a reason"),
        (18, "sh", "three\n", ""),
    ]


def test_a_walk_runs_what_is_above_and_compares_output(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shell = Shell(monkeypatch, capsys)
    above, below, *_ = blocks(page)
    walk = Walk(page, tmp_path / "folder")
    walk.to(below, shell, capsys)
    assert walk.to(above, shell, capsys) == "one 0.5\n"

    page.write_text(PAGE.replace("one …", "two …"), encoding="utf-8")
    with pytest.raises(AssertionError, match=r"not what was printed:\none 0.5"):
        Walk(page, tmp_path / "other").to(list(blocks(page))[1], shell, capsys)


@pytest.mark.parametrize(
    ("language", "text", "message"),
    [
        ("sh", "make nothing", "no target of the Makefile: nothing"),
        ("sh", "pip install passiflex[dusk]", "no extra of the package: .*dusk"),
        ("sh", "passiflex audit none.nc", "none.nc"),
        ("sh", "rm -rf results", "no test knows the command: rm"),
        ("bash", "passiflex robots", "no test knows what a block of bash is"),
        ("", "anything", "no test knows what a block of no language is"),
        ("yaml", "tank: {kind: prot}", "prot"),
        ("python", "1 / 0", "division by zero"),
    ],
)
def test_what_is_wrong_on_a_page_is_seen(
    language: str,
    text: str,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"```{language}\n{text}\n```\n", encoding="utf-8")
    (block,) = blocks(page)
    with pytest.raises(Exception, match=message):
        Walk(page, tmp_path / "folder").to(block, Shell(monkeypatch, capsys), capsys)


def test_lines_of_the_shell_go_on_and_have_comments() -> None:
    assert lines("# a\npassiflex robots \\\n  # all\n\nmake docs # b\n") == [
        "passiflex robots    # all",
        "make docs # b",
    ]


def test_parts_of_scenarios_are_put_into_a_whole_one(tmp_path: Path) -> None:
    furnish(tmp_path)
    assert validate("tank: {initial: 3 J}", tmp_path).tank.initial == 3
    whole = yaml.safe_load((EXAMPLES / "push.yaml").read_text(encoding="utf-8"))
    assert validate(yaml.safe_dump(whole), tmp_path).name == "push"


def test_a_wrong_name_is_seen() -> None:
    with pytest.raises(AttributeError):
        code("control.tank.EnergyTank.flows")
